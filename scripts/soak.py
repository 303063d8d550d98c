#!/usr/bin/env python3
"""Small renders under random faults, for as long as SOAK_SECONDS says (3600); make soak builds and runs it.

    scripts/soak.py          cases of the seeds from SOAK_SEED (1) on
    scripts/soak.py SEED     that case alone, told in full; its files stay in target/soak/SEED
    scripts/soak.py kills N  one render that is killed N times and goes on each time: what each leaves, and whether the
                             picture has the bits of a render that was not killed
    scripts/soak.py jobs N   N jobs of all kinds, each killed at a random moment: what is there then, anywhere that it
                             may write (working folder and outputs, scene, TMPDIR, HOME, /dev/shm, /tmp)

Kinds of faults: signals (TERM, INT, HUP, USR1, KILL) at random moments; inputs cut off, overwritten or removed while
they are read; limits of descriptors, memory, file sizes, processes and processor time; a disk that is full (where this
process may mount); two writers to the same outputs; a clock that is set (where libfaketime is installed). A seed
settles all choices, though not what the clock makes of them: a replay may need a few tries.

What holds after each: an exit code that GUIDE.md lists for such a case, no panic and no abort, an end within 20 s, no
file but those asked for, and outputs that are absent or readable: pictures by `compare`, states by `merge`. After a
kill one more render with the same outputs removes what it may have left. One line for each finding, with its replay; a
summary in the end; exit code 1 if anything was found. PATHSPACE names another binary than target/release/pathspace.
"""

import collections
import json
import os
import random
import resource
import shutil
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path

import frames

ROOT = Path(__file__).resolve().parent.parent
BINARY = Path(os.environ.get("PATHSPACE", ROOT / "target/release/pathspace")).resolve()
WORK = ROOT / "target/soak"
# Seconds after which a process hangs: the longest that is planned is 3. More where it has to wait for a processor.
HANG = 20
SEED = int(os.environ.get("SOAK_SEED", 1))
# Small scenes more often than those of some megabytes.
SCENES = {"cornell-box": 6, "in-motion": 3, "veach-mis": 3, "glass-caustics": 1, "env-object": 1}
BAD_WORDS = ["panicked", "internal error", "terminate called", "stack overflow", "memory allocation of"]
LOADER = "error while loading shared libraries"
NOBODY = 65534
NAMES = ["a.exr", "a.png", "a.json", "a.checkpoint"]


def hang_s():
    return HANG * max(1, os.getloadavg()[0] / len(os.sched_getaffinity(0)))


