#!/usr/bin/env python3
"""Writes the scenes whose light path tracing finds by luck, by way of mirrors and glass or round a corner: scene.gltf
and scene.bin of sun-on-chrome, lamp-through-glass, lamp-in-glass, pool and door-ajar, each in its folder beside this
script (or in the directory given).

Units are metres, +Y up. Needs Python 3.9 alone; nothing is random.
"""

import json
import math
import os
import struct
import sys


def add(a, b):
    return tuple(x + y for x, y in zip(a, b))


def scaled(a, factor):
    return tuple(x * factor for x in a)


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a):
    return scaled(a, 1 / math.sqrt(sum(x * x for x in a)))


class Scene:
    """One buffer, one camera; a mesh and a node for each thing."""

    def __init__(self, name, eye, target, yfov):
        self.name, self.binary = name, bytearray()
        z = unit(add(eye, scaled(target, -1)))
        x = unit(cross((0, 1, 0), z))
        y = cross(z, x)
        matrix = [*x, 0, *y, 0, *z, 0, *eye, 1]
        camera = {"type": "perspective", "perspective": {"yfov": yfov, "znear": 0.01, "aspectRatio": 1.0}}
        self.root = {
            "asset": {"version": "2.0", "generator": "pathspace scenes/generate_caustics.py"},
            "scene": 0,
            "scenes": [{"nodes": [0], "extras": {"render": {"width": 256, "height": 256}}}],
            "nodes": [{"name": "camera", "camera": 0, "matrix": matrix}],
            "cameras": [camera],
            "meshes": [],
            "materials": [],
            "accessors": [],
            "bufferViews": [],
        }

    def uses(self, extension):
        used = self.root.setdefault("extensionsUsed", [])
        if extension not in used:
            used.append(extension)

    def material(self, name, color=(1, 1, 1), metallic=0.0, roughness=1.0, emission=None, ior=None, attenuation=None):
        """Index of a material; `ior` makes it a smooth dielectric, `attenuation` is (color, distance)."""
        pbr = {"baseColorFactor": [*color, 1], "metallicFactor": metallic, "roughnessFactor": roughness}
        material = {"name": name, "pbrMetallicRoughness": pbr}
        extensions = {}
        if emission is not None:
            peak = max(emission)
            material["emissiveFactor"] = [x / peak for x in emission]
            extensions["KHR_materials_emissive_strength"] = {"emissiveStrength": peak}
        if ior is not None:
            volume = {"thicknessFactor": 1.0}
            if attenuation is not None:
                volume["attenuationColor"], volume["attenuationDistance"] = list(attenuation[0]), attenuation[1]
            extensions["KHR_materials_transmission"] = {"transmissionFactor": 1.0}
            extensions["KHR_materials_ior"] = {"ior": ior}
            extensions["KHR_materials_volume"] = volume
        elif metallic == 0.0:
            # A Lambert surface and nothing on it.
            extensions["KHR_materials_specular"] = {"specularFactor": 0.0}
        for extension in extensions:
            self.uses(extension)
        if extensions:
            material["extensions"] = extensions
        self.root["materials"].append(material)
        return len(self.root["materials"]) - 1

    def accessor(self, values, kind, component, target, bounds=False):
        code = "f" if component == 5126 else "I"
        flat = [x for value in values for x in value] if kind == "VEC3" else values
        data = struct.pack("<%d%s" % (len(flat), code), *flat)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data), "target": target}
        self.root["bufferViews"].append(view)
        self.binary += data
        accessor = {"bufferView": len(self.root["bufferViews"]) - 1, "componentType": component, "type": kind}
        accessor["count"] = len(values)
        if bounds:
            stored = [struct.unpack("<3f", struct.pack("<3f", *value)) for value in values]
            accessor["min"] = [min(v[i] for v in stored) for i in range(3)]
            accessor["max"] = [max(v[i] for v in stored) for i in range(3)]
        self.root["accessors"].append(accessor)
        return len(self.root["accessors"]) - 1

    def mesh(self, name, material, positions, triangles, normals=None):
        attributes = {"POSITION": self.accessor(positions, "VEC3", 5126, 34962, True)}
        if normals is not None:
            attributes["NORMAL"] = self.accessor(normals, "VEC3", 5126, 34962)
        indices = self.accessor([i for triangle in triangles for i in triangle], "SCALAR", 5125, 34963)
        primitive = {"attributes": attributes, "indices": indices, "material": material}
        self.root["meshes"].append({"name": name, "primitives": [primitive]})
        self.node({"name": name, "mesh": len(self.root["meshes"]) - 1})

    def node(self, node):
        self.root["scenes"][0]["nodes"].append(len(self.root["nodes"]))
        self.root["nodes"].append(node)

    def quads(self, name, material, quads):
        """Flat quads, corners counter-clockwise as seen from in front."""
        positions = [corner for quad in quads for corner in quad]
        triangles = [t for i in range(0, len(positions), 4) for t in ((i, i + 1, i + 2), (i, i + 2, i + 3))]
        self.mesh(name, material, positions, triangles)

    def disc(self, direction, irradiance, half_angle):
        """The sun: a disc 2 km away that shines along `direction`, `half_angle` radians wide, of this irradiance."""
        distance, count = 2000.0, 48
        z = unit(direction)
        x = unit(cross((0, 0, 1), z))
        y = cross(z, x)
        radius = distance * math.tan(half_angle)
        centre = scaled(z, -distance)
        corners = []
        for i in range(count):
            angle = 2 * math.pi * i / count
            along = add(scaled(x, math.cos(angle)), scaled(y, math.sin(angle)))
            corners.append(add(centre, scaled(along, radius)))
        area = 0.5 * count * radius**2 * math.sin(2 * math.pi / count)
        emission = scaled(irradiance, distance**2 / area)
        material = self.material("sun", (0, 0, 0), emission=emission)
        self.mesh("sun", material, corners, [(0, i, i + 1) for i in range(1, count - 1)])

    def write(self, directory):
        folder = os.path.join(directory, self.name)
        os.makedirs(folder, exist_ok=True)
        self.root["buffers"] = [{"uri": "scene.bin", "byteLength": len(self.binary)}]
        with open(os.path.join(folder, "scene.bin"), "wb") as file:
            file.write(self.binary)
        with open(os.path.join(folder, "scene.gltf"), "w", encoding="utf-8", newline="\n") as file:
            json.dump(self.root, file, indent=1)
            file.write("\n")


