#!/usr/bin/env python3
"""Writes the seeds of the scene target that hold compressed streams. Usage: fuzz/seed-scenes.py FOLDER.

Needs DracoPy, meshopt and numpy from PyPI. Each is a binary glTF, so that mutations reach a stream's bytes as they are,
and small: a ball of 35 vertices for Draco and meshoptimizer, the KTX2 seeds of the image target as textures of a quad.
"""

import json
import struct
import sys
from pathlib import Path

import DracoPy
import meshopt
import numpy as np

FOLDER = Path(sys.argv[1])
IMAGES = Path(__file__).resolve().parent / "seeds/images"
F32, U32, U16, U8, I16, I8 = 5126, 5125, 5123, 5121, 5122, 5120
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


class File:
    """A binary glTF with one mesh of one primitive."""

    def __init__(self, **members):
        self.bytes = b""
        self.primitive = {"attributes": {}}
        self.json = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [self.primitive]}], "accessors": [], "bufferViews": [], **members,
        }

    def view(self, data, **members):
        """Index of a view of those bytes."""
        self.bytes += bytes(-len(self.bytes) % 4)
        at = {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": len(data)}
        self.json["bufferViews"].append({**at, **members})
        self.bytes += data
        return len(self.json["bufferViews"]) - 1

    def accessor(self, count, component, components, view=None, **members):
        """Index of an accessor."""
        at = {} if view is None else {"bufferView": view}
        kind = {"count": count, "componentType": component, "type": KINDS[components]}
        self.json["accessors"].append({**at, **kind, **members})
        return len(self.json["accessors"]) - 1

    def requires(self, *names):
        self.json["extensionsUsed"] = self.json["extensionsRequired"] = list(names)

    def write(self, name):
        self.bytes += bytes(-len(self.bytes) % 4)
        buffers = [{"byteLength": len(self.bytes)}, *self.json.pop("buffers", [])]
        text = json.dumps({**self.json, "buffers": buffers}, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(self.bytes), b"BIN\0")
        whole = struct.pack("<4sII", b"glTF", 2, 12 + len(chunks) + len(self.bytes)) + chunks + self.bytes
        (FOLDER / name).write_bytes(whole)


def ball(rows=4, columns=6):
    """Positions, normals, texture coordinates, colours and triangles; no vertex is shared at the poles."""
    grid = [(v / rows, u / columns) for v in range(rows + 1) for u in range(columns + 1)]
    theta, phi = np.pi * np.array([v for v, _ in grid]), 2 * np.pi * np.array([u for _, u in grid])
    normals = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], 1).astype("f4")
    uvs = np.array([(u, v) for v, u in grid], "f4")
    colours = (255 * np.clip(np.abs(normals), 0, 1)).astype("u1")
    first = [row * (columns + 1) + column for row in range(rows) for column in range(columns)]
    corners = [t for a in first for t in ((a, a + columns + 1, a + 1), (a + 1, a + columns + 1, a + columns + 2))]
    return 0.5 * normals, normals, uvs, colours, np.array(corners, "u4")


POSITIONS, NORMALS, UVS, COLOURS, TRIANGLES = ball()
COUNT = len(POSITIONS)


def draco(name, **how):
    """A stream by DracoPy."""
    write_draco(name, DracoPy.encode(POSITIONS, TRIANGLES, **how), how)


def write_draco(name, stream, how):
    """DracoPy numbers attributes in this order."""
    file, ids = File(), {}
    given = {"COLOR_0": "colors", "TEXCOORD_0": "tex_coord", "NORMAL": "normals", "POSITION": None}
    for semantic, argument in given.items():
        if argument is None or how.get(argument) is not None:
            ids[semantic] = len(ids)
    extension = {"bufferView": file.view(bytes(stream)), "attributes": ids}
    shapes = {"POSITION": (F32, 3), "TEXCOORD_0": (F32, 2), "COLOR_0": (U8, 3), "NORMAL": (F32, 3)}
    for semantic in ids:
        more = {"normalized": True} if semantic == "COLOR_0" else {}
        file.primitive["attributes"][semantic] = file.accessor(COUNT, *shapes[semantic], **more)
    file.primitive["indices"] = file.accessor(TRIANGLES.size, U32, 1)
    file.primitive["extensions"] = {"KHR_draco_mesh_compression": extension}
    file.requires("KHR_draco_mesh_compression")
    file.write(name)


