"""Drives a simulated robot with the Python client, `host-sim/console/python/wheeleg.py`.

    python3 check_client.py WHEELEG

Every channel is read; a robot is armed, moved and recorded; what is wrong is refused by name; a viewer may
look and stop; a program whose connection is cut loses the control.
"""

import contextlib
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from websockets.sync.server import serve

sys.path.insert(0, str(Path(__file__).parents[2] / "host-sim/console/python"))
from wheeleg import SUBPROTOCOL, Refused, Robot


@contextlib.contextmanager
def served(program, home, *options):
    """`wheeleg serve` in a home of its own: address, keys, folder of recordings, process."""
    recordings = home / "recordings"
    arguments = [program, "serve", "stand", "--listen", "127.0.0.1:0", "--recordings", str(recordings)]
    arguments += options
    environment = dict(os.environ, XDG_STATE_HOME=str(home))
    process = subprocess.Popen(arguments, env=environment, stdout=subprocess.PIPE, text=True)
    try:
        address = process.stdout.readline().split()[1].removeprefix("http://").rstrip("/")
        keys = {name: (home / "wheeleg" / f"{name}.key").read_text() for name in ("control", "view")}
        yield address, keys, recordings, process.pid
    finally:
        process.terminate()
        process.wait()


@contextlib.contextmanager
def false_server():
    """A server in place of ours, without the keys: its address, and all that it hears."""
    heard = []

    def ask(_, request):
        heard.append(f"{request.path}\n{request.headers}")

    def greet(socket):
        hello = {"op": "hello", "version": 1, "layout": "a", "commands": "b", "nonce": "00" * 32}
        socket.send(json.dumps(hello))
        heard.append(socket.recv(timeout=5))
        socket.send(json.dumps({"op": "error", "reason": "nobody", "text": "\x1b]0;title\x07", "remedy": "none"}))

    with serve(greet, "127.0.0.1", 0, process_request=ask, subprotocols=[SUBPROTOCOL]) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        host, port = server.socket.getsockname()
        yield f"{host}:{port}", heard
        server.shutdown()


def refused(reason, act):
    try:
        act()
    except Refused as error:
        assert error.reason == reason, f"{error.reason}, not {reason}"
        assert str(error).isprintable(), repr(error)
        return
    raise AssertionError(f"not refused: {reason}")


def set_dead_proxies():
    """From now on the environment names a proxy that is not there."""
    proxies = ("http_proxy", "https_proxy", "all_proxy")
    os.environ.update({name: "http://127.0.0.1:9" for name in proxies}, no_proxy="")


def main(program):
    set_dead_proxies()
    with tempfile.TemporaryDirectory() as home, served(program, Path(home)) as (address, keys, recordings, _):
        refused("wrong_key", lambda: Robot(address, "0" * 64))
        with false_server() as (false_address, heard):
            refused("nobody", lambda: Robot(false_address, keys["control"]))
            assert len(heard) == 2 and not any(keys["control"].strip() in text for text in heard), heard
        with Robot(address, keys["control"]) as robot:
            robot.until(lambda state: state["ready"])
            channels = robot.get("channels")["channels"]
            robot.subscribe(*(c["topic"] for c in channels))
            # Events and the head of the log came before.
            steady = [c["topic"] for c in channels if c["written"] == "always" and c["rate_hz"] > 0]
            for topic in steady:
                assert robot.latest(topic)["t_ns"] > 0, topic
            refused("not_in_control", lambda: robot.command("Arm"))
            with robot.control():
                robot.command("RecordStart")
                robot.command("Arm")
                refused("bad_argument", lambda: robot.command("JointReference", joint=9, stroke=1.0))
                robot.command("JointReference", joint=2, stroke=60.0)
                begin = time.monotonic()
                while abs(robot.latest("/joint/2")["sensed_mm"] - 60.0) > 5.0:
                    assert time.monotonic() - begin < 20, robot.latest("/joint/2")
                    time.sleep(0.05)
                with Robot(address, keys["view"], role="view", name="viewer") as viewer:
                    refused("role", lambda: viewer.command("Disarm"))
                    viewer.stop()
                robot.until(lambda state: state["emergency_stop"])
                robot.command("RecordStop")
            robot.until(lambda state: state["control"] is None)
            assert any(event["code"] == "hold" for event in robot.events()), "no event of the stop"
            # A connection that is cut: nobody beats any more.
            cut = Robot(address, keys["control"], name="cut")
            cut.state()
            cut.command("TakeControl")
            cut.close()
            robot.until(lambda state: state["control"] is None, 5)
        done = subprocess.run([program, "replay", str(recordings / "0001")], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    print("every channel read; armed, moved, stopped, recorded and repeated from Python")


if __name__ == "__main__":
    main(sys.argv[1])