class Case:
    """One case: its random numbers, its folders and what was found in it."""

    def __init__(self, seed):
        self.seed, self.chance, self.found, self.told = seed, random.Random(seed), [], []
        self.folder = WORK / str(seed)
        shutil.rmtree(self.folder, ignore_errors=True)
        self.out, self.tmp = self.folder / "out", self.folder / "tmp"
        for folder in (self.out, self.tmp):
            folder.mkdir(parents=True)
            folder.chmod(0o777)
        name = self.chance.choices(list(SCENES), list(SCENES.values()))[0]
        self.scene = ROOT / "scenes" / name / "scene.gltf"
        self.kind = self.chance.choice(KINDS)

    def render(self, *more, out=None):
        """Arguments of a render to all outputs."""
        chance, out = self.chance, out or self.out
        args = ["render", self.scene, "-q", "--width", chance.randint(1, 64), "--height", chance.randint(1, 48)]
        args += ["-t", chance.randint(1, 4), "-o", out / "a.exr", "--png", out / "a.png", "--stats", out / "a.json"]
        args += ["--aov", chance.choice(["variance", "bounces,albedo", "Z,N,spp"])]
        args += chance.choice([[], ["--backend", "obvhs"]])
        return [*args, "--checkpoint", f"{chance.randint(2, 80)}ms", out / "a.checkpoint", *more]

    def start(self, args, limits=(), shell=(), user=None, more=None):
        """Starts a command in a session of its own, under limits: (resource, soft, hard), with more variables."""
        def prepare():
            # Under nohup, or behind a script's &, they would be ignored until the render listens.
            for number in (signal.SIGHUP, signal.SIGINT):
                signal.signal(number, signal.SIG_DFL)
            for what, soft, hard in limits:
                resource.setrlimit(what, (soft, hard))

        env = {name: value for name, value in os.environ.items() if name != "RUST_BACKTRACE"}
        words = [*map(str, shell), str(BINARY), *map(str, args)]
        self.told.append(" ".join(words))
        process = subprocess.Popen(
            words, cwd=self.folder, env=env | {"TMPDIR": str(self.tmp)} | (more or {}), user=user,
            start_new_session=True, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            preexec_fn=prepare,
        )
        process.began = time.monotonic()
        return process

    def end(self, process, allowed, sent=()):
        """Waits for a process, whose exit code is one of those or of a signal that was sent."""
        try:
            _, said = process.communicate(timeout=hang_s())
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            _, said = process.communicate()
            self.found.append(f"no end within {hang_s():.0f} s")
            return said.decode(errors="replace")
        said, code = said.decode(errors="replace"), process.returncode
        self.told.append(f"exit code {code} after {time.monotonic() - process.began:.1f} s\n{said}")
        # Python's code of a process that a signal killed is -n.
        expected = {*allowed, *(128 + number for number in sent), *(-number for number in sent)}
        if code not in expected and not (code == 127 and LOADER in said):
            last = said.strip().splitlines()[-1:] or ["nothing was said"]
            self.found.append(f"exit code {code}: {last[0][:200]}")
        self.found += [f"it said '{word}'" for word in BAD_WORDS if word in said]
        return said

    def run(self, args, allowed, **how):
        return self.end(self.start(args, **how), allowed)

    def send(self, process, number):
        self.told.append(f"{signal.Signals(number).name} after {time.monotonic() - process.began:.3f} s")
        if process.poll() is None:
            os.kill(process.pid, number)

    def check(self, said="", folder=None, names=None):
        """What is left: nothing but outputs, whole."""
        folder = folder or self.out
        names = sorted(os.listdir(folder)) if names is None else names
        self.found += [f"left behind: {name}" for name in names if name not in NAMES]
        # Pictures that could not be written go there, and are named.
        self.found += [f"left in TMPDIR: {name}" for name in os.listdir(self.tmp) if name not in said]
        for path in (folder / name for name in NAMES if (folder / name).exists()):
            if not self.is_whole(path):
                self.found.append(f"{path.name} is not readable")

    def is_whole(self, path):
        def ask(*args):
            return subprocess.run([BINARY, *args], capture_output=True, timeout=hang_s()).returncode

        if path.suffix == ".exr":
            return ask("compare", path, path) == 0
        if path.suffix == ".checkpoint":
            # One that was stopped between passes is refused as a part (2); one that is damaged cannot be read (1).
            return ask("merge", path, "--allow-gaps", "-q", "-o", self.folder / "merged.exr") != 1
        data = path.read_bytes()
        if path.suffix == ".png":
            return data.startswith(b"\x89PNG") and data.endswith(b"IEND\xaeB`\x82")
        try:
            return "schema" in json.loads(data)
        except ValueError:
            return False


def signals(case):
    """Signals at random moments; the last one asks for an end."""
    chance = case.chance
    args = case.render("--spp", "1000000000")
    process, sent = case.start(args), []
    for number in [chance.choice(["TERM", "INT", "HUP", "USR1", "KILL"]) for _ in range(chance.randint(1, 3))]:
        time.sleep(chance.choice([0.05, 0.3, 1.0]) * chance.random())
        sent.append(signal.Signals[f"SIG{number}"])
        case.send(process, sent[-1])
    if not {signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGKILL} & set(sent):
        time.sleep(chance.random())
        sent.append(signal.SIGTERM)
        case.send(process, signal.SIGTERM)
    case.end(process, {0}, sent)
    state = case.out / "a.checkpoint"
    case.run([*args, "--time", "100ms", *(["--resume", state] if state.exists() else [])], {0})
    case.check()


def inputs(case):
    """Inputs that change while they are read."""
    chance = case.chance
    folder = case.folder / "scene"
    shutil.copytree(case.scene.parent, folder)
    case.scene = folder / "scene.gltf"
    environment = folder / "env.exr"
    more = ["--env", environment] if environment.exists() else []
    process = case.start(case.render("--spp", chance.choice([1, 16, 200]), "--time", "2s", *more))
    for _ in range(chance.randint(1, 2)):
        time.sleep(chance.choice([0.02, 0.2]) * chance.random())
        files = sorted(path for path in folder.iterdir() if path.suffix in (".gltf", ".bin", ".exr"))
        path = chance.choice(files) if files else folder
        what, share = chance.choice(["cut", "fill", "remove"]), chance.random()
        case.told.append(f"{what} {path.name} at {share:.3f} after {time.monotonic() - process.began:.3f} s")
        if not files:
            continue
        size = path.stat().st_size
        if what == "cut":
            os.truncate(path, int(share * size))
        elif what == "fill":
            with path.open("r+b") as file:
                file.seek(int(share * size))
                file.write(chance.randbytes(64))
        else:
            path.unlink()
    case.end(process, {0, 1, 4, 5})
    case.check()