def ball(centre, radius, level, inward=False):
    """Icosahedron whose faces are cut in four `level` times: positions, triangles, normals."""
    t = (1 + math.sqrt(5)) / 2
    points = []
    for a in (-1, 1):
        for b in (-t, t):
            points += [(a, b, 0), (0, a, b), (b, 0, a)]
    points = [unit(p) for p in points]
    edge = min(math.dist(points[0], p) for p in points[1:]) * 1.001
    faces = []
    for i in range(12):
        for j in range(i + 1, 12):
            for k in range(j + 1, 12):
                if max(math.dist(points[x], points[y]) for x, y in ((i, j), (j, k), (k, i))) < edge:
                    a, b, c = points[i], points[j], points[k]
                    normal = cross(add(b, scaled(a, -1)), add(c, scaled(a, -1)))
                    outward = sum(x * y for x, y in zip(normal, a)) > 0
                    faces.append((i, j, k) if outward else (i, k, j))
    for _ in range(level):
        middles, finer = {}, []

        def middle(i, j):
            key = (min(i, j), max(i, j))
            if key not in middles:
                middles[key] = len(points)
                points.append(unit(add(points[i], points[j])))
            return middles[key]

        for i, j, k in faces:
            a, b, c = middle(i, j), middle(j, k), middle(k, i)
            finer += [(i, a, c), (a, j, b), (c, b, k), (a, b, c)]
        faces = finer
    if inward:
        faces = [(i, k, j) for i, j, k in faces]
    normals = [scaled(p, -1 if inward else 1) for p in points]
    return [add(centre, scaled(p, radius)) for p in points], faces, normals


