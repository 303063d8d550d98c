#!/usr/bin/env python3
"""Lobes against a renderer that is not ours: a plane under an environment that is white for x > 0 and black elsewhere,
seen along directions at several angles and azimuths; what it shows is the integral of the lobe over half of all
directions, by pathspace's renders and by Mitsuba's own sampling.

    python3 -m venv venv && venv/bin/pip install mitsuba==3.9.1
    PATHSPACE=target/release/pathspace venv/bin/python scripts/lobes.py

Compared is what both have: GGX metals with and without a grain (`roughconductor` with the alphas of
KHR_materials_anisotropy, white, so that Fresnel is 1) and the surface of rough glass (`roughdielectric`). It has no
model of the extensions' clearcoat (its `principled` has GTR1 and a quarter of the weight), sheen (its own is a power of
the cosine), thin films, or diffuse transmission. Prints a table; exit code 1 where a difference exceeds both 0.5 % and
5 standard errors.
"""
import json
import math
import os
import pathlib
import random
import struct
import subprocess
import sys
import tempfile
import zlib

import mitsuba as mi

mi.set_variant("scalar_rgb")

SAMPLES = 400_000
SIDE, SPP = 32, 128

# name, glTF material, Mitsuba's BSDF; alpha is the square of roughness, along the grain alpha + (1 - alpha)·strength².
CASES = []
for roughness, strength in [(0.3, 0.0), (0.8, 0.0), (0.3, 0.5), (0.5, 1.0)]:
    alpha = roughness**2
    along = alpha + (1 - alpha) * strength**2
    material = {"pbrMetallicRoughness": {"roughnessFactor": roughness}}
    if strength:
        material["extensions"] = {"KHR_materials_anisotropy": {"anisotropyStrength": strength}}
    bsdf = {"type": "roughconductor", "distribution": "ggx", "alpha_u": along, "alpha_v": alpha, "eta": 0.0, "k": 1.0}
    CASES.append((f"metal, roughness {roughness}, anisotropy {strength}", material, bsdf))
for roughness in [0.4, 0.8]:
    material = {
        "pbrMetallicRoughness": {"roughnessFactor": roughness, "metallicFactor": 0},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1},
                       "KHR_materials_volume": {"thicknessFactor": 1}},
    }
    bsdf = {"type": "roughdielectric", "distribution": "ggx", "alpha": roughness**2, "int_ior": 1.5, "ext_ior": 1.0}
    CASES.append((f"glass, roughness {roughness}", material, bsdf))

ANGLES = [(20, 0), (60, 0), (60, 70), (75, 200)]


def png(path, rows):
    """8-bit greys."""
    data = b"".join(b"\0" + bytes(row) for row in rows)
    chunk = lambda kind, body: struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    head = struct.pack(">IIBBBBB", len(rows[0]), len(rows), 8, 0, 0, 0, 0)
    body = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + body)


def direction(theta, phi):
    """To the viewer, y up; azimuth from +x towards -z."""
    t, p = math.radians(theta), math.radians(phi)
    return (math.sin(t) * math.cos(p), math.cos(t), -math.sin(t) * math.sin(p))


def scene(path, material, to_viewer):
    """A plane about the origin and a camera whose rays are all the same."""
    x, y, z = to_viewer
    length = math.hypot(x, z)
    right = (z / length, 0.0, -x / length)
    up = (y * right[2], z * right[0] - x * right[2], -y * right[0])
    buffer = b"".join(struct.pack("<3f", *corner) for corner in [(-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)])
    buffer += b"".join(struct.pack("<2f", *uv) for uv in [(0, 1), (1, 1), (1, 0), (0, 0)])
    buffer += struct.pack("<6H", 0, 1, 2, 0, 2, 3)
    (path.parent / "plane.bin").write_bytes(buffer)
    used = list(material.get("extensions", {}))
    orthographic = {"xmag": 1e-6, "ymag": 1e-6, "znear": 0.01, "zfar": 100}
    primitive = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}
    path.write_text(json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
        **({"extensionsUsed": used} if used else {}),
        "nodes": [{"mesh": 0}, {"camera": 0, "matrix": [*right, 0, *up, 0, x, y, z, 0, 5 * x, 5 * y, 5 * z, 1]}],
        "cameras": [{"type": "orthographic", "orthographic": orthographic}],
        "materials": [material], "meshes": [{"primitives": [primitive]}],
        "buffers": [{"uri": "plane.bin", "byteLength": len(buffer)}],
        "bufferViews": [{"buffer": 0, "byteOffset": o, "byteLength": n} for o, n in [(0, 48), (48, 32), (80, 12)]],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-9, 0, -9], "max": [9, 0, 9]},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
    }))


def statistics(values):
    mean = sum(values) / len(values)
    return mean, math.sqrt(sum((v - mean) ** 2 for v in values) / (len(values) - 1) / len(values))


def ours(program, folder, material, to_viewer):
    """Mean radiance and its standard error."""
    scene(folder / "plane.gltf", material, to_viewer)
    picture = folder / "plane.exr"
    command = [program, "render", folder / "plane.gltf", "-q", "--size", f"{SIDE}x{SIDE}", "--spp", str(SPP), "--env",
               folder / "half.png", "--filter", "box", "-o", picture]
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    red = mi.TensorXf(mi.Bitmap(str(picture)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32))
    return statistics([float(red.array[3 * (SIDE * row + column)]) for row in range(SIDE) for column in range(SIDE)])


def theirs(bsdf, to_viewer):
    """The same by sampling the lobe; local x is world x, local y world -z, local z world y."""
    x, y, z = to_viewer
    at = mi.SurfaceInteraction3f()
    at.wi = [x, -z, y]
    model, context, rng = mi.load_dict(bsdf), mi.BSDFContext(), random.Random(1)
    values = []
    for _ in range(SAMPLES):
        sample, weight = model.sample(context, at, rng.random(), [rng.random(), rng.random()])
        values.append(weight[0] if sample.pdf > 0 and sample.wo[0] > 0 else 0.0)
    return statistics(values)


def main():
    program, failed = os.environ.get("PATHSPACE", "pathspace"), False
    print("| lobe | angle, azimuth | ours | Mitsuba | difference |\n| --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        png(folder / "half.png", [[0] * 64 + [255] * 64] * 64)
        for name, material, bsdf in CASES:
            for angles in ANGLES:
                to_viewer = direction(*angles)
                (a, a_error), (b, b_error) = ours(program, folder, material, to_viewer), theirs(bsdf, to_viewer)
                error = math.hypot(a_error, b_error)
                off = abs(a - b) > max(5e-3 * b, 5 * error)
                failed |= off
                difference = f"{100 * (a / b - 1):+.2f} ± {100 * error / b:.2f} %" + (" !" if off else "")
                print(f"| {name} | {angles[0]}°, {angles[1]}° | {a:.5f} | {b:.5f} | {difference} |", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