def limits(case):
    """Limits of the process."""
    chance = case.chance
    name = chance.choice(["NOFILE", "AS", "FSIZE", "NPROC", "CPU"])
    most = {
        "NOFILE": chance.randint(3, 48),
        "AS": chance.randint(100, 2000) << 20,
        "FSIZE": chance.choice([0, chance.randint(1, 4096), chance.randint(1, 1 << 18)]),
        "NPROC": chance.randint(1, 8),
        "CPU": 1,
    }[name]
    case.told.append(f"limit {name} {most}")
    what = getattr(resource, f"RLIMIT_{name}")
    # At the hard limit of processor time the system kills.
    limit = (what, most, resource.getrlimit(what)[1] if name == "CPU" else most)
    # Root has no limit of processes.
    user = NOBODY if name == "NPROC" and os.geteuid() == 0 else None
    duration, allowed = ("5s", {0, 152}) if name == "CPU" else ("500ms", {0, 1, 2})
    said = case.run(case.render("--time", duration), allowed, limits=[limit], user=user)
    case.check(said)


def disk(case):
    """A disk with too little room."""
    chance, copy = case.chance, case.folder / "copy"
    (case.folder / "disk").mkdir()
    copy.mkdir()
    script = (
        f": >names; mount -t tmpfs -o size={4096 * chance.randint(1, 60)} none disk || exit 0; "
        '"$@"; code=$?; ls -A disk >names; cp disk/* copy 2>/dev/null; exit $code'
    )
    args = case.render("--spp", chance.choice([1, 8, 64]), "--time", "2s", out=Path("disk"))
    said = case.run(args, {0, 1}, shell=[*MOUNTING, "-c", script, "sh"])
    case.check(said, copy, (case.folder / "names").read_text().split())


def writers(case):
    """Two renders to the same outputs."""
    chance = case.chance
    args = case.render("--time")
    processes = []
    for number in range(2):
        processes.append(case.start([*args, f"{chance.randint(100, 900)}ms", "--seed", number]))
        time.sleep(0.3 * chance.random())
    sent = []
    if chance.random() < 0.5:
        sent.append(chance.choice([signal.SIGKILL, signal.SIGTERM]))
        case.send(chance.choice(processes), sent[0])
    for process in processes:
        case.end(process, {0}, sent)
    case.run([*args, "50ms"], {0})
    case.check()


def clock(case):
    """A clock of the day that is set while a render of a second runs, which is to take a second nevertheless."""
    chance, file = case.chance, case.folder / "clock"
    file.write_text("+0")
    variables = {
        "LD_PRELOAD": FAKETIME, "FAKETIME_TIMESTAMP_FILE": str(file), "FAKETIME_NO_CACHE": "1",
        # Clocks that only run, and the dates of files, are what they are.
        "FAKETIME_DONT_FAKE_MONOTONIC": "1", "NO_FAKE_STAT": "1",
    }
    process = case.start(case.render("--time", "1s"), more=variables)
    for _ in range(chance.randint(1, 4)):
        time.sleep(0.4 * chance.random())
        jump = f"{chance.choice('+-')}{chance.choice([3, 3600, 86400, 10**9])}"
        case.told.append(f"clock {jump} s after {time.monotonic() - process.began:.3f} s")
        file.with_suffix(".new").write_text(jump)
        file.with_suffix(".new").rename(file)
    case.end(process, {0})
    if time.monotonic() - process.began < 1:
        case.found.append("--time 1s ended before a second was over")
    case.check()


def faketime():
    """The library that shows a process another clock, or none."""
    found = sorted(Path("/usr/lib").glob("*/faketime/libfaketimeMT.so.1"))
    if not found:
        print("soak: clocks that are set are left out: apt-get install libfaketime", flush=True)
    return str(found[0]) if found else None