def ring(radius, thickness, height, count):
    """An upright ring on y = 0: positions, triangles, normals; smooth all round, with flat edges."""
    positions, triangles, normals = [], [], []

    def band(lower, upper, normal):
        first = len(positions)
        for i in range(count):
            c, s = math.cos(2 * math.pi * i / count), math.sin(2 * math.pi * i / count)
            for r, y in (lower, upper):
                positions.append((r * c, y, r * s))
                normals.append((normal[0] * c, normal[1], normal[0] * s))
        for i in range(count):
            a, b = first + 2 * i, first + 2 * ((i + 1) % count)
            triangles.extend([(a, a + 1, b + 1), (a, b + 1, b)])

    inner, outer = radius, radius + thickness
    band((outer, 0), (outer, height), (1, 0))
    band((outer, height), (inner, height), (0, 1))
    band((inner, height), (inner, 0), (-1, 0))
    return positions, triangles, normals


def floor(x, y, z):
    return [(-x, y, z), (x, y, z), (x, y, -z), (-x, y, -z)]


def room(x, y, z):
    """The inside of a box from the floor y = 0 up."""
    return [
        floor(x, 0, z),
        [(-x, y, -z), (x, y, -z), (x, y, z), (-x, y, z)],
        [(-x, 0, -z), (x, 0, -z), (x, y, -z), (-x, y, -z)],
        [(x, 0, z), (-x, 0, z), (-x, y, z), (x, y, z)],
        [(-x, 0, z), (-x, 0, -z), (-x, y, -z), (-x, y, z)],
        [(x, 0, -z), (x, 0, z), (x, y, z), (x, y, -z)],
    ]


def sun_on_chrome():
    scene = Scene("sun-on-chrome", (0, 2.6, 3.4), (0, 0.15, 0), 0.6)
    chrome = scene.material("chrome", (0.95, 0.93, 0.9), metallic=1.0, roughness=0.0)
    scene.quads("floor", scene.material("plaster", (0.7, 0.68, 0.65)), [floor(6, 0, 6)])
    scene.mesh("ring", chrome, *ring(0.9, 0.03, 0.35, 256))
    scene.mesh("ball", chrome, *ball((-0.25, 0.22, -0.1), 0.22, 4))
    way, irradiance = (-1.0, -0.75, -0.35), (3.2, 3.0, 2.7)
    # As wide as the sun through thin haze.
    scene.disc(way, irradiance, 0.02)
    return scene


def lamp_through_glass():
    scene = Scene("lamp-through-glass", (0, 1.5, 3.2), (0, 0.45, 0), 0.6)
    plaster = scene.material("plaster", (0.7, 0.7, 0.7))
    wall = [(-3, 0, -1.2), (3, 0, -1.2), (3, 3, -1.2), (-3, 3, -1.2)]
    scene.quads("floor and wall", plaster, [floor(3, 0, 3), wall])
    scene.mesh("ball", scene.material("glass", roughness=0.0, ior=1.5), *ball((0.1, 0.45, 0.1), 0.4, 4))
    lamp = scene.material("lamp", (0, 0, 0), emission=(900, 800, 650))
    scene.mesh("lamp", lamp, *ball((-0.9, 1.7, 0.8), 0.025, 1))
    return scene


def lamp_in_glass():
    scene = Scene("lamp-in-glass", (1.1, 1.3, 2.4), (0, 0.7, 0), 0.75)
    scene.quads("room", scene.material("plaster", (0.75, 0.72, 0.68)), room(1.5, 2.4, 2.6))
    glass = scene.material("glass", roughness=0.0, ior=1.5, attenuation=((0.9, 0.95, 0.8), 0.1))
    positions, triangles, normals = ball((0, 0.8, 0), 0.32, 4)
    inner = ball((0, 0.8, 0), 0.28, 4, inward=True)
    triangles += [tuple(i + len(positions) for i in triangle) for triangle in inner[1]]
    scene.mesh("shell", glass, positions + inner[0], triangles, normals + inner[2])
    lamp = scene.material("lamp", (0, 0, 0), emission=(260, 220, 160))
    scene.mesh("lamp", lamp, *ball((0.05, 0.78, 0), 0.04, 1))
    scene.quads("table", scene.material("wood", (0.45, 0.3, 0.2)), [floor(0.6, 0.4, 0.6)])
    return scene


