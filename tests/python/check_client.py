"""Drives a simulated robot with the Python client, `host-sim/console/python/wheeleg.py`.

    python3 check_client.py WHEELEG

Every channel is read; a robot is armed, moved and recorded; what is wrong is refused by name; a viewer may
look and stop; a program whose connection is cut loses the control. On a terminal `ctl top` shows the robot and stops it, and
leaves the terminal as it was, also while it is suspended; tables fit it. `ctl revoke` takes the control away, also while the
clock stands.
"""

import contextlib
import fcntl
import json
import os
import pty
import select
import signal
import struct
import subprocess
import sys
import tempfile
import termios
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


def names_of_others_are_not_taken_for_this_computer(key):
    """However they begin: over plain HTTP nobody is given a proof of a key there."""
    for host in ("127.0.0.1.evil.example:1", "127.evil.example:7420", "localhost.evil.example:1", "192.0.2.7:7420"):
        try:
            Robot(host, key)
        except ValueError as error:
            assert "intercepted" in str(error), error
        else:
            raise AssertionError(f"not refused: {host}")


def set_dead_proxies():
    """From now on the environment names a proxy that is not there."""
    proxies = ("http_proxy", "https_proxy", "all_proxy")
    os.environ.update({name: "http://127.0.0.1:9" for name in proxies}, no_proxy="")


# Not in Python's `termios`.
CIBAUD = 0o2003600000


class Terminal:
    """A program on a terminal of its own, of 100 columns and 30 rows, and all that it has written there."""

    def __init__(self, command, **environment):
        self.near, self.far = pty.openpty()
        fcntl.ioctl(self.far, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 0, 0))
        self.before = self._modes()
        self.text = ""
        environment = {**os.environ, "TERM": "xterm", **environment}
        self.process = subprocess.Popen(command, env=environment, stdin=self.far, stdout=self.far, stderr=self.far)

    def _modes(self):
        """How the terminal is, without its input's own speed: that is the output's, named or not."""
        modes = termios.tcgetattr(self.far)
        modes[2] &= ~CIBAUD
        return modes

    def _read(self):
        there = bool(select.select([self.near], [], [], 0.1)[0])
        if there:
            self.text += os.read(self.near, 65536).decode(errors="replace")
        return there

    def shows(self, wanted, seconds=10):
        """Waits until this is written from here on."""
        begin, end = len(self.text), time.monotonic() + seconds
        while wanted not in self.text[begin:]:
            assert time.monotonic() < end, f"{wanted!r} is not shown: {self.text[-2000:]!r}"
            self._read()

    def is_as_before(self):
        """Its modes, and its screen."""
        screens = self.text.count("\x1b[?1049l") == self.text.count("\x1b[?1049h")
        return screens and self._modes() == self.before

    def suspends(self):
        """Waits until the program is stopped; the terminal is as it was."""
        end = time.monotonic() + 10
        while not os.WIFSTOPPED(os.waitpid(self.process.pid, os.WUNTRACED | os.WNOHANG)[1]):
            assert time.monotonic() < end, f"it is not suspended: {self.text[-500:]!r}"
            self._read()
        while self._read():
            pass

    def goes_on(self, wanted):
        """Continues the program, which shows this on a terminal of its own again."""
        self.process.send_signal(signal.SIGCONT)
        self.shows(wanted)
        assert not self._modes()[3] & termios.ICANON, "after it was suspended the terminal waits for whole lines"

    def press(self, keys):
        os.write(self.near, keys)

    def end(self):
        """Waits for the end; the exit code. The terminal is as it was."""
        end = time.monotonic() + 10
        while self.process.poll() is None:
            assert time.monotonic() < end, f"it does not end: {self.text[-500:]!r}"
            self._read()
        while self._read():
            pass
        assert self.is_as_before(), f"the terminal is not as it was: {self.text[-500:]!r}"
        os.close(self.near)
        os.close(self.far)
        return self.process.returncode


def top(command, environment, robot):
    """The page for terminals: shows, stops by Esc and by nothing else, leaves."""
    terminal = Terminal(command, **environment)
    terminal.shows("left vertical")
    terminal.shows("ARMED")
    # Arrow keys begin with the same byte.
    terminal.press(b"\x1b[A\x1b[B")
    terminal.shows("ARMED")
    assert not robot.state()["emergency_stop"], "an arrow key stops"
    for suspend in (lambda: terminal.press(b"\x1a"), lambda: terminal.process.send_signal(signal.SIGTSTP)):
        suspend()
        terminal.suspends()
        assert terminal.is_as_before(), f"suspended, the terminal is not as it was: {terminal.text[-500:]!r}"
        terminal.goes_on("ARMED")
    # What is not asked: a shell gives the terminal its own modes.
    terminal.process.send_signal(signal.SIGSTOP)
    terminal.suspends()
    termios.tcsetattr(terminal.far, termios.TCSANOW, terminal.before)
    terminal.goes_on("ARMED")
    terminal.press(b"\x1b")
    terminal.shows("STOPPED")
    robot.until(lambda state: state["emergency_stop"])
    terminal.press(b"q")
    assert terminal.end() == 0
    assert "NOT CONFIRMED" not in terminal.text
    lines = terminal.text.split("\x1b[H")[-1].split("\r\n")
    assert len(lines) <= 30, f"{len(lines)} lines"
    # A signal leaves the terminal as it was, too.
    terminal = Terminal(command, **environment)
    terminal.shows("left vertical")
    terminal.process.terminate()
    code = terminal.end()
    assert code == 143, f"{code}: {terminal.text[-300:]!r}"
    # What cannot be drawn on is not.
    terminal = Terminal(command, **{**environment, "TERM": "dumb"})
    terminal.shows("ctl watch")
    assert terminal.end() == 2
    piped = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True)
    assert piped.returncode == 2 and "\x1b[?" not in piped.stdout + piped.stderr, piped


