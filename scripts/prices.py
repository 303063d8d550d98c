#!/usr/bin/env python3
"""What 2 % costs on every shared scene and on our own, in numbers that any machine gets: instructions of a sample
(callgrind) and samples to a relative RMSE of 2 %. `make prices` runs it and writes benches/PRICES.md; a change that
makes accuracy dearer shows in the difference.

    scripts/prices.py BINARY [--shared FOLDER] [--scenes NAME ...] [-o FILE]

Instructions: the whole program under callgrind with 4 and with 12 samples per pixel of a small picture; their
difference is 8 samples, with reading, building, surveys and writing taken out. One thread, obvhs, AVX2 (valgrind knows
no AVX-512): the same count on every machine, within a thousandth or so.

Samples: a picture 48 pixels wide, box filter, stops at 2 % or at 512 samples. Where it does not get there, samples go
on from its error as 1/N, and from the lower end of its interval where the verdict on the tail is not `tame`. All of it
is a function of scene, options and seed; seconds are of the machine that ran it, and are there to be looked at.
"""

import argparse
import json
import math
import os
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
TARGET = 0.02
WIDTH, MOST_SPP = 48, 512
SMALL, FEW, MORE = 16, 4, 12
SECONDS = 900


def run(command):
    done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(map(str, command))}: exit {done.returncode}\n{done.stderr[-2000:]}")
    return done


def render(binary, scene, width, spp, more=()):
    options = ["--width", str(width), "--spp", str(spp), "--seed", "1", "-t", "1", "--backend", "obvhs"]
    beside = [pathlib.Path(scene).parent / "env.exr", pathlib.Path(scene).with_suffix(".env.exr")]
    environment = next((["--env", str(file)] for file in beside if file.exists()), [])
    return [binary, "render", scene, *options, *environment, "--filter", "box", "--stats", "-", "-q", *more]


def instructions(binary, scene, spp):
    """Of the whole program, and its paths."""
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "callgrind.out")
        valgrind = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={out}", "--dump-instr=no"]
        done = run(valgrind + render(binary, scene, SMALL, spp))
        total = re.search(r"Collected : (\d+)", done.stderr)
        return int(total.group(1)), json.loads(done.stdout)["paths"]


def price(binary, scene):
    few, few_paths = instructions(binary, scene, FEW)
    more, more_paths = instructions(binary, scene, MORE)
    per_sample = (more - few) / (more_paths - few_paths)
    command = render(binary, scene, WIDTH, MOST_SPP, ["--error", f"{100 * TARGET}%", "--best-effort"])
    stats = json.loads(run(command).stdout)
    spp, error = stats["spp"]["mean"], stats["error"]
    reached = stats["stop"] == "error"
    scale = 1.0 if reached else error["relmse"] / TARGET**2
    ends = [end / error["relmse"] for end in error["interval"]]
    verdict = stats["tail"]["verdict"] if stats.get("tail") else "-"
    pixels = stats["resolution"][0] * stats["resolution"][1]
    to_target = spp * scale
    return {
        "per_sample": per_sample,
        "spp": to_target,
        "low": to_target * (1.0 if reached else min(ends)),
        "high": to_target * (1.0 if reached else max(ends)),
        "reached": reached,
        "verdict": verdict,
        "per_pixel": per_sample * to_target,
        "seconds": stats["seconds"]["render"] * scale,
        "pixels": pixels,
    }


def short(value):
    if not math.isfinite(value):
        return "∞"
    digits = max(0, 2 - int(math.floor(math.log10(abs(value))))) if value else 0
    text = f"{value:,.{digits}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def row(name, p):
    bound = "" if p["reached"] or p["verdict"].startswith("tame") else "≥ "
    # What a bound says is the lower end: the estimate itself is as often too high as too low.
    scale = p["low"] / p["spp"] if bound else 1.0
    between = "reached" if p["reached"] else f"{short(p['low'])} to {short(p['high'])}"
    cells = [name, short(p["per_sample"]), bound + short(scale * p["spp"]), between, p["verdict"]]
    cells += [bound + short(scale * p["per_pixel"] / 1e6), bound + short(scale * p["seconds"])]
    return "| " + " | ".join(cells) + " |"


def scenes(shared):
    """Our own, and the shared ones that are not among them."""
    own = [(path.parent.name, path) for path in sorted((ROOT / "scenes").glob("*/scene.gltf"))]
    known = {name for name, _ in own}
    found = sorted(shared.glob("*.gltf")) if shared.is_dir() else []
    return own + [(path.stem, path) for path in found if path.stem not in known]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary")
    parser.add_argument("--shared", type=pathlib.Path, default=ROOT.parent / "shared" / "scenes")
    parser.add_argument("--scenes", nargs="*", help="those alone, by name")
    parser.add_argument("-o", "--output", type=pathlib.Path)
    args = parser.parse_args()
    version = run([args.binary, "--version"]).stdout.strip()
    rows, failed = [], []
    for name, path in scenes(args.shared):
        if args.scenes and name not in args.scenes:
            continue
        try:
            rows.append(row(name, price(args.binary, str(path))))
            print(rows[-1], flush=True)
        except (RuntimeError, subprocess.TimeoutExpired, KeyError, TypeError) as error:
            failed.append(f"* {name}: not measured: {str(error).splitlines()[0][:90]}")
            print(failed[-1], file=sys.stderr, flush=True)
    head = ["scene", "instructions a sample", "samples to 2 %", "95 %", "tail", "10⁶ instructions a pixel", "s here"]
    text = [
        "# What 2 % costs",
        "",
        f"Written by `make prices` (scripts/prices.py) with {version}. Instructions of a sample by callgrind, the",
        f"difference of {MORE} and {FEW} samples per pixel of a picture {SMALL} pixels wide; samples to a relative",
        f"RMSE of 2 % of a picture {WIDTH} pixels wide: reached, or from its estimate at {MOST_SPP} samples as 1/N, a",
        "lower bound (≥, the lower end) where the tail is not tame. Box filter, seed 1, one thread, obvhs on AVX2.",
        "Instructions and samples are the same on every machine; the seconds, of that picture, are of the one that ran",
        "it.",
        "",
        "| " + " | ".join(head) + " |",
        "|" + " --- |" * len(head),
        *rows,
        *([""] + failed if failed else []),
        "",
    ]
    if args.output:
        args.output.write_text("\n".join(text), encoding="utf-8")
    else:
        print("\n".join(text))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
