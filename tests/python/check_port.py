"""Leads boards that are a process of their own, behind a pseudo-terminal, as `serve --port` leads real ones.

    python3 check_port.py WHEELEG

Three steps end where the simulator's end, within 2 mm, and reach as far. A server that is killed in mid-walk leaves boards
that hold, and a log that opens. Boards that are gone in mid-walk are told, and the robot is held and disarmed.
"""

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from check_client import served
from wheeleg import Lost, Refused, Robot

ROBOT = ("--robot", "wheeleg-2003")
APART_MM = 2.0
JOINTS = [f"/joint/{n}" for n in range(1, 7)]
# A busy machine may keep a driver from looking for longer than the master lets it; then all begins anew.
ATTEMPTS = 3
# Longest time in which a robot can be armed again.
READY_S = 60
# A server that is there within the boards' 50 ms is a master that counts anew, and they tell `StaleMaster` then.
NOBODY_S = 0.2


@contextlib.contextmanager
def boards(program):
    """Eight boards; the path of their line, and the process."""
    process = subprocess.Popen([program, "boards", "--pty", "stand", *ROBOT], stdout=subprocess.PIPE, text=True)
    try:
        yield process.stdout.readline().split()[-1], process
    finally:
        process.kill()
        process.wait()


def armed(robot):
    """In control of a robot that stands, armed; air that went out comes back in its time."""
    end = time.monotonic() + READY_S
    while True:
        try:
            if robot.state()["hold"]:
                robot.command("ClearFault")
            robot.until(lambda state: state["ready"], 10)
            robot.command("Arm")
            break
        except (Refused, TimeoutError) as error:
            lost = isinstance(error, Refused) and error.reason == "not_in_control"
            if lost or time.monotonic() > end:
                raise
            time.sleep(0.5)
    robot.command("Stand")


def three_steps(robot):
    """Strokes after the three steps, and the extremes on the way, mm."""
    robot.until(lambda state: state["ready"], 60)
    robot.subscribe(*JOINTS)
    for attempt in range(ATTEMPTS):
        try:
            with robot.control():
                armed(robot)
                seen = []
                over = walked(robot)
                while over() is None:
                    seen.append([robot.latest(joint)["sensed_mm"] for joint in JOINTS])
                    time.sleep(0.01)
                if not over():
                    raise Refused("walk", f"it was ended: {robot.state()}")
                time.sleep(1.0)
                ends = [robot.latest(joint)["sensed_mm"] for joint in JOINTS]
                extremes = [(min(column), max(column)) for column in zip(*seen)]
                robot.command("Disarm")
                return ends, extremes
        except (Refused, TimeoutError) as error:
            again(attempt, error)


def again(attempt, error):
    """Before what went wrong is tried once more."""
    print(f"attempt {attempt + 1}: {error}", file=sys.stderr, flush=True)
    if attempt == ATTEMPTS - 1:
        raise error
    time.sleep(1.0)


@contextlib.contextmanager
def in_mid_walk(robot):
    """In control of a robot that has been walking for a second; it may be lost in the block."""
    robot.until(lambda state: state["ready"], 60)
    for attempt in range(ATTEMPTS):
        with contextlib.ExitStack() as stack:
            try:
                stack.enter_context(robot.control())
                armed(robot)
                walked(robot)
                robot.until(lambda state: state["stepping"], 10)
                time.sleep(1.0)
                if not robot.state()["stepping"]:
                    raise Refused("walk", f"it was ended: {robot.state()}")
            except (Refused, TimeoutError) as error:
                again(attempt, error)
                continue
            with contextlib.suppress(Lost, Refused):
                yield
            return


def walked(robot):
    """Begins the three steps; asks whether they are over: none, true or false."""
    n = robot._send({"seen_us": robot._seen_us, "valid_ms": 1000, "cmd": "StartGait", "args": {}})

    def over():
        with robot._changed:
            answer = robot._answers.get(n)
        return None if answer is None else answer["status"] == "done"

    return over


