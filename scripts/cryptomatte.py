#!/usr/bin/env python3
"""Reads the cryptomatte layers of EXR files by a program that is not ours.

    python3 -m venv venv && venv/bin/pip install cryptomatte-api
    pathspace render scene.gltf -o a.exr --aov crypto_object,crypto_material,crypto_asset
    venv/bin/python scripts/cryptomatte.py a.exr

For each layer: its names with their mean coverage, and the range of the sum of all masks over the pixels: 1 where
surfaces cover a pixel and it has at most six ids. Exit code 1 if the package refuses a file, or a sum exceeds 1 by more
than rounding (filters without negative lobes).
"""
import sys

import numpy
from cryptomatte_api import Cryptomatte


def main(paths):
    failed = False
    for path in paths:
        for layer in Cryptomatte.load(path):
            masks = layer.masks()
            total = sum(masks.values())
            print(f"{path}: {layer.metadata().name()}: {layer.num_levels()} levels, {len(masks)} names")
            for name, mask in sorted(masks.items(), key=lambda item: -item[1].mean()):
                print(f"  {mask.mean():9.6f}  {name!r}")
            print(f"  sum of the masks: {total.min():.9f} to {total.max():.9f}")
            failed |= bool(total.max() > 1 + 1e-5)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