def packed(name, views, indices, extension="EXT_meshopt_compression", primitive=None):
    """Streams of meshoptimizer: semantic → (elements, stride, component, components, stream, filter, normalized)."""
    file = File(buffers=[{"byteLength": 1 << 14, "extensions": {extension: {"fallback": True}}}])

    def compressed(stream, count, stride, mode, filter=None, claims=None):
        view = file.view(stream)
        of = file.json["bufferViews"][view]
        said = {"buffer": 0, "byteOffset": of["byteOffset"], "byteLength": len(stream), "byteStride": stride,
                "mode": mode, "count": count, **({"filter": filter} if filter else {}), **(claims or {})}
        of.update(buffer=1, byteOffset=0, byteLength=said["count"] * stride, extensions={extension: said})
        if mode == "ATTRIBUTES":
            of["byteStride"] = stride
        return view

    for semantic, (stream, stride, component, components, filter, normalized, claims) in views.items():
        view = compressed(stream, COUNT, stride, "ATTRIBUTES", filter, claims)
        more = {"normalized": True} if normalized else {}
        file.primitive["attributes"][semantic] = file.accessor(COUNT, component, components, view, **more)
    stream, size, mode = indices
    view = compressed(stream, TRIANGLES.size, size, mode)
    file.primitive["indices"] = file.accessor(TRIANGLES.size, {2: U16, 4: U32}[size], 1, view)
    file.requires(extension, "KHR_mesh_quantization")
    file.write(name)


def attribute(values, component, components, filter=None, normalized=False, version=0, **claims):
    values = np.ascontiguousarray(values)
    stride = values.dtype.itemsize * values.shape[1]
    stream = meshopt.encode_vertex_buffer_level(values, 2, version)
    return bytes(stream), stride, component, components, filter, normalized, claims


def basis(name, *images):
    """KTX2 images as textures of a quad."""
    file = File()
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], "f4")
    view = file.view(corners.tobytes())
    file.primitive["attributes"]["POSITION"] = file.accessor(4, F32, 3, view, min=[0, 0, 0], max=[1, 1, 0])
    file.primitive["attributes"]["TEXCOORD_0"] = file.accessor(4, F32, 2, file.view(corners[:, :2].tobytes()))
    file.primitive["indices"] = file.accessor(6, U16, 1, file.view(np.array([0, 1, 2, 0, 2, 3], "u2").tobytes()))
    file.primitive["material"] = 0
    slots = [("pbrMetallicRoughness", "baseColorTexture"), (None, "normalTexture"), (None, "emissiveTexture")]
    material = {"emissiveFactor": [1, 1, 1], "pbrMetallicRoughness": {}}
    file.json["images"], file.json["textures"] = [], []
    for number, (data, (group, slot)) in enumerate(zip(images, slots)):
        file.json["images"].append({"bufferView": file.view(data), "mimeType": "image/ktx2"})
        file.json["textures"].append({"extensions": {"KHR_texture_basisu": {"source": number}}})
        (material[group] if group else material)[slot] = {"index": number}
    file.json["materials"] = [material]
    file.requires("KHR_texture_basisu")
    file.write(name)