def pool():
    scene = Scene("pool", (0, 3.2, 4.4), (0, -0.6, -0.3), 0.7)
    x, z, depth, n = 2.0, 2.0, 1.2, 64
    tiles = scene.material("tiles", (0.75, 0.8, 0.8))
    walls = [
        [(-x, -depth, -z), (x, -depth, -z), (x, 0.2, -z), (-x, 0.2, -z)],
        [(x, -depth, z), (-x, -depth, z), (-x, 0.2, z), (x, 0.2, z)],
        [(-x, -depth, z), (-x, -depth, -z), (-x, 0.2, -z), (-x, 0.2, z)],
        [(x, -depth, -z), (x, -depth, z), (x, 0.2, z), (x, 0.2, -z)],
    ]
    far = 6.0
    edge = [
        [(-far, 0.2, -z), (far, 0.2, -z), (far, 0.2, -far), (-far, 0.2, -far)],
        [(-far, 0.2, far), (far, 0.2, far), (far, 0.2, z), (-far, 0.2, z)],
        [(-far, 0.2, z), (-x, 0.2, z), (-x, 0.2, -z), (-far, 0.2, -z)],
        [(x, 0.2, z), (far, 0.2, z), (far, 0.2, -z), (x, 0.2, -z)],
    ]
    scene.quads("pool", tiles, [floor(x, -depth, z)] + walls)
    scene.quads("edge", scene.material("stone", (0.55, 0.5, 0.45)), edge)

    # The water reaches a little into the tiles, so that none of its own sides is seen.
    over = 0.05
    waves = ((2.9, 1.1, 0.0, 0.012), (-1.7, 3.7, 1.0, 0.009), (5.3, -4.1, 2.0, 0.005), (0.9, 6.7, 4.0, 0.004))
    positions, normals, triangles = [], [], []
    for j in range(n + 1):
        for i in range(n + 1):
            px, pz = (2 * i / n - 1) * (x + over), (2 * j / n - 1) * (z + over)
            y = sum(a * math.sin(u * px + v * pz + p) for u, v, p, a in waves)
            dx = sum(a * u * math.cos(u * px + v * pz + p) for u, v, p, a in waves)
            dz = sum(a * v * math.cos(u * px + v * pz + p) for u, v, p, a in waves)
            positions.append((px, y, pz))
            normals.append(unit((-dx, 1, -dz)))
    at = lambda i, j: j * (n + 1) + i  # noqa: E731
    for j in range(n):
        for i in range(n):
            a, b, c, d = at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)
            triangles += [(a, b, c), (a, c, d)]
    # Sides and bottom, with vertices of their own.
    rim = [at(i, 0) for i in range(n)] + [at(n, j) for j in range(n)]
    rim += [at(i, n) for i in range(n, 0, -1)] + [at(0, j) for j in range(n, 0, -1)]
    first, bottom = len(positions), -depth - over
    for k in rim:
        px, y, pz = positions[k]
        outward = unit((px if abs(px) > x else 0, 0, pz if abs(pz) > z else 0))
        positions += [(px, y, pz), (px, bottom, pz)]
        normals += [outward, outward]
    for k in range(len(rim)):
        a, b = first + 2 * k, first + 2 * ((k + 1) % len(rim))
        triangles += [(a, b, b + 1), (a, b + 1, a + 1)]
    centre = len(positions)
    positions.append((0, bottom, 0))
    normals.append((0, -1, 0))
    below = len(positions)
    for k in rim:
        px, _, pz = positions[k]
        positions.append((px, bottom, pz))
        normals.append((0, -1, 0))
    for k in range(len(rim)):
        triangles.append((centre, below + k, below + (k + 1) % len(rim)))
    water = scene.material("water", roughness=0.0, ior=1.33, attenuation=((0.3, 0.7, 0.8), 3.0))
    scene.mesh("water", water, positions, triangles, normals)
    # As wide as the sun through thin haze.
    scene.disc((0.45, -1.0, -0.35), (3.2, 3.0, 2.7), 0.02)
    return scene


