#!/usr/bin/env python3
"""Reads EXR files with layers by OpenImageIO, as compositors do, and holds the layers against one another.

    pathspace render scene.gltf -o a.exr --spp 8 --aov "$(scripts/readers.py --aovs)"
    scripts/readers.py 8 a.exr

Needs Debian's python3-openimageio and python3-numpy. Expected of each file: the layers of `--aovs` and no
others; all values finite; spp as said everywhere; parts that GUIDE.md says sum to the picture do, to f32's
rounding of each part; variance is the square of stderr; normals have a length of 1 at most; what is met lies
before the camera. Exit code 1 names what fails.
"""
import sys

# Prefixes of channels, by the name that asks for them.
LAYERS = {
    "variance": ["variance."], "stderr": ["stderr."], "spp": ["spp."], "bounces": ["bounce_"],
    "emission": ["emission."], "direct": ["direct."], "indirect": ["indirect."], "diffuse": ["diffuse."],
    "glossy": ["glossy."], "transmission": ["transmission."], "volume": ["volume."], "lightgroups": ["lightgroup_"],
    "albedo": ["albedo."], "N": ["N."], "Ng": ["Ng."], "Z": ["Z"], "P": ["P."], "UV": ["UV."], "motion": ["motion."],
    "background": ["background."], "coverage": ["coverage."], "crypto_object": ["crypto_object0"],
    "crypto_material": ["crypto_material0"], "crypto_asset": ["crypto_asset0"],
    "denoise_albedo": ["denoise_albedo."], "denoise_normal": ["denoise_normal."],
}
SUMS = [["bounce_"], ["emission.", "direct.", "indirect."], ["lightgroup_"],
        ["emission.", "diffuse.", "glossy.", "transmission.", "volume."]]

if sys.argv[1:] == ["--aovs"]:
    print(",".join(LAYERS))
    sys.exit()

import numpy  # noqa: E402
import OpenImageIO  # noqa: E402


def read(path):
    """Channels by name."""
    source = OpenImageIO.ImageInput.open(path)
    if source is None:
        sys.exit(f"{path}: OpenImageIO does not read it: {OpenImageIO.geterror()}")
    names, values = source.spec().channelnames, source.read_image("float")
    if values is None:
        sys.exit(f"{path}: {source.geterror()}")
    return {name: values[:, :, place].astype(numpy.float64) for place, name in enumerate(names)}


def problems(channels, spp):
    def layer(prefix):
        return {name: values for name, values in channels.items() if name.startswith(prefix)}

    prefixes = [prefix for prefixes in LAYERS.values() for prefix in prefixes]
    yield from (f"nothing of {prefix}" for prefix in prefixes if not layer(prefix))
    known = tuple(prefixes) + ("R", "G", "B", "A")
    yield from (f"{name} is not expected" for name in channels if not name.startswith(known))
    # Ids are bits, of which some are no finite number.
    yield from (f"{name} is not finite" for name, values in channels.items()
                if not name.startswith("crypto") and not numpy.isfinite(values).all())
    if not all((values == spp).all() for values in layer("spp.").values()):
        yield f"spp is not {spp}"
    for parts in SUMS:
        for color in "RGB":
            summed = [values for part in parts for name, values in layer(part).items() if name.endswith(f".{color}")]
            off = numpy.abs(sum(summed) - channels[color])
            if not (off <= 1e-6 * (sum(map(numpy.abs, summed)) + 1e-6)).all():
                yield f"{'+'.join(parts)} is off {color} by up to {off.max():g}"
    for color in "RGB":
        square, of = channels[f"stderr.{color}"] ** 2, channels[f"variance.{color}"]
        if not numpy.allclose(square, of, rtol=1e-6, atol=1e-30):
            yield f"stderr.{color}² is not variance.{color}"
    for normal in ("N", "Ng", "denoise_normal"):
        length = sum(channels[f"{normal}.{axis}"] ** 2 for axis in "XYZ")
        if not (length.max() <= 1 + 1e-5 and length.max() > 0.5):
            yield f"{normal} has lengths up to {length.max() ** 0.5:g}"
    if not (channels["Z"] > 0).all():
        yield "Z is not before the camera"


def main(arguments):
    failed = 0
    for path in arguments[1:]:
        channels = read(path)
        found = list(problems(channels, int(arguments[0])))
        failed |= bool(found)
        height, width = channels["R"].shape
        print(f"{path}: {len(channels)} channels of {width} x {height} by OpenImageIO {OpenImageIO.VERSION_STRING}")
        for problem in found:
            print(f"{path}: FAILED: {problem}")
    return failed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
