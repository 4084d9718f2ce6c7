"""The console's numbers in wall time, beside their bars. For an idle machine: on a busy one they say how busy it is.

    python3 bench_console.py WHEELEG [SECONDS]

SECONDS: how long twenty clients look, 60 unless told otherwise; 3600 is the hour of the specification.

Exit code 1 if a bar is missed.
"""

import contextlib
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "host-sim/console/python"))
from check_client import served
from wheeleg import Robot

CLICKS = 100
STOPS = 50
CLIENTS = 20
DEAF = 100
# Parts that come when somebody asks for them.
IN_SPACE = {"view3d.js", "space.js", "solids.js", "matrix.js"}
TICKS_PER_S = os.sysconf("SC_CLK_TCK")
rows = []


def told(what, value, unit, bar):
    met = value <= bar
    rows.append(met)
    print(f"{'met' if met else 'MISSED':7}{what:52}{value:10.1f} {unit:4} bar {bar:g} {unit}", flush=True)


def percentile(values, share):
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


def status(pid, name):
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith(name):
            return int(line.split()[1]) / 1024
    return 0.0


def cpu_s(pid):
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICKS_PER_S


def first_page(program, home):
    begin = time.monotonic()
    with served(program, home) as (address, _, _, _):
        with urllib.request.urlopen(f"http://{address}/") as page:
            page.read()
        told("start of the program to the first page", (time.monotonic() - begin) * 1e3, "ms", 2000)
    folder = Path(__file__).parents[2] / "host-sim/report/page"
    parts = [f for f in folder.iterdir() if f.name not in IN_SPACE]
    told("the page without its view in space", sum(f.stat().st_size for f in parts) / 1e3, "kB", 300)


def clicks(robot):
    """From the call of the command to the sample that shows it asked."""
    robot.subscribe("/joint/3", hz="all")
    robot.latest("/joint/3")
    times = []
    for i in range(CLICKS):
        stroke = 100.0 + (i % 2) * 2 + i * 0.01
        begin = time.monotonic()
        robot.command("JointReference", joint=3, stroke=stroke)
        robot._wait(lambda: abs(robot._latest["/joint/3"]["commanded_mm"] - stroke) < 0.005 or None, 5)
        times.append((time.monotonic() - begin) * 1e3)
    told("command to its commanded_mm, p50", statistics.median(times), "ms", 25)
    told("command to its commanded_mm, p99", percentile(times, 0.99), "ms", 60)


def stops(robot):
    times = []
    for _ in range(STOPS):
        begin = time.monotonic()
        robot.stop()
        times.append((time.monotonic() - begin) * 1e3)
    told("stop to its bit in SYNC, p99", percentile(times, 0.99), "ms", 40)


class Deaf(Robot):
    """A client that asks for everything and reads nothing."""

    def _read(self):
        pass


def answers_p99(robot):
    """Of a question that asks for nothing, ms."""
    times = []
    for _ in range(200):
        begin = time.monotonic()
        robot._answered({"op": "unsubscribe", "channels": []}, 5)
        times.append((time.monotonic() - begin) * 1e3)
        time.sleep(0.02)
    return percentile(times, 0.99)


def deaf(robot, address, key, pid):
    """A hundred clients that never read: what they cost the one in control."""
    topics = [c["topic"] for c in robot.get("channels")["channels"]]
    before, memory = answers_p99(robot), status(pid, "VmRSS")
    clients = []
    for i in range(DEAF):
        # The rest are refused.
        with contextlib.suppress(Exception):
            client = Deaf(address, key, role="view", name=f"deaf {i}")
            client._send({"op": "subscribe", "channels": topics, "hz": "all"})
            clients.append(client)
    time.sleep(2.0)
    told(f"clients that never read and got a place, of {DEAF}", float(len(clients)), "", 30)
    told("an answer beside them, p99, over that without", 100 * answers_p99(robot) / before, "%", 120)
    told("memory of them", status(pid, "VmRSS") - memory, "MB", 32)
    for client in clients:
        client.close()


def crowd(address, key, pid, seconds):
    """Lateness and cost with twenty clients that read every channel."""
    viewers = [Robot(address, key, role="view", name=f"viewer {i}") for i in range(CLIENTS)]
    topics = [c["topic"] for c in viewers[0].get("channels")["channels"]]
    for viewer in viewers:
        viewer.subscribe(*topics)
    memory, begin, used = status(pid, "VmRSS"), time.monotonic(), cpu_s(pid)
    late = []
    while time.monotonic() - begin < seconds:
        late.append(viewers[0].state()["pace"]["late_max_ms"])
        time.sleep(1.0)
    passed = time.monotonic() - begin
    told(f"a core for the robot and {CLIENTS} clients, {seconds:.0f} s", 100 * (cpu_s(pid) - used) / passed, "%", 60)
    told("largest lateness of a cycle within a second, median", statistics.median(late), "ms", 5)
    told("the same, largest", max(late), "ms", 30)
    told("memory that came with it", status(pid, "VmRSS") - memory, "MB", 16)
    pace = viewers[0].state()["pace"]
    told("samples that the hub did not get", pace["dropped"], "", 0)
    told("samples that those who read missed, of 50 a second", sum(viewer.missed() for viewer in viewers), "", 0)
    for viewer in viewers:
        viewer.close()


def main(program, seconds=60.0):
    with tempfile.TemporaryDirectory() as home:
        first_page(program, Path(home))
    with tempfile.TemporaryDirectory() as home, served(program, Path(home)) as (address, keys, recordings, pid):
        with Robot(address, keys["control"]) as robot:
            robot.until(lambda state: state["ready"])
            with robot.control():
                robot.command("RecordStart")
                robot.command("Arm")
                clicks(robot)
                deaf(robot, address, keys["view"], pid)
            crowd(address, keys["view"], pid, float(seconds))
            with robot.control():
                stops(robot)
                robot.command("RecordStop")
        done = subprocess.run([program, "replay", str(recordings / "0001")], capture_output=True, text=True)
        told("hashes of live and replay that differ", float(done.returncode != 0), "", 0)
    assert threading.active_count() < 4
    sys.exit(0 if all(rows) else 1)


if __name__ == "__main__":
    main(*sys.argv[1:])
