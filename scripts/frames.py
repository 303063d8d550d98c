#!/usr/bin/env python3
"""How long a sequence takes against renders of its frames one by one, where loading and building take most of it.

    scripts/frames.py [FRAMES] [KIND ...]        (20 frames, all kinds)

Scenes are made in a folder that is removed: one quad moves, all else stands still. `geometry`: 10⁶ triangles;
`textures`: four PNGs of 2048²; `environment`: 4096 × 2048 in Radiance; `all`: the three together; `in-motion`: that of
scenes/. A frame is 32 × 18 with 1 spp. Prints seconds and processor seconds of both with their ratio, and compares the
pictures byte for byte. PATHSPACE names another binary than target/release/pathspace.
"""

import array
import json
import math
import os
import random
import resource
import struct
import subprocess
import sys
import tempfile
import time
import zlib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BINARY = Path(os.environ.get("PATHSPACE", ROOT / "target/release/pathspace")).resolve()
SIDE = 708
KINDS = ["geometry", "textures", "environment", "all", "in-motion"]


class Scene:
    """A glTF scene that is put together from floats."""

    def __init__(self):
        self.bytes, self.views, self.accessors = bytearray(), [], []

    def add(self, values, kind, parts):
        """An accessor of values of an array.array."""
        count = len(values) // parts
        view = {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": len(values) * values.itemsize}
        accessor = {"bufferView": len(self.views), "componentType": 5126 if values.typecode == "f" else 5125}
        accessor |= {"count": count, "type": kind}
        if kind == "VEC3" or kind == "SCALAR" and values.typecode == "f":
            rows = [values[part::parts] for part in range(parts)]
            accessor |= {"min": [min(row) for row in rows], "max": [max(row) for row in rows]}
        self.bytes += values.tobytes()
        self.views.append(view)
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def grid(self, side, height):
        """A primitive of 2·side² triangles over the unit square, with normals and texture coordinates."""
        positions, normals, uvs = array.array("f"), array.array("f"), array.array("f")
        for row in range(side + 1):
            for column in range(side + 1):
                u, v = column / side, row / side
                positions.extend((u - 0.5, height * math.sin(40 * u) * math.sin(40 * v), v - 0.5))
                normals.extend((0.0, 1.0, 0.0))
                uvs.extend((u, v))
        indices, width = array.array("I"), side + 1
        for corner in (row * width + column for row in range(side) for column in range(side)):
            indices.extend((corner, corner + width, corner + 1, corner + 1, corner + width, corner + width + 1))
        attributes = {
            "POSITION": self.add(positions, "VEC3", 3), "NORMAL": self.add(normals, "VEC3", 3),
            "TEXCOORD_0": self.add(uvs, "VEC2", 2),
        }
        return {"attributes": attributes, "indices": self.add(indices, "SCALAR", 1), "material": 0}

    def write(self, folder, fine, images):
        ground, quad = self.grid(SIDE if fine else 4, 0.02), self.grid(1, 0.0)
        grounds = [ground | {"material": number} for number in range(max(images, 1))]
        times = self.add(array.array("f", [0, 10]), "SCALAR", 1)
        moves = self.add(array.array("f", [-0.3, 0.1, 0, 0.3, 0.2, 0]), "VEC3", 3)
        materials = [{"pbrMetallicRoughness": {"roughnessFactor": 1}} for _ in grounds]
        for number in range(images):
            materials[number]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": number}
        meshes = [{"primitives": [primitive]} for primitive in grounds] + [{"primitives": [quad]}]
        nodes = [{"mesh": number, "translation": [0, -0.1 * number, 0]} for number in range(len(grounds))]
        nodes += [
            {"mesh": len(grounds), "scale": [0.2, 0.2, 0.2]},
            {"camera": 0, "translation": [0, 0.6, 0.9], "rotation": [-0.28, 0, 0, 0.96]},
            {"translation": [0, 2, 0], "rotation": [-0.7071068, 0, 0, 0.7071068],
             "extensions": {"KHR_lights_punctual": {"light": 0}}},
        ]
        channel = {"sampler": 0, "target": {"node": len(grounds), "path": "translation"}}
        document = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(len(nodes)))}], "nodes": nodes,
            "extensionsUsed": ["KHR_lights_punctual"],
            "extensions": {"KHR_lights_punctual": {"lights": [{"type": "directional", "intensity": 3}]}},
            "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.01}}],
            "meshes": meshes, "materials": materials, "accessors": self.accessors, "bufferViews": self.views,
            "animations": [{"samplers": [{"input": times, "output": moves}], "channels": [channel]}],
            "buffers": [{"uri": "scene.bin", "byteLength": len(self.bytes)}],
        }
        if images:
            document["textures"] = [{"source": number} for number in range(images)]
            document["images"] = [{"uri": f"{number}.png"} for number in range(images)]
        (folder / "scene.bin").write_bytes(self.bytes)
        (folder / "scene.gltf").write_text(json.dumps(document))


def write_png(path, side, chance):
    """Noise that PNG can make a little of."""
    row = bytes(chance.randrange(0, 256, 16) for _ in range(3 * side))
    rows = b"".join(b"\0" + row[3 * shift:] + row[:3 * shift] for shift in range(side))

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(rows, 1)) + chunk(b"IEND", b""))


def write_hdr(path, width, height, chance):
    row = b"".join(bytes(map(chance.randrange, (128, 128, 255))) + b"\x80" for _ in range(width))
    path.write_bytes(f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode() + row * height)


def make(kind, folder):
    """Writes a scene; the arguments that render it."""
    if kind == "in-motion":
        return [ROOT / "scenes/in-motion/scene.gltf"]
    chance, every = random.Random(1), kind == "all"
    images = 4 if every or kind == "textures" else 0
    Scene().write(folder, every or kind == "geometry", images)
    for number in range(images):
        write_png(folder / f"{number}.png", 2048, chance)
    if every or kind == "environment":
        write_hdr(folder / "env.hdr", 4096, 2048, chance)
        return [folder / "scene.gltf", "--env", folder / "env.hdr"]
    return [folder / "scene.gltf"]


def processor_seconds():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def measure(kind, frames):
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        scene = make(kind, folder)
        more = ["-q", "--width", "32", "--height", "18", "--spp", "1", "--fps", "24", "--reproducible"]

        def render(numbers, name):
            command = [BINARY, "render", *scene, *more, "--frames", numbers, "-o", folder / name]
            began, used = time.monotonic(), processor_seconds()
            subprocess.run(list(map(str, command)), check=True)
            return time.monotonic() - began, processor_seconds() - used

        render("0", "warm.exr")
        each = [render(str(frame), f"one.{frame:04}.exr") for frame in range(frames)]
        one_by_one = [sum(seconds) for seconds in zip(*each)]
        sequence = render(f"0-{frames - 1}", "all.####.exr")
        pairs = [[folder / f"{name}.{frame:04}.exr" for name in ("one", "all")] for frame in range(frames)]
        differ = sum(one.read_bytes() != other.read_bytes() for one, other in pairs)
    told = (f"{name} {one:.2f} and {whole:.2f} s, {one / whole:.2f} times" for name, one, whole in
            zip(("clock", "processors"), one_by_one, sequence))
    print(f"{kind}: {frames} frames one by one and as a sequence: {'; '.join(told)}; {differ} differ", flush=True)
    return differ


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    sys.exit(1 if any([measure(kind, count) for kind in sys.argv[2:] or KINDS]) else 0)