FOLDER.mkdir(parents=True, exist_ok=True)
# Draco: edgebreaker, with valences, sequential; attributes of all kinds, few bits and many.
everything = {"tex_coord": UVS.astype("f8"), "normals": NORMALS.astype("f8"), "colors": COLOURS}
draco("draco-positions.glb", compression_level=7, quantization_bits=8)
draco("draco-all.glb", compression_level=7, **everything)
draco("draco-fast.glb", compression_level=1, quantization_bits=16, **everything)
draco("draco-sequential.glb", compression_level=0, preserve_order=True, **everything)
# Not quantised.
draco("draco-raw.glb", compression_level=5, quantization_bits=0, normals=NORMALS.astype("f8"))
# Valences are for 1000 faces and more.
fine = ball(18, 32)
valence = {"compression_level": 10, "quantization_bits": 8, "normal_quantization_bits": 5}
write_draco("draco-valence.glb", DracoPy.encode(fine[0], fine[4], **valence), {})
# Hostile: of a sequential stream the numbers of faces and points, which follow the header of 11 bytes.
stream = DracoPy.encode(POSITIONS, TRIANGLES, preserve_order=True, compression_level=0)
write_draco("draco-many-faces.glb", stream[:11] + b"\xff\xff\xff\x7f" + b"\xff\xff\xff\x7f" + stream[13:], {})
stream = DracoPy.encode(POSITIONS, TRIANGLES, compression_level=7)
write_draco("draco-cut-off.glb", stream[:len(stream) // 2], {})

# meshoptimizer: both versions, indices as triangles and as a sequence, every filter.
triangles = bytes(meshopt.encode_index_buffer(TRIANGLES.reshape(-1))), 2, "TRIANGLES"
sequence = bytes(meshopt.encode_index_sequence(TRIANGLES.reshape(-1))), 4, "INDICES"
plain = {"POSITION": attribute(POSITIONS, F32, 3), "TEXCOORD_0": attribute(UVS, F32, 2)}
packed("meshopt-plain.glb", plain, triangles)
packed("meshopt-sequence.glb", {"POSITION": attribute(POSITIONS, F32, 3, version=1)}, sequence,
       "KHR_meshopt_compression")
four = np.concatenate([NORMALS, np.ones((COUNT, 1), "f4")], 1)
shades = np.concatenate([COLOURS / np.float32(255), np.ones((COUNT, 1), "f4")], 1).astype("f4")
filtered = {
    "POSITION": attribute(meshopt.encode_filter_exp(POSITIONS, 15), F32, 3, "EXPONENTIAL"),
    "NORMAL": attribute(meshopt.encode_filter_oct(four, 4, 8).view("i1"), I8, 3, "OCTAHEDRAL", True),
    "TANGENT": attribute(meshopt.encode_filter_oct(four, 8, 12).view("i2"), I16, 4, "OCTAHEDRAL", True),
    "COLOR_0": attribute(meshopt.encode_filter_color(shades, 4, 8).view("u1"), U8, 4, "COLOR", True, version=1),
}
packed("meshopt-filters.glb", filtered, triangles, "KHR_meshopt_compression")
turns = four / np.linalg.norm(four, axis=1, keepdims=True)
quaternions = attribute(meshopt.encode_filter_quat(turns, 8, 12).view("i2"), I16, 4, "QUATERNION", True)
packed("meshopt-quaternions.glb", {**plain, "TANGENT": quaternions}, triangles)
# Hostile: elements that the bytes cannot hold, and as many as they may claim.
stream = attribute(POSITIONS, F32, 3)[0]
large = {"POSITION": (stream, 12, F32, 3, None, False, {"count": 1024 * len(stream) // 12})}
packed("meshopt-many.glb", large, triangles)
packed("meshopt-cut-off.glb", {"POSITION": (stream[:40], 12, F32, 3, None, False, {})}, triangles)

# Basis Universal: ETC1S, UASTC, with Zstandard. Hostile: large sizes, a level of which most is missing.
images = [(IMAGES / f"basis{number}.ktx2").read_bytes() for number in range(3)]
basis("basis.glb", *images)
basis("basis-large.glb", *(image[:20] + struct.pack("<II", 1 << 14, 1 << 14) + image[28:] for image in images))
basis("basis-cut-off.glb", *(image[: -len(image) // 4] for image in images))