def revoke(command, environment, robot):
    """Who is in control is so no more, and whoever revoked takes it with another command."""
    environment = {**os.environ, **environment}
    ctl = lambda *words: subprocess.run([*command, *words], env=environment, capture_output=True, text=True)
    asks = lambda: ctl("revoke", "--hold", "5")
    with robot.control():
        robot.command("Arm")
        done = asks()
        assert done.returncode == 0 and "no longer in control" in done.stderr, done
        robot.until(lambda state: state["hold"] == "operator_lost", 5)
        robot.until(lambda state: (state["reserved_for"] or {}).get("name") == "the robot's computer", 3)
        refused("control_held", lambda: robot.command("TakeControl"))
        done = ctl("take", "--", "ClearFault")
        assert done.returncode == 0, done
    robot.until(lambda state: state["reserved_for"] is None and state["control"] is None, 10)
    done = asks()
    assert done.returncode == 0 and "nobody is in control" in done.stderr, done
    # Nor is it kept by a clock that stands.
    with robot.control():
        robot.command("Pause")
        done = asks()
        assert done.returncode == 0 and "no longer in control" in done.stderr and "ctl resume" in done.stderr, done
        robot.until(lambda state: (state["control"] or {}).get("ended") == "revoked", 3)
        robot.command("Resume")
        robot.until(lambda state: state["reserved_for"] is None and state["control"] is None, 15)


def tables(program, address, environment):
    """On a terminal the lines of tables fit its width, and nothing is left out; a pipe gets them whole."""
    longest = 0
    lists = (["list"], ["commands"], ["channels"], ["faults", "list"], ["faults", "rows"], ["params"])
    for words in (*lists, ["ctl", "--url", address, "status"]):
        terminal = Terminal([program, *words], **environment)
        assert terminal.end() == 0, words
        lines = terminal.text.split("\r\n")
        assert max(map(len, lines)) <= 100, (words, max(lines, key=len))
        piped = subprocess.run([program, *words], env={**os.environ, **environment}, capture_output=True, text=True)
        longest = max(longest, *map(len, piped.stdout.splitlines()))
        # The state has the time in it.
        assert words in lists and terminal.text.split() == piped.stdout.split() or "ctl" in words, words
    assert longest > 100, longest


def at_the_robot(program):
    """What somebody does at the robot's own computer, on a terminal."""
    with tempfile.TemporaryDirectory() as home, served(program, Path(home)) as (address, keys, _, _):
        environment = {"XDG_STATE_HOME": home}
        command = [program, "ctl", "--url", address]
        with Robot(address, keys["control"]) as robot:
            robot.until(lambda state: state["ready"])
            revoke(command, environment, robot)
            with robot.control():
                robot.command("ClearFault")
                robot.command("Arm")
            tables(program, address, environment)
            top([*command, "top"], environment, robot)


def main(program):
    set_dead_proxies()
    with tempfile.TemporaryDirectory() as home, served(program, Path(home)) as (address, keys, recordings, _):
        names_of_others_are_not_taken_for_this_computer(keys["control"])
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
            samples = robot.get("samples?channel=/joint/2&seconds=5")
            strokes = [row[samples["fields"].index("sensed_mm")] for row in samples["rows"]]
            assert len(strokes) > 50 and all(-1 < stroke < 181 for stroke in strokes), strokes[:5]
            given = [row[-1] for row in robot.get("samples?channel=/session")["rows"]]
            assert "JointReference joint=2 stroke=60.0" in given and "stop" in given, given
            assert robot.latest("/server")["clients"] >= 1, robot.latest("/server")
            assert any(event["code"] == "hold" for event in robot.events()), "no event of the stop"
            # A connection that is cut: nobody beats any more.
            cut = Robot(address, keys["control"], name="cut")
            cut.state()
            cut.command("TakeControl")
            cut.close()
            robot.until(lambda state: state["control"] is None, 5)
        done = subprocess.run([program, "replay", str(recordings / "0001")], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    at_the_robot(program)
    print("every channel read; armed, moved, stopped, recorded and repeated from Python")


if __name__ == "__main__":
    main(sys.argv[1])