def compared(one, other):
    (ends, extremes), (other_ends, other_extremes) = one, other
    worst = max(abs(a - b) for a, b in zip(ends, other_ends))
    reach = max(abs(a - b) for pair, other_pair in zip(extremes, other_extremes) for a, b in zip(pair, other_pair))
    swing = max(high - low for low, high in extremes)
    assert swing > 100, f"nothing moved: {extremes}"
    assert worst <= APART_MM and reach <= APART_MM, f"ends {worst:.2f} mm apart, extremes {reach:.2f} mm"
    return worst, reach


def log_of_the_killed(program, folder, last_us):
    """The log of a killed server opens, up to half a second before its end."""
    log = folder / "log.mcap"
    done = subprocess.run([program, "view", str(log), "--out", str(folder / "log.html")], capture_output=True, text=True)
    assert done.returncode == 0 and "is truncated" in done.stderr, done.stderr
    # What the page shows is what the log has.
    first = done.stdout.split()[0]
    assert float(first) >= last_us * 1e-6 - 0.5, f"{first} s of {last_us * 1e-6} s"


def killed_in_mid_walk(program, home, line):
    with served(program, home, *ROBOT, "--port", line, "--record") as (address, keys, recordings, pid):
        with Robot(address, keys["control"]) as robot, in_mid_walk(robot):
            last_us = robot.state()["master_us"]
            os.kill(pid, signal.SIGKILL)
            robot.until(lambda state: False, 5)
    time.sleep(NOBODY_S)
    log_of_the_killed(program, recordings / "0001", last_us)
    # Somebody else leads them: they hold, and say why.
    with served(program, home, *ROBOT, "--port", line) as (address, keys, _, _):
        with Robot(address, keys["view"], role="view") as robot:
            state = robot.until(lambda state: all(board["present"] for board in state["boards"]), 30)
            assert not state["armed"], state
            for board in state["boards"][:6]:
                faults = {fault["name"] for fault in board["faults"]}
                assert "LinkLost" in faults and board["mode"] in ("hold", "idle", "exhaust"), board


def gone_in_mid_walk(program, home):
    with boards(program) as (line, process):
        with served(program, home, *ROBOT, "--port", line) as (address, keys, _, _):
            with Robot(address, keys["control"]) as robot:
                with in_mid_walk(robot):
                    begin = robot.state()["master_us"]
                    process.kill()
                    state = robot.until(lambda state: state["hold"], 5)
                    took_ms = (state["master_us"] - begin) / 1e3
                    assert took_ms < 1000, f"held after {took_ms} ms"
                    robot.until(lambda state: not state["armed"], 5)
                codes = [event["code"] for event in robot.events()]
                assert "line_broken" in codes, codes[-20:]
    return took_ms


def main(program):
    with tempfile.TemporaryDirectory() as home:
        with served(program, Path(home), *ROBOT) as (address, keys, _, _), Robot(address, keys["control"]) as robot:
            simulated = three_steps(robot)
    with tempfile.TemporaryDirectory() as home, boards(program) as (line, _):
        with served(program, Path(home), *ROBOT, "--port", line) as (address, keys, _, _):
            with Robot(address, keys["control"]) as robot:
                assert robot.state()["simulated"] is False
                ends, reach = compared(simulated, three_steps(robot))
    with tempfile.TemporaryDirectory() as home, boards(program) as (line, _):
        killed_in_mid_walk(program, Path(home), line)
    with tempfile.TemporaryDirectory() as home:
        took_ms = gone_in_mid_walk(program, Path(home))
    print(f"three steps over a line: ends {ends:.2f} mm, extremes {reach:.2f} mm apart; a killed server leaves boards that hold; gone boards held after {took_ms:.0f} ms")


if __name__ == "__main__":
    main(sys.argv[1])
