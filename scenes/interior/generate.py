#!/usr/bin/env python3
"""Writes the interior scene: scene.gltf, scene.bin and textures/*.png beside this script (or into the directory given).

A room of 6 x 2.8 x 8 m with a window, textured furniture and 50 instances of dense meshes: 1,036,330 triangles. Units
are metres, +Y up; textures are 512 x 512. Needs Python 3.9 and numpy. Every random number comes from numpy's legacy
RandomState with a fixed seed, whose streams are frozen. env.exr beside the script is the sky outside the window.
"""

import json
import math
import os
import struct
import sys
import zlib

import numpy as np

ROOM_X, ROOM_Y, ROOM_Z = 3.0, 2.8, 4.0  # the room is [-x, x] by [0, y] by [-z, z]
TILE = 2.0  # metres that one repetition of a wall or floor texture covers
TEXTURE = 512


class Gltf:
    """One buffer, one scene; accessors are packed in the order in which they are made."""

    def __init__(self, name, width, height):
        extras = {"render": {"width": width, "height": height}, "environment": {"uri": "env.exr", "intensity": 1.0}}
        self.width, self.height, self.binary, self.extensions = width, height, bytearray(), set()
        self.root = {
            "asset": {"version": "2.0", "generator": "pathspace scenes/interior/generate.py"},
            "scene": 0,
            "scenes": [{"name": name, "nodes": [], "extras": extras}],
            "nodes": [],
            "meshes": [],
            "materials": [],
            "accessors": [],
            "bufferViews": [],
            "buffers": [],
            "cameras": [],
            "images": [],
            "textures": [],
            "samplers": [{"magFilter": 9729, "minFilter": 9729, "wrapS": 10497, "wrapT": 10497}],
        }
        self.material_index = {}

    def accessor(self, array, component_type, kind, target, bounds=False):
        self.binary += b"\0" * (-len(self.binary) % 4)
        data = array.tobytes()
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data), "target": target}
        self.root["bufferViews"].append(view)
        self.binary += data
        count = int(array.size if kind == "SCALAR" else array.shape[0])
        accessor = {
            "bufferView": len(self.root["bufferViews"]) - 1,
            "componentType": component_type,
            "count": count,
            "type": kind,
        }
        if bounds:
            accessor["min"] = [float(x) for x in array.min(0)]
            accessor["max"] = [float(x) for x in array.max(0)]
        self.root["accessors"].append(accessor)
        return len(self.root["accessors"]) - 1

    def texture(self, uri):
        for index, image in enumerate(self.root["images"]):
            if image["uri"] == uri:
                return {"index": index}
        self.root["images"].append({"uri": uri})
        self.root["textures"].append({"source": len(self.root["images"]) - 1, "sampler": 0})
        return {"index": len(self.root["textures"]) - 1}

    def material(self, name, base=(1, 1, 1), metallic=0.0, roughness=1.0, lambert=True, textures=()):
        pbr = {
            "baseColorFactor": [float(x) for x in base] + [1.0],
            "metallicFactor": float(metallic),
            "roughnessFactor": float(roughness),
        }
        material = {"name": name, "pbrMetallicRoughness": pbr, "doubleSided": True}
        if "base" in textures:
            pbr["baseColorTexture"] = self.texture(f"textures/{name}_base.png")
        if "mr" in textures:
            pbr["metallicRoughnessTexture"] = self.texture(f"textures/{name}_mr.png")
        if "normal" in textures:
            material["normalTexture"] = {**self.texture(f"textures/{name}_normal.png"), "scale": 1.0}
        if lambert:  # no dielectric highlight: the non-metallic part is exactly base / pi
            material["extensions"] = {"KHR_materials_specular": {"specularFactor": 0.0}}
            self.extensions.add("KHR_materials_specular")
        self.material_index[name] = len(self.root["materials"])
        self.root["materials"].append(material)

    def mesh(self, name, positions, indices, material, normals=None, uvs=None, tangents=None):
        def floats(array, kind, bounds=False):
            return self.accessor(np.ascontiguousarray(array, np.float32), 5126, kind, 34962, bounds)

        attributes = {"POSITION": floats(positions, "VEC3", True)}
        for semantic, array, kind in (
            ("NORMAL", normals, "VEC3"),
            ("TANGENT", tangents, "VEC4"),
            ("TEXCOORD_0", uvs, "VEC2"),
        ):
            if array is not None:
                attributes[semantic] = floats(array, kind)
        flat = np.ascontiguousarray(np.asarray(indices).reshape(-1), np.uint32)
        primitive = {
            "attributes": attributes,
            "indices": self.accessor(flat, 5125, "SCALAR", 34963),
            "material": self.material_index[material],
        }
        self.root["meshes"].append({"name": name, "primitives": [primitive]})
        return len(self.root["meshes"]) - 1

    def node(self, name, mesh=None, translation=None, rotation=None, scale=None, **members):
        node = dict(members, name=name)
        if mesh is not None:
            node["mesh"] = mesh
        for key, value in (("translation", translation), ("rotation", rotation), ("scale", scale)):
            if value is not None:
                node[key] = [float(x) for x in value]
        self.root["scenes"][0]["nodes"].append(len(self.root["nodes"]))
        self.root["nodes"].append(node)

    def add(self, name, positions, indices, material, **attributes):
        self.node(name, self.mesh(name, positions, indices, material, **attributes))

    def quads(self, name, quads, material):
        positions = np.array(quads, np.float64).reshape(-1, 3)
        self.add(name, positions, np.concatenate([quad_indices(i) for i in range(len(positions) // 4)]), material)

    def camera(self, eye, target, up, yfov_deg):
        eye, target, up = (np.array(v, np.float64) for v in (eye, target, up))
        z = eye - target
        z /= np.linalg.norm(z)
        x = np.cross(up, z)
        x /= np.linalg.norm(x)
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = x, np.cross(z, x), z, eye
        perspective = {"yfov": math.radians(yfov_deg), "aspectRatio": self.width / self.height, "znear": 0.01}
        self.root["cameras"].append({"type": "perspective", "perspective": perspective})
        self.node("camera", camera=0, matrix=[float(v) for v in matrix.T.reshape(-1)])

    def write(self, directory):
        self.root["buffers"] = [{"uri": "scene.bin", "byteLength": len(self.binary)}]
        self.root["extensionsUsed"] = sorted(self.extensions)
        with open(os.path.join(directory, "scene.bin"), "wb") as file:
            file.write(bytes(self.binary))
        with open(os.path.join(directory, "scene.gltf"), "w", encoding="utf-8") as file:
            json.dump(self.root, file, indent=1)


# ------------------------------------------------------------------------------------------------------------- shapes


def quad_indices(number):
    return np.array([[0, 1, 2], [0, 2, 3]]) + 4 * number


def box(low, high):
    """Six outward quads of an axis-aligned box, each counter-clockwise seen from outside."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    p = np.array(
        [
            [x0, y0, z0],
            [x1, y0, z0],
            [x1, y1, z0],
            [x0, y1, z0],
            [x0, y0, z1],
            [x1, y0, z1],
            [x1, y1, z1],
            [x0, y1, z1],
        ],
        float,
    )
    faces = [[4, 5, 6, 7], [1, 0, 3, 2], [5, 1, 2, 6], [0, 4, 7, 3], [7, 6, 2, 3], [0, 1, 5, 4]]
    return [[list(p[i]) for i in face] for face in faces]


def icosphere(subdivisions):
    t = (1 + 5**0.5) / 2
    v = np.array(
        [
            [-1, t, 0],
            [1, t, 0],
            [-1, -t, 0],
            [1, -t, 0],
            [0, -1, t],
            [0, 1, t],
            [0, -1, -t],
            [0, 1, -t],
            [t, 0, -1],
            [t, 0, 1],
            [-t, 0, -1],
            [-t, 0, 1],
        ]
    )
    f = np.array(
        [
            [0, 11, 5],
            [0, 5, 1],
            [0, 1, 7],
            [0, 7, 10],
            [0, 10, 11],
            [1, 5, 9],
            [5, 11, 4],
            [11, 10, 2],
            [10, 7, 6],
            [7, 1, 8],
            [3, 9, 4],
            [3, 4, 2],
            [3, 2, 6],
            [3, 6, 8],
            [3, 8, 9],
            [4, 9, 5],
            [2, 4, 11],
            [6, 2, 10],
            [8, 6, 7],
            [9, 8, 1],
        ]
    )
    v = v / np.linalg.norm(v, axis=1, keepdims=True)
    for _ in range(subdivisions):
        edges = np.sort(np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]]), 1)
        unique, inverse = np.unique(edges, axis=0, return_inverse=True)
        inverse = inverse.reshape(-1)
        middle = v[unique[:, 0]] + v[unique[:, 1]]
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        k = len(f)
        a, b, c = (inverse[i * k : (i + 1) * k] + len(v) for i in range(3))
        f = np.concatenate([np.stack(x, 1) for x in ((f[:, 0], a, c), (f[:, 1], b, a), (f[:, 2], c, b), (a, b, c))])
        v = np.concatenate([v, middle])
    return v, f


def vertex_normals(positions, faces):
    n = np.cross(positions[faces[:, 1]] - positions[faces[:, 0]], positions[faces[:, 2]] - positions[faces[:, 0]])
    normals = np.zeros_like(positions)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], n)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def torus_knot(p, q, nu, nv, tube=0.24, bump=0.03, ku=40, kv=6, major=1.0, minor=0.42):
    """A closed tube around the (p, q) torus knot with cosine bumps, wound outwards."""

    def centre(t):
        r = major + minor * np.cos(q * t)
        return np.stack([r * np.cos(p * t), minor * np.sin(q * t) * 1.0, r * np.sin(p * t)], 1)

    u, v = np.meshgrid(np.arange(nu) / nu, np.arange(nv) / nv, indexing="ij")
    t, a, h = 2 * np.pi * u.reshape(-1), 2 * np.pi * v.reshape(-1), 1e-4
    c, tangent = centre(t), centre(t + h) - centre(t - h)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    binormal = np.cross(tangent, np.stack([np.cos(p * t), 0 * t, np.sin(p * t)], 1))
    binormal /= np.linalg.norm(binormal, axis=1, keepdims=True)
    normal = np.cross(binormal, tangent)
    radius = tube + bump * np.cos(ku * t) * np.cos(kv * a)
    positions = c + radius[:, None] * (np.cos(a)[:, None] * normal + np.sin(a)[:, None] * binormal)
    i, j = (x.reshape(-1) for x in np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij"))
    k00, k10 = i * nv + j, ((i + 1) % nu) * nv + j
    k11, k01 = ((i + 1) % nu) * nv + (j + 1) % nv, i * nv + (j + 1) % nv
    faces = np.concatenate([np.stack([k00, k10, k11], 1), np.stack([k00, k11, k01], 1)])
    volume = np.einsum(
        "ij,ij->i", positions[faces[:, 0]], np.cross(positions[faces[:, 1]], positions[faces[:, 2]])
    ).sum()
    if volume < 0:
        faces = faces[:, ::-1]
    return positions, faces, vertex_normals(positions, faces)


def bumpy_sphere(subdivisions, amplitude, frequency, seed):
    v, f = icosphere(subdivisions)
    random = np.random.RandomState(seed)
    directions, phases, height = random.normal(size=(8, 3)), random.uniform(0, 6.28, 8), np.zeros(len(v))
    for i in range(8):
        height += np.cos(frequency * (v @ directions[i]) + phases[i])
    positions = v * (1 + amplitude * height / 8)[:, None]
    return positions, f, vertex_normals(positions, f)


# ----------------------------------------------------------------------------------------------------------- textures


def write_png(path, texels):
    """8-bit RGB; each row is stored as differences to the row above (PNG filter 2)."""
    height, width, _ = texels.shape
    above = np.vstack([np.zeros((1, width, 3), np.uint8), texels[:-1]])
    rows = np.concatenate([np.full((height, 1), 2, np.uint8), (texels - above).reshape(height, -1)], 1)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    with open(path, "wb") as file:
        file.write(
            b"\x89PNG\r\n\x1a\n"
            + chunk(b"IHDR", header)
            + chunk(b"IDAT", zlib.compress(rows.tobytes(), 9))
            + chunk(b"IEND", b"")
        )


def bytes_of(values):
    return np.round(255 * np.clip(values, 0, 1)).astype(np.uint8)


def srgb_bytes_of(linear):
    linear = np.clip(linear, 0, 1)
    return np.round(255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)).astype(
        np.uint8
    )


def noise(seed, exponent):
    """Periodic noise with spectrum 1/f^exponent, in [0, 1]."""
    n = TEXTURE
    white = np.random.RandomState(seed).normal(size=(n, n))
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(n), np.fft.fftfreq(n)))
    frequency[0, 0] = 1
    field = np.real(np.fft.ifft2(np.fft.fft2(white) / frequency**exponent))
    field -= field.min()
    return field / field.max()


def normals_of(height, strength):
    """Tangent-space normals of a height field; rows run down, hence against the bitangent (+Y up, as glTF wants)."""
    dx = (np.roll(height, -1, 1) - np.roll(height, 1, 1)) * strength
    dy = (np.roll(height, -1, 0) - np.roll(height, 1, 0)) * strength
    n = np.stack([-dx, dy, np.ones_like(height)], -1)
    return bytes_of(n / np.linalg.norm(n, axis=-1, keepdims=True) * 0.5 + 0.5)


def metallic_roughness(roughness, metallic):
    return bytes_of(np.stack([np.ones_like(roughness), roughness, metallic], -1))


def textures(directory):
    n = TEXTURE
    y, x = np.mgrid[0:n, 0:n] / n
    images = {}
    # Wood: eight planks with fibres, gaps and metal nails.
    plank = np.floor(y * 8)
    white = np.fft.fft2(np.random.RandomState(2).normal(size=(n, n)))
    fibre = np.real(
        np.fft.ifft2(
            white / (1e-3 + np.abs(np.fft.fftfreq(n))[:, None] ** 0.6 + 6 * np.abs(np.fft.fftfreq(n))[None] ** 1.0)
        )
    )
    fibre -= fibre.min()
    fibre /= fibre.max()
    tone = np.random.RandomState(3).uniform(0.55, 1.0, 8)[plank.astype(int)]
    seam = np.minimum((y * 8) % 1, 1 - (y * 8) % 1)
    base = np.stack([0.42 * tone, 0.26 * tone, 0.14 * tone], -1) * (0.6 + 0.6 * fibre[..., None])
    base[seam < 0.03] *= 0.25
    nail = ((((x * 4) % 1 - 0.5) / 4) ** 2 + (((y * 8) % 1 - 0.5) / 8) ** 2) < (0.012) ** 2
    images["wood_base"] = srgb_bytes_of(base)
    images["wood_normal"] = normals_of(fibre * 0.6 + np.clip(seam / 0.06, 0, 1) * 1.2, 1.2)
    images["wood_mr"] = metallic_roughness(np.where(nail, 0.35, 0.45 + 0.4 * fibre), nail)
    # Plaster.
    plaster = noise(5, 1.6)
    images["plaster_base"] = srgb_bytes_of(
        np.stack([0.72 + 0.1 * plaster, 0.70 + 0.1 * plaster, 0.64 + 0.1 * plaster], -1)
    )
    images["plaster_normal"] = normals_of(plaster, 14.0)
    # Painted metal, worn in patches.
    worn = np.clip((noise(9, 1.7) - 0.5) / 0.06, 0, 1)
    images["paint_base"] = srgb_bytes_of(
        (1 - worn)[..., None] * np.array([0.08, 0.32, 0.30]) + worn[..., None] * np.array([0.82, 0.78, 0.72])
    )
    images["paint_mr"] = metallic_roughness(0.35 + 0.35 * noise(10, 1.2), worn)
    images["paint_normal"] = normals_of(worn, 0.5)
    os.makedirs(os.path.join(directory, "textures"), exist_ok=True)
    for name, texels in images.items():
        write_png(os.path.join(directory, "textures", name + ".png"), texels)


# --------------------------------------------------------------------------------------------------------------- room


def walls(g):
    def panel(name, centre, right, up, half_width, half_height, material):
        """A textured rectangle; u grows along `right`, v against `up`."""
        c, r, u = (np.array(v, float) for v in (centre, right, up))
        corners = [
            c - r * half_width - u * half_height,
            c + r * half_width - u * half_height,
            c + r * half_width + u * half_height,
            c - r * half_width + u * half_height,
        ]
        uvs = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], float) * np.array(
            [2 * half_width / TILE, 2 * half_height / TILE]
        )
        g.add(
            name,
            np.array(corners),
            quad_indices(0),
            material,
            normals=np.tile(np.cross(r, u), (4, 1)),
            tangents=np.tile(np.r_[r, 1.0], (4, 1)),
            uvs=uvs,
        )

    x, y, z = ROOM_X, ROOM_Y, ROOM_Z
    panel("floor", (0, 0, 0), (1, 0, 0), (0, 0, -1), x, z, "wood")
    g.quads("ceiling", [[(-x, y, -z), (x, y, -z), (x, y, z), (-x, y, z)]], "ceiling")
    panel("back", (0, y / 2, -z), (1, 0, 0), (0, 1, 0), x, y / 2, "plaster")
    panel("front", (0, y / 2, z), (-1, 0, 0), (0, 1, 0), x, y / 2, "plaster")
    panel("left", (-x, y / 2, 0), (0, 0, -1), (0, 1, 0), z, y / 2, "plaster")
    # The right wall has a window with a reveal 0.2 m deep and a cross of bars.
    z0, z1, y0, y1 = -1.8, 1.8, 0.6, 2.4
    for name, (za, zb, ya, yb) in {
        "rA": (-z, z0, 0, y),
        "rB": (z1, z, 0, y),
        "rC": (z0, z1, 0, y0),
        "rD": (z0, z1, y1, y),
    }.items():
        panel(name, (x, (ya + yb) / 2, (za + zb) / 2), (0, 0, 1), (0, 1, 0), (zb - za) / 2, (yb - ya) / 2, "plaster")
    w = x + 0.2
    reveal = [
        [(x, y0, z1), (w, y0, z1), (w, y0, z0), (x, y0, z0)],
        [(x, y1, z0), (w, y1, z0), (w, y1, z1), (x, y1, z1)],
        [(x, y0, z0), (w, y0, z0), (w, y1, z0), (x, y1, z0)],
        [(w, y0, z1), (x, y0, z1), (x, y1, z1), (w, y1, z1)],
    ]
    g.quads(
        "reveal",
        reveal + box((x + 0.08, y0, -0.03), (x + 0.12, y1, 0.03)) + box((x + 0.08, 1.47, z0), (x + 0.12, 1.53, z1)),
        "frame",
    )


def furniture(g):
    def textured_box(name, low, high, material):
        p, n, t, uv, indices = [], [], [], [], []
        for number, face in enumerate(np.array(box(low, high))):
            a, b = face[1] - face[0], face[3] - face[0]
            width, height = np.linalg.norm(a), np.linalg.norm(b)
            p += list(face)
            n += [np.cross(a, b) / (width * height)] * 4
            t += [np.r_[a / width, 1.0]] * 4
            uv += [(0, height), (width, height), (width, 0), (0, 0)]
            indices += quad_indices(number).tolist()
        g.add(name, np.array(p), indices, material, normals=np.array(n), tangents=np.array(t), uvs=np.array(uv))

    textured_box("tabletop", (-1.5, 0.72, -1.0), (0.6, 0.78, 0.2), "paint")
    for i, (x, z) in enumerate(((-1.45, -0.95), (0.5, -0.95), (-1.45, 0.1), (0.5, 0.1))):
        textured_box("leg%d" % i, (x, 0, z), (x + 0.06, 0.72, z + 0.06), "paint")
    for i in range(4):
        textured_box("shelf%d" % i, (-2.9, 0.4 + 0.55 * i, -3.95), (-0.2, 0.44 + 0.55 * i, -3.55), "wood")
    textured_box("cabinet", (1.0, 0, -3.9), (2.6, 1.1, -3.3), "paint")


def clutter(g):
    """50 placements of four dense shapes in four materials; equal pairs share a mesh."""
    shapes = [
        torus_knot(2, 3, 220, 48, ku=12, kv=3),
        bumpy_sphere(5, 0.25, 3.0, 1),
        torus_knot(3, 5, 260, 40, bump=0.02, ku=10, kv=2, tube=0.16),
        bumpy_sphere(5, 0.35, 2.0, 4),
    ]
    materials, meshes, random = ["clayA", "clayB", "brass", "alu"], {}, np.random.RandomState(11)

    def put(shape, material, position, scale):
        positions, faces, normals = shapes[shape]
        if (shape, material) not in meshes:
            meshes[shape, material] = g.mesh("m%d_%s" % (shape, material), positions, faces, material, normals=normals)
        half_angle, lowest = random.uniform(0, math.pi), (positions[:, 1].min()) * scale
        g.node(
            "clutter",
            meshes[shape, material],
            (position[0], position[1] - lowest, position[2]),
            (0, math.sin(half_angle), 0, math.cos(half_angle)),
            (scale, scale, scale),
        )

    count = 0
    for level in range(4):
        for i in range(6):
            put(count % 4, materials[(count // 2 + level) % 4], (-2.65 + 0.45 * i, 0.445 + 0.55 * level, -3.75), 0.13)
            count += 1
    for i in range(7):
        z, scale = random.uniform(-0.75, -0.05), random.uniform(0.08, 0.12)
        put(count % 4, materials[count % 4], (-1.25 + 0.28 * i, 0.781, z), scale)
        count += 1
    for i in range(5):
        put(count % 4, materials[(count + 1) % 4], (1.2 + 0.3 * i, 1.101, -3.6), 0.11)
        count += 1
    for _ in range(14):
        x, z = random.uniform(-2.4, 2.4), random.uniform(-2.8, 1.2)
        put(count % 4, materials[(count + 2) % 4], (x, 0.001, z), random.uniform(0.12, 0.26))
        count += 1


def main():
    directory = sys.argv[1] if len(sys.argv) > 1 else os.path.dirname(os.path.abspath(__file__))
    os.makedirs(directory, exist_ok=True)
    textures(directory)
    g = Gltf("interior", 256, 256)
    g.material("wood", metallic=1.0, textures=("base", "mr", "normal"))
    g.material("plaster", textures=("base", "normal"))
    g.material("paint", metallic=1.0, textures=("base", "mr", "normal"))
    g.material("ceiling", (0.8, 0.8, 0.8))
    g.material("clayA", (0.6, 0.25, 0.18))
    g.material("clayB", (0.2, 0.35, 0.5))
    g.material("brass", (0.91, 0.78, 0.42), 1.0, math.sqrt(0.12), lambert=False)
    g.material("alu", (0.91, 0.92, 0.92), 1.0, math.sqrt(0.2), lambert=False)
    g.material("frame", (0.75, 0.75, 0.72))
    walls(g)
    furniture(g)
    clutter(g)
    g.camera((1.6, 1.5, 3.7), (-0.5, 0.9, -1.5), (0, 1, 0), 55.0)
    g.write(directory)


if __name__ == "__main__":
    main()