def box(low, high, place=lambda p: p):
    """Faces of a box, outward; `place` moves its corners."""
    at = lambda *which: place(tuple((low, high)[side][axis] for axis, side in enumerate(which)))  # noqa: E731
    return [
        [at(0, 0, 0), at(1, 0, 0), at(1, 0, 1), at(0, 0, 1)],
        [at(0, 1, 1), at(1, 1, 1), at(1, 1, 0), at(0, 1, 0)],
        [at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1)],
        [at(1, 0, 0), at(0, 0, 0), at(0, 1, 0), at(1, 1, 0)],
        [at(0, 0, 0), at(0, 0, 1), at(0, 1, 1), at(0, 1, 0)],
        [at(1, 0, 1), at(1, 0, 0), at(1, 1, 0), at(1, 1, 1)],
    ]


def door_ajar():
    scene = Scene("door-ajar", (1.3, 1.5, 3.6), (-0.35, 0.95, 0), 0.9)
    x, y, near, wall, far = 2.0, 2.5, 4.0, -0.1, -3.1
    half, height = 0.45, 2.0
    flip = lambda quad: quad[::-1]  # noqa: E731
    # Walls of both rooms, the lit one behind z = wall; the doorway is left open in either face of the wall between.
    quads, floors = [], []
    for back, front in ((near, 0.0), (far, wall)):
        turn = (lambda quad: quad) if back > front else flip
        low, high = min(back, front), max(back, front)
        floors.append([(-x, 0, high), (x, 0, high), (x, 0, low), (-x, 0, low)])
        quads += [
            [(-x, y, low), (x, y, low), (x, y, high), (-x, y, high)],
            [(-x, 0, high), (-x, 0, low), (-x, y, low), (-x, y, high)],
            [(x, 0, low), (x, 0, high), (x, y, high), (x, y, low)],
            turn([(x, 0, back), (-x, 0, back), (-x, y, back), (x, y, back)]),
            turn([(-x, 0, front), (-half, 0, front), (-half, y, front), (-x, y, front)]),
            turn([(half, 0, front), (x, 0, front), (x, y, front), (half, y, front)]),
            turn([(-half, height, front), (half, height, front), (half, y, front), (-half, y, front)]),
        ]
    floors.append([(-half, 0, 0), (half, 0, 0), (half, 0, wall), (-half, 0, wall)])
    quads += [
        [(-half, 0, 0), (-half, 0, wall), (-half, height, wall), (-half, height, 0)],
        [(half, 0, wall), (half, 0, 0), (half, height, 0), (half, height, wall)],
        [(-half, height, wall), (half, height, wall), (half, height, 0), (-half, height, 0)],
    ]
    scene.quads("rooms", scene.material("plaster", (0.7, 0.68, 0.65)), quads)
    scene.quads("floor", scene.material("wood", (0.5, 0.38, 0.26)), floors)

    # The door is hinged at the left of the doorway and opens into the lit room.
    angle = math.radians(28)
    c, s = math.cos(angle), math.sin(angle)
    place = lambda p: (-half + c * p[0] + s * p[2], p[1], wall - s * p[0] + c * p[2])  # noqa: E731
    leaf = box((0.005, 0.01, -0.04), (2 * half - 0.01, height - 0.01, 0.0), place)
    scene.quads("door", scene.material("door", (0.35, 0.45, 0.5)), leaf)
    scene.quads("chest", scene.material("paint", (0.6, 0.25, 0.2)), box((-1.6, 0.002, 0.4), (-0.9, 0.55, 1.3)))
    scene.quads("stool", scene.material("oak", (0.55, 0.45, 0.3)), box((0.75, 0.002, 0.6), (1.15, 0.45, 1.0)))

    # A lamp that shines at the ceiling: nothing in the near room sees it, and light comes by two walls at least.
    lamp = scene.material("lamp", (0, 0, 0), emission=(2000, 1800, 1500))
    scene.quads("lamp", lamp, [[(1.2, 1.9, -1.9), (1.5, 1.9, -1.9), (1.5, 1.9, -2.2), (1.2, 1.9, -2.2)]])
    return scene


if __name__ == "__main__":
    target = sys.argv[1] if len(sys.argv) > 1 else os.path.dirname(os.path.abspath(__file__))
    for made in (sun_on_chrome(), lamp_through_glass(), lamp_in_glass(), pool(), door_ajar()):
        made.write(target)