def kills(count):
    """One render, killed so many times, each a while after its start or when it has saved its state."""
    case, left = Case(SEED), 0
    state, chance = case.out / "a.checkpoint", case.chance
    scene = ROOT / "scenes/cornell-box/scene.gltf"
    common = ["render", scene, "-q", "--width", 16, "--height", 12, "--reproducible", "--aov", "bounces,albedo"]
    args = [*common, "-o", case.out / "a.exr", "--stats", case.out / "a.json", "--checkpoint", "5ms", state]

    def age():
        return state.stat().st_mtime_ns if state.exists() else None

    for _ in range(count):
        before, resume = age(), ["--resume", state] if state.exists() else []
        process = case.start([*args, "--spp", 10**9, *resume])
        if chance.random() < 0.5:
            while age() == before and process.poll() is None:
                time.sleep(0.001)
        time.sleep(0.06 * chance.random())
        process.kill()
        process.communicate()
        if process.returncode != -signal.SIGKILL:
            case.found.append(f"exit code {process.returncode} before the kill")
        left += any(name not in NAMES for name in os.listdir(case.out))
    case.run([*args, "--time", "50ms", "--resume", state], {0})
    # An odd number of samples, so that there are several blocks.
    spp = json.loads((case.out / "a.json").read_text())["spp"]["max"] // 64 * 64 + 64 + 23
    case.run([*args, "--spp", spp, "--resume", state], {0})
    case.check()
    case.run([*common, "--spp", spp, "-o", case.folder / "whole.exr"], {0})
    if (case.folder / "whole.exr").read_bytes() != (case.out / "a.exr").read_bytes():
        case.found.append("the picture differs from that of a render that was not killed")
    print(*case.found, f"soak: {count} kills, {spp} spp: {left} left a name that the next render removed; "
          f"{len(case.found)} findings", sep="\n")
    sys.exit(1 if case.found else 0)


def write_glb(path, scene, binary):
    """The scene, whose one buffer is `binary`, in one file."""
    document = json.loads(scene.read_text())
    del document["buffers"][0]["uri"]
    chunks = b""
    for kind, data, filler in ((b"JSON", json.dumps(document).encode(), b" "), (b"BIN\0", binary.read_bytes(), b"\0")):
        data += filler * (-len(data) % 4)
        chunks += struct.pack("<I", len(data)) + kind + data
    path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)


def jobs_of(folder):
    """What is killed: name, arguments, bytes for stdin, and the names that may be there then, of files."""
    scenes = folder / "scenes"
    for name in ("cornell-box", "in-motion"):
        shutil.copytree(ROOT / "scenes" / name, scenes / name)
    (scenes / "textures").mkdir()
    maker, chance = frames.Scene(), random.Random(SEED)
    maker.write(scenes / "textures", False, 3)
    for number in range(3):
        frames.write_png(scenes / f"textures/{number}.png", 2048, chance)
    box, moving = scenes / "cornell-box/scene.gltf", scenes / "in-motion/scene.gltf"
    textured = scenes / "textures/scene.gltf"
    write_glb(scenes / "box.glb", box, box.with_name("scene.bin"))
    for part in range(2):
        made = ["render", box, "--size", "96x80", "--aov", "bounces", "--sample-range", f"{8 * part}..{8 * part + 8}"]
        subprocess.run([BINARY, *made, "-q", "--checkpoint", "1h", scenes / f"{part}.part"], check=True)

    picture = ["--size", "160x120", "--spp", 48, "--reproducible"]
    outputs = ["-o", "a.exr", "--png", "a.png", "--jpg", "a.jpg", "--stats", "a.json", "--report", "a.html"]
    outputs += ["--preview", "b.png", "--every", "20ms", "--survey", "a.survey"]
    all_outputs = ["a.exr", "a.png", "a.jpg", "a.json", "a.html", "b.png", "a.survey"]
    saved = ["--checkpoint", "20ms", "a.checkpoint"]
    each = [f"f.{number:04}.{kind}" for number in range(1, 5) for kind in ("exr", "png", "checkpoint")]
    yield "outputs", ["render", box, *picture, *outputs, "--aov", "variance,bounces"], None, all_outputs
    yield "state", ["render", box, *picture, *saved, "-o", "a.exr"], None, ["a.exr", "a.checkpoint"]
    yield "frames", ["render", moving, "--frames", "1-4", "--size", "64x48", "--spp", 4, "-o", "f.####.exr", "--png",
                     "f.####.png"], None, each
    yield "page", ["render", box, *picture, "--serve=127.0.0.1:0", "-o", "a.exr"], None, ["a.exr"]
    yield "accuracy", ["accuracy", box, "--budget", "1s", "--size", "16x12", "-o", "prices"], None, [
        "prices/report.html", "prices/report.json", "prices/report.csv"]
    yield "merge", ["merge", scenes / "0.part", scenes / "1.part", "-o", "a.exr", "--png", "a.png", "--stats",
                    "a.json"], None, ["a.exr", "a.png", "a.json"]
    # Less memory than the textures need, so that they are copied, and looked up through tiles.
    yield "textures", ["render", textured, "--texture-memory", "24M", "--texture-filter", chance.choice(
        ["exact", "trilinear"]), *picture, "-o", "a.exr"], None, ["a.exr"]
    yield "stdin", ["render", "-", *picture, "-o", "a.exr"], (scenes / "box.glb").read_bytes(), ["a.exr"]
    farm = ["--tasks", 4, "--job", "job"]
    yield "slurm", ["farm", "slurm", box, "--spp", 64, "-o", "a.exr", *farm], None, [
        f"job/{name}.sh" for name in ("array", "merge", "submit")]
    yield "openjd", ["farm", "openjd", moving, "--frames", "1-4", "-o", "f.####.exr", *farm], None, [
        "job/template.json"]
    yield "manual", ["man", "manual"], None, None
    yield "chart", ["bench", box, "--width", 16, "--spp", 1, "-o", "a.svg"], None, ["a.svg"]


