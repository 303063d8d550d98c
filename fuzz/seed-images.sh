#!/usr/bin/env bash
# Writes the seeds of the image target again: an image of 20 x 12 texels in the ways that the accepted formats can store
# it. Usage: fuzz/seed-images.sh FOLDER. Needs oiiotool and Python's Pillow. (The KTX2 files are Basis Universal's own,
# see src/texture/ktx2.rs. hostile-dwa.exr, found by mutations, has a chunk that
# says 6e15 bytes.)
set -euo pipefail
cd "$1"
source=$(mktemp -d)
trap 'rm -rf "$source"' EXIT
rgb=$source/rgb.exr rgba=$source/rgba.exr grey=$source/grey.exr
oiiotool --pattern fill:topleft=.9,.1,.1:topright=.1,.9,.1:bottomleft=.1,.1,.9:bottomright=.5,.5,.5 20x12 3 -o "$rgb"
oiiotool --pattern fill:topleft=.9,.1,.1,1:topright=.1,.9,.1,.5:bottomleft=.1,.1,.9,.2:bottomright=.5,.5,.5,0 20x12 4 \
  -o "$rgba"
oiiotool "$rgb" --ch R -o "$grey"

# PNG: depths, palette, interlaced.
for bits in 8 16; do
  for kind in grey rgb rgba; do oiiotool "${!kind}" -d uint$bits -o $kind$bits.png; done
done
python3 - "$source" <<'PYTHON'
import sys
from PIL import Image
image = Image.new("RGBA", (20, 12))
image.putdata([(x * 12, y * 20, 255 - x * 12, 255 - y * 20) for y in range(12) for x in range(20)])
rgb = image.convert("RGB")
rgb.quantize(16).save("palette.png")
rgb.convert("1").save("bit.png")
image.convert("LA").save("grey-alpha.png")
rgb.save("progressive.jpg", progressive=True, quality=60)
rgb.convert("CMYK").save("cmyk.jpg", quality=60)
rgb.save("restart.jpg", quality=60, restart_marker_blocks=1)
rgb.save("subsampled.jpg", quality=30, subsampling=2)
rgb.save("lossless.webp", lossless=True)
image.save("alpha-lossy.webp", quality=40)
frames = [image, image.transpose(Image.Transpose.FLIP_LEFT_RIGHT)]
frames[0].save("animated.webp", save_all=True, append_images=frames[1:], lossless=True)
rgb.quantize(16).save("palette.tga")
rgb.convert("L").save("grey-rle.tga", compression="tga_rle")
image.save("bottom-up.tga", orientation=1)
rgb.quantize(16).save("palette.tif")
rgb.convert("1").save("group4.tif", compression="group4")
rgb.convert("1").save("group3.tif", compression="group3")
rgb.save("deflate.tif", compression="tiff_adobe_deflate")
rgb.convert("CMYK").save("cmyk.tif", compression="tiff_lzw")
rgb.convert("YCbCr").save("ycbcr.tif")
rgb.convert("LAB").save("lab.tif")
rgb.save("jpeg-ycbcr.tif", compression="jpeg", quality=50)
PYTHON

# OpenEXR: compressions that the crate reads, and those that the shim does; tiles, pyramids, windows, Y.
for how in none rle zips zip piz pxr24 b44 b44a dwaa dwab; do
  oiiotool "$rgb" -d half --compression $how -o $how.exr
done
oiiotool "$rgba" -d float --compression zip -o alpha-float.exr
oiiotool "$grey" -d half --chnames Y --compression piz -o luminance.exr
oiiotool "$rgb" -d half --tile 16 16 --compression zip -o tiled.exr
for how in none rle piz pxr24 b44 dwaa; do
  oiiotool "$rgb" -d half --tile 16 16 --compression $how -o tiled-$how.exr
done
oiiotool "$rgb" -d half --origin +3-2 --fullsize 30x16+0+0 --compression rle -o window.exr
oiiotool "$rgb" -d half --tile 8 8 --origin +3-2 --fullsize 30x16+0+0 -o window-tiled.exr
oiiotool "$rgb" -d half --attrib:type=string oiio:subimagename one "$grey" -d half --siappend -o parts.exr
oiiotool "$rgb" -d half -otex pyramid.exr

# TIFF: kinds of numbers, compressions, planes, tiles, pyramids, big TIFF, byte order.
for kind in uint8 uint16 half; do oiiotool "$rgba" -d $kind --compression none -o $kind.tif; done
oiiotool "$rgba" -d float --compression none -o float32.tif
oiiotool "$rgb" -d uint8 --planarconfig separate --compression zip -o separate.tif
oiiotool "$rgb" -d uint16 --tile 16 16 --planarconfig separate --compression lzw -o tiled-separate.tif
oiiotool "$rgb" -d float --compression zip --attrib tiff:Predictor 3 -o predictor.tif
oiiotool "$rgb" -d uint8 --compression lzw --attrib tiff:Predictor 2 -o difference.tif
for bits in 2 4 10 12; do
  oiiotool "$grey" -d uint8 --attrib oiio:BitsPerSample $bits --compression none -o bits$bits.tif
done
oiiotool "$rgb" -d uint8 --tile 16 16 --compression jpeg -o tiled-jpeg.tif
oiiotool "$rgb" -d uint8 -otex pyramid.tx
oiiotool "$rgb" -d half --tile 16 16 -otex pyramid-half.tx
oiiotool "$grey" -d uint16 --tile 16 16 -otex pyramid-grey.tx

# Radiance: as usual (by the crate), and turned (by the shim).
oiiotool "$rgb" -o usual.hdr
sed 's/^#?RADIANCE/#?RGBE/' usual.hdr >named.hdr
sed 's/^-Y 12 +X 20/+Y 12 +X 20/' usual.hdr >upwards.hdr

# TGA and DPX.
oiiotool "$rgba" -d uint8 -o alpha.tga
oiiotool "$grey" -d uint8 --compression none -o plain-grey.tga
for bits in 8 10 12 16; do oiiotool "$rgb" -d uint$bits -o depth$bits.dpx; done
oiiotool "$rgba" -d uint8 --attrib oiio:Endian little -o little.dpx
oiiotool "$grey" -d float -o float.dpx
# Hostile: more bytes of user data than 31 bits can count, found by mutations.
cp little.dpx hostile-user-data.dpx
printf '\0\0\0\231' | dd of=hostile-user-data.dpx bs=1 seek=32 conv=notrunc status=none
