#!/usr/bin/env python3
"""Does `--error` keep its promise, and does its pilot know what that takes? For each scene a few dozen pictures of
different seeds are rendered to the same relative RMSE. The truth of each picture is its relMSE against the mean of all
the others and of a reference of --reference times the samples that a picture took. Prints a row of Markdown a scene:
in how many pictures the target is kept, how many samples they took, and of the pilots whose tail was "tame" how many
foretold samples and seconds within 25 %; of the others, in how many cases the lower bound held.

    scripts/promises.py BINARY [--target 2%] [--size 64x64] [--seeds 20] [--scenes NAME ...] [--shared FOLDER]
                        [--filter box] [--reference 8]

Seconds are wall seconds of one thread, of a machine that should have nothing else to do. A target that is kept in 99 %
is kept in 19 of 20 or more with a chance of 98 %.
"""

import argparse
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile

import coverage

WITHIN = 0.25


def run(binary, path, folder, name, size, kind, more):
    out, stats = folder / f"{name}.exr", folder / f"{name}.json"
    command = [binary, "render", str(path), "--size", size, "--filter", kind, "-o", str(out), "--stats", str(stats)]
    command += ["-q", "-t", "1", *coverage.environment(path), *more]
    subprocess.run(command, check=True, capture_output=True)
    image = coverage.picture(out)
    out.unlink()
    return image, json.loads(stats.read_text())


def study(binary, path, args):
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        pictures = []
        for seed in range(args.seeds):
            more = ["--error", args.target, "--seed", str(9000 + seed)]
            pictures.append(run(binary, path, folder, "picture", args.size, args.filter, more))
        samples = [stats["spp"]["mean"] for _, stats in pictures]
        longest = int(statistics.median(samples) * args.reference)
        reference, _ = run(binary, path, folder, "long", args.size, args.filter, ["--spp", str(longest), "--seed", "1"])
    total, weight = [value * longest for value in reference], longest
    for image, stats in pictures:
        spp = stats["spp"]["mean"]
        total = [sum_ + value * spp for sum_, value in zip(total, image)]
        weight += spp
    target = float(args.target.rstrip("%")) / 100
    errors, tame, caught = [], [], []
    for image, stats in pictures:
        spp, prediction = stats["spp"]["mean"], stats["prediction"]
        others = [(sum_ - value * spp) / (weight - spp) for sum_, value in zip(total, image)]
        epsilon = 0.01 * (sum(others) / len(others)) ** 2
        # The reference has an error of its own, spp/(weight − spp) of the picture's, independent of it.
        relmse = coverage.relmse(image, others, epsilon) / (1 + spp / (weight - spp))
        errors.append(relmse**0.5)
        if prediction and not prediction["at_least"]:
            off = [prediction[key] / prediction[f"taken_{key}"] - 1 for key in ("spp",)]
            off.append(prediction["seconds"] / prediction["taken_s"] - 1)
            tame.append(off)
        elif prediction:
            caught.append(prediction["taken_spp"] >= prediction["spp_interval"][0])
    return {
        "kept": sum(error <= target for error in errors),
        "errors": errors,
        "samples": samples,
        "tame": tame,
        "caught": caught,
    }


def share(hits, of):
    return f"{hits} of {of}" if of else "–"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary")
    parser.add_argument("--target", default="2%")
    parser.add_argument("--size", default="64x64")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--scenes", nargs="*")
    parser.add_argument("--shared", type=pathlib.Path, default=coverage.ROOT.parent / "shared" / "scenes")
    parser.add_argument("--filter", default="blackman-harris")
    parser.add_argument("--reference", type=float, default=8)
    args = parser.parse_args()
    head = ["scene", "kept", "error, median, %", "largest, %", "spp, median", "largest"]
    head += ["tame: spp ±25 %", "tame: seconds ±25 %", "else: lower bound held"]
    print("| " + " | ".join(head) + " |\n|" + " --- |" * len(head), flush=True)
    for name, path in coverage.scenes(args.shared, args.scenes):
        try:
            s = study(args.binary, path, args)
        except (subprocess.CalledProcessError, RuntimeError, KeyError, TypeError) as error:
            print(f"{name}: {error}", file=sys.stderr, flush=True)
            continue
        within = [sum(abs(off[i]) <= WITHIN for off in s["tame"]) for i in range(2)]
        cells = [name, share(s["kept"], args.seeds)]
        cells += [f"{100 * value:.2f}" for value in (statistics.median(s["errors"]), max(s["errors"]))]
        cells += [f"{value:,.0f}" for value in (statistics.median(s["samples"]), max(s["samples"]))]
        cells += [share(hits, len(s["tame"])) for hits in within] + [share(sum(s["caught"]), len(s["caught"]))]
        print("| " + " | ".join(cells) + " |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
