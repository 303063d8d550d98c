#!/usr/bin/env python3
"""Models beside their screenshots: renders every model of a folder as the Khronos sample set is laid out
(NAME/*/NAME.gltf or .glb, NAME/screenshot.*) and writes one page.

    PATHSPACE=target/release/pathspace scripts/gallery.py FOLDER OUT [NAME ...]

OUT gets index.html, the pictures and copies of the screenshots; with names, only those are rendered anew. Under each
pair: what was passed, what the program warned of, and why the two differ. Exit code 1 if a render fails, or has samples
that are not finite.
"""
import html
import os
import pathlib
import shutil
import subprocess
import sys

COMMON = ["--size", "320x240", "--spp", "64", "--env", "studio"]

# What a model needs besides, and why it does not look like its screenshot. All: the screenshots have a camera and an
# environment of their viewer, which are not in the files; their rasteriser sees no light between surfaces.
MODELS = {
    "AnimatedMorphCube": (["--at", "0.7"], "the screenshot is a film; this is one moment of it"),
    "AnisotropyStrengthTest": ([], "the highlights are those of another environment"),
    "AttenuationTest": ([], "light really goes through: cubes cast coloured shadows, and are darker where it is far; "
                            "the thickness of row 3 is in a texture, which only a rasteriser needs"),
    "Cameras": ([], "the file has a camera of its own, and this is its first one"),
    "EmissiveStrengthTest": ([], "the cubes light their stalls; the screenshot shows a glow of the display instead"),
    "Fox": (["--at", "0.7"], "another moment of its animation"),
    "GlassHurricaneCandleHolder": ([], "glass refracts twice and has a wall on both sides"),
    "InterpolationTest": (["--at", "0.7"], "the screenshot is a film; this is one moment of it"),
    "MultipleScenes": ([], "--scene 1 shows the other one"),
    "NegativeScaleTest": (["--backfaces", "hide"],
                          "without --backfaces, backs are seen: red crosses. Hidden, they still face the ticks close "
                          "behind them and shade them, which a rasteriser leaves out"),
    "RiggedSimple": (["--at", "0.7"], "another moment of its animation"),
    "SimpleMorph": (["--at", "1"], "another moment of its animation"),
    "SimpleSkin": (["--at", "0.7"], "the set has no screenshot of it"),
    "TextureSettingsTest": (["--backfaces", "hide"],
                            "without --backfaces, the first row shows a red cross. Hidden, it still faces the tick "
                            "close behind it and shades it, which a rasteriser leaves out"),
    "TransmissionRoughnessTest": ([], "lit through the plates, not by a blurred picture of what is behind them"),
    "TransmissionTest": ([], "the light of the file is added to the environment"),
}

STYLE = """body{font:14px sans-serif;margin:2em;background:#222;color:#ddd}
figure{display:inline-block;margin:0 1em 1em 0}
img{width:320px;height:240px;object-fit:contain;background:#333} code{color:#9cf} section{margin-bottom:2em}
.warning{color:#fa5}"""


def model_of(folder):
    """The file of a model: the plain one before the compressed."""
    files = sorted(p for p in folder.glob("*/*") if p.suffix in (".gltf", ".glb"))
    plain = [p for p in files if p.parent.name in ("glTF-Binary", "glTF")]
    return (plain or files or [None])[0]


def show(program, folder, out, wanted):
    """Renders one model; returns its part of the page, and whether all went well."""
    name, file = folder.name, model_of(folder)
    if file is None:
        return "", True
    flags, note = MODELS.get(name, ([], ""))
    picture, stats = out / f"{name}.png", out / f"{name}.json"
    said, good = "", True
    if wanted or not picture.exists():
        command = [program, "render", str(file), *COMMON, *flags, "-o", str(picture), "--stats", str(stats), "-q"]
        run = subprocess.run(command, capture_output=True, text=True)
        said, good = run.stderr.strip(), run.returncode == 0
        (out / f"{name}.txt").write_text(said)
    elif (out / f"{name}.txt").exists():
        said = (out / f"{name}.txt").read_text()
    screenshot = next(iter(sorted(folder.glob("screenshot.*"))), None)
    pictures = [(picture.name, "pathspace")]
    if screenshot:
        copy = out / f"{name}-screenshot{screenshot.suffix}"
        shutil.copyfile(screenshot, copy)
        pictures.append((copy.name, "screenshot of the set"))
    figures = "".join(
        f'<figure><img src="{html.escape(src)}" alt=""><figcaption>{caption}</figcaption></figure>'
        for src, caption in pictures
    )
    warnings = "".join(f'<p class="warning">{html.escape(line)}</p>' for line in said.splitlines() if line)
    options = html.escape(" ".join(COMMON + flags))
    why = f"<p>{html.escape(note)}</p>" if note else ""
    head = f"<h2>{html.escape(name)}</h2>{figures}<p><code>{options}</code></p>"
    return f"<section>{head}{why}{warnings}</section>\n", good


def main(folder, out, *names):
    program = os.environ.get("PATHSPACE", "pathspace")
    folder, out = pathlib.Path(folder), pathlib.Path(out)
    out.mkdir(parents=True, exist_ok=True)
    parts, failed = [], []
    for model in sorted(path for path in folder.iterdir() if path.is_dir()):
        part, good = show(program, model, out, not names or model.name in names)
        parts.append(part)
        if not good:
            failed.append(model.name)
    head = f"<!doctype html><meta charset=utf-8><title>Gallery</title><style>{STYLE}</style><h1>Gallery</h1>"
    (out / "index.html").write_text(head + "".join(parts))
    print(f"{out / 'index.html'}: {len(parts)} models" + (f"; failed: {', '.join(failed)}" if failed else ""))
    return int(bool(failed))


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