def files_below(folder):
    return {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if not path.is_dir()}


def is_whole_file(case, path):
    """Readable to its end; a text that a whole run writes the same each time is compared with it instead."""
    kind, data = path.suffix, path.read_bytes()
    if kind in (".exr", ".checkpoint", ".png", ".json") and path.name not in ("template.json", "report.json"):
        return case.is_whole(path)
    if kind == ".json":
        return json.loads(data) is not None
    ends = {".jpg": b"\xff\xd9", ".html": b"</html>", ".svg": b"</svg>", ".survey": b"", ".csv": b""}
    return len(data) > 0 and data.rstrip(b"\n").endswith(ends.get(kind, b""))


def jobs(count):
    """Jobs of all kinds, killed while they load, render or write; and every file that is there then."""
    case, chance, findings = Case(SEED), random.Random(SEED), []
    kinds, killed, ended, outputs = list(jobs_of(case.folder)), collections.Counter(), 0, 0
    scenes = case.folder / "scenes"
    kept = {name: path.read_bytes() for name, path in files_below(scenes).items()}
    home, took, whole = case.folder / "home", {}, {}
    home.mkdir()

    def begin(args, given):
        shutil.rmtree(case.out)
        case.out.mkdir()
        env = os.environ | {"TMPDIR": str(case.tmp), "HOME": str(home), "XDG_CACHE_HOME": str(home)}
        source = subprocess.PIPE if given else subprocess.DEVNULL
        process = subprocess.Popen(list(map(str, [BINARY, *args])), cwd=case.out, env=env, stdin=source,
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True)
        if given:
            process.stdin.write(given)
            process.stdin.close()
            process.stdin = None
        return process

    def elsewhere():
        """Names in folders that others use as well: those of ours, in /tmp."""
        return {f"/dev/shm/{name}" for name in os.listdir("/dev/shm")} | {
            f"/tmp/{name}" for name in os.listdir("/tmp") if "pathspace-" in name or name.endswith(".partial")}

    def look(what, names, before):
        found = [f"left behind in {folder.name}: {name}" for folder in (case.tmp, home) for name in files_below(folder)]
        found += [f"left behind: {name}" for name in sorted(elsewhere() - before)]
        there = files_below(case.out)
        for name, path in there.items():
            if name not in names:
                found.append(f"left behind: {name}")
            elif whole.get((what, name), b"") != path.read_bytes() and not is_whole_file(case, path):
                found.append(f"{name} is not whole")
            elif path.suffix in (".sh", ".1") and whole.get((what, name)) != path.read_bytes():
                found.append(f"{name} is not what a whole run writes")
        if {name: path.read_bytes() for name, path in files_below(scenes).items()} != kept:
            found.append("files beside the scene changed")
        for folder in (case.tmp, home):
            for path in files_below(folder).values():
                path.unlink()
        return found, len(there)

    # Whole first: how long each takes, and what it leaves when it is not killed.
    for at, (what, args, given, names) in enumerate(kinds):
        before, process = elsewhere(), begin(args, given)
        began = time.monotonic()
        _, said = process.communicate(timeout=3 * hang_s())
        took[what] = time.monotonic() - began
        if process.returncode not in (0, 3):
            findings.append(f"{what}: exit code {process.returncode}: {said.decode(errors='replace')[-200:]}")
        names = names or sorted(files_below(case.out))
        kinds[at] = (what, args, given, names)
        whole |= {(what, name): path.read_bytes() for name, path in files_below(case.out).items()}
        findings += [f"{what}, whole: {found}" for found in look(what, names, before)[0]]
        findings += [f"{what}, whole: no {name}" for name in names
                     if not (case.out / name).exists() and not name.endswith((".checkpoint", ".survey"))]

    for number in range(count):
        what, args, given, names = kinds[number % len(kinds)]
        before, process = elsewhere(), begin(args, given)
        began = time.monotonic()
        # A third at any time, a third as soon as there is an output, a third while it starts.
        how, after = chance.choice(["any", "written", "start"]), chance.random()
        if how == "written":
            limit = began + 2 * took[what] + 1
            while process.poll() is None and time.monotonic() < limit and not files_below(case.out):
                time.sleep(0.0005)
            time.sleep(after * 0.02)
        else:
            time.sleep(after * (took[what] if how == "any" else min(took[what], 0.05)))
        process.kill()
        process.communicate()
        seconds = time.monotonic() - began
        killed[what] += process.returncode == -signal.SIGKILL
        ended += process.returncode != -signal.SIGKILL
        found, there = look(what, names, before)
        outputs += there
        for one in found:
            findings.append(f"{what}, killed after {seconds:.3f} s ({how}, number {number}): {one}")
            print(f"soak: FOUND {findings[-1]}", flush=True)
    told = ", ".join(f"{number} {what}" for what, number in killed.items())
    print(*findings, f"soak: {count} jobs from seed {SEED}: {killed.total()} killed ({told}), {ended} had ended; "
          f"{outputs} outputs, all looked at; {len(findings)} findings", sep="\n")
    sys.exit(1 if findings else 0)


