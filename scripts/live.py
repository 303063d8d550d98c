#!/usr/bin/env python3
"""How soon the live page shows something, and what it costs.

    scripts/live.py [SCENE ...]        (the six of ../shared/scenes)

For each scene, `pathspace view` serves its page, and a client asks for the state and the picture as a browser does:
`first`, seconds from the end of building to the first picture; `orbit`, milliseconds from a moved camera to its
picture, median of 12 moves; `server`, processor time of what serves and shows, percent of all processors, while one
client
asks four times a second for 20 s; `idle`, the same without one. PATHSPACE names another binary than
target/release/pathspace.
"""

import http.client
import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BINARY = Path(os.environ.get("PATHSPACE", ROOT / "target/release/pathspace")).resolve()
PORT = 8791
SHARED = ["cornell-box", "veach-mis", "many-lights", "glass-caustics", "env-object", "interior"]


def ask(path, method="GET", body=None):
    """Status and body of an answer; None while nobody answers."""
    try:
        connection = http.client.HTTPConnection("127.0.0.1", PORT, timeout=60)
        connection.request(method, path, body, {"X-Pathspace": "view"})
        answer = connection.getresponse()
        return answer.status, answer.read()
    except OSError:
        return None


def wait(until, patience=600):
    end = time.monotonic() + patience
    while time.monotonic() < end:
        value = until()
        if value:
            return value
        time.sleep(0.005)
    sys.exit("no answer")


def ticks(pid):
    """Processor time of all that does not trace and shade."""
    tracing = 0
    for task in Path(f"/proc/{pid}/task").iterdir():
        if (task / "comm").read_text().startswith("render"):
            tracing += spent(task)
    return spent(Path(f"/proc/{pid}")) - tracing


def spent(folder):
    fields = (folder / "stat").read_text().rpartition(")")[2].split()
    return int(fields[11]) + int(fields[12])


def state():
    answer = ask("/state")
    return json.loads(answer[1]) if answer and answer[0] == 200 else None


def same(view, other):
    return abs(view["azimuth"] - other["azimuth"]) < 1e-6


def measure(scene):
    process = subprocess.Popen([BINARY, "view", scene, "--address", f"127.0.0.1:{PORT}", "-q", "--spp", "1000000"])
    try:
        wait(lambda: (answer := ask("/picture")) and answer[0] == 200)
        first = wait(lambda: state()["curve"])[0]["seconds"]
        orbits = []
        for move in range(12):
            now = state()
            view = now["view"] | {"azimuth": now["view"]["azimuth"] + 3.0}
            began = time.monotonic()
            assert ask("/view", "POST", json.dumps(view))[0] == 200
            wait(lambda: (seen := state())["version"] > now["version"] and same(seen["view"], view))
            orbits.append(1e3 * (time.monotonic() - began))
            time.sleep(0.7)
        shares = []
        for asks in (True, False):
            before, end, shown = ticks(process.pid), time.monotonic() + 20, 0
            while time.monotonic() < end:
                if asks and (version := state()["version"]) != shown:
                    ask("/picture")
                    shown = version
                time.sleep(0.25)
            seconds = (ticks(process.pid) - before) / os.sysconf("SC_CLK_TCK")
            shares.append(100 * seconds / 20 / os.cpu_count())
        told = f"server {shares[0]:.2f} %, idle {shares[1]:.2f} %"
        print(f"{Path(scene).stem}: first {first:.2f} s, orbit {statistics.median(orbits):.0f} ms, {told}", flush=True)
    finally:
        process.terminate()
        process.wait()


if __name__ == "__main__":
    scenes = sys.argv[1:] or [ROOT.parent / f"shared/scenes/{name}.gltf" for name in SHARED]
    for one in scenes:
        measure(one)