def mounting():
    """A shell that may mount, or none."""
    for shell in (["unshare", "-rm", "sh"], ["unshare", "-m", "sh"]):
        try:
            if subprocess.run([*shell, "-c", "mount -t tmpfs none /tmp"], capture_output=True).returncode == 0:
                return shell
        except OSError:
            pass
    print("soak: full disks are left out: this process may not mount", flush=True)
    return None


def soak_one(seed):
    case = Case(seed)
    try:
        case.kind(case)
    except subprocess.TimeoutExpired as hang:
        case.found.append(f"no end within {hang.timeout:.0f} s: {hang.cmd[1]}")
    except (BlockingIOError, subprocess.SubprocessError) as refused:
        # The system did not even start it under these limits.
        case.told.append(str(refused))
    return case


def main():
    if not os.access(BINARY, os.X_OK):
        sys.exit(f"soak: {BINARY} is missing: make soak builds it")
    # A finding is that a process aborts, not what it held.
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if sys.argv[1:2] == ["kills"]:
        kills(int(sys.argv[2]))
    if sys.argv[1:2] == ["jobs"]:
        jobs(int(sys.argv[2]))
    if len(sys.argv) > 1:
        case = soak_one(int(sys.argv[1]))
        print(*case.told, *case.found, f"{case.kind.__name__}: {len(case.found)} findings", sep="\n")
        sys.exit(1 if case.found else 0)

    seconds, first = float(os.environ.get("SOAK_SECONDS", 3600)), SEED
    began, told, cases, found, seed = time.monotonic(), 60, collections.Counter(), 0, first
    try:
        while (passed := time.monotonic() - began) < seconds:
            if passed > told:
                print(f"soak: {passed:.0f} s, {cases.total()} cases, {found} findings", flush=True)
                told = passed + 60
            case = soak_one(seed)
            cases[case.kind.__name__] += 1
            for finding in dict.fromkeys(case.found):
                found += 1
                print(f"soak: FOUND {case.kind.__name__}: {finding}; scripts/soak.py {seed}", flush=True)
            if not case.found:
                shutil.rmtree(case.folder)
            seed += 1
    except KeyboardInterrupt:
        pass
    kinds = ", ".join(f"{count} {name}" for name, count in sorted(cases.items()))
    print(f"soak: {time.monotonic() - began:.0f} s, seeds {first} to {seed - 1} ({kinds}): {found} findings")
    sys.exit(1 if found else 0)


MOUNTING = mounting()
FAKETIME = faketime()
LEFT_OUT = {kind for kind, possible in ((disk, MOUNTING), (clock, FAKETIME)) if not possible}
KINDS = [kind for kind in (signals, inputs, limits, disk, writers, clock) if kind not in LEFT_OUT]

if __name__ == "__main__":
    main()
