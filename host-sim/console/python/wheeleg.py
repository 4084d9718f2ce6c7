"""Sees and drives the robot that `wheeleg serve` runs. One file; it needs `websockets` 15 or newer.

    from wheeleg import Robot

    with Robot("127.0.0.1:7420", key=open("control.key").read()) as robot:
        robot.subscribe("/joint/3")
        with robot.control():                    # beats while the block lasts, and releases
            robot.command("Arm")
            robot.command("Stand")
            robot.command("JointReference", joint=3, stroke=120.0)
            robot.command("WriteParameter", board=3, parameter="error_scale", value=21.0)    # mm
        print(robot.latest("/joint/3")["sensed_mm"])

Commands and their arguments are those of `wheeleg commands`. A command that is refused raises `Refused`, with the
reason and what to do. The contract is PROTOCOL.md, beside this folder.
"""

import contextlib
import hashlib
import hmac
import ipaddress
import json
import secrets
import struct
import threading
import urllib.request

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

SUBPROTOCOL = "wheeleg.console.v1"
BEAT_S = 0.05
# Longest motion: a gait of many steps.
LONGEST_S = 600.0


class Refused(Exception):
    """The robot or its server does not do it."""

    def __init__(self, reason, text):
        # Nor does the text of a false server act on a terminal.
        shown = "".join(c if c.isprintable() else "\ufffd" for c in f"{reason}: {text}")
        super().__init__(shown)
        self.reason = reason


class Lost(Exception):
    """The connection has ended."""


def _prefixed(*parts):
    """Each part with its length before it."""
    whole = b""
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        whole += struct.pack("<I", len(data)) + data
    return whole


def _is_own(host):
    """Whether a name or an address is this computer's own."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _mac(key, data):
    return hmac.new(key, data, hashlib.sha256).digest()


_READERS = {"f32": "<f", "u32": "<I", "i32": "<i", "u64": "<Q", "bool": "<?"}


class Robot:
    """One session. `key`: the 64 digits of control.key (role `control`) or view.key (role `view`)."""

    def __init__(self, host, key, role="control", name="python"):
        self.host = host.removeprefix("http://").removeprefix("ws://").rstrip("/")
        if not _is_own(self.host.rsplit(":", 1)[0].strip("[]")):
            raise ValueError("over plain HTTP a key could be intercepted: reach the server through ssh -L")
        self.name, self.role = name, role
        self._digits = key.strip()
        self._key = bytes.fromhex(self._digits)
        if len(self._key) != 32:
            raise ValueError("a key has 64 hexadecimal digits")
        # Guards everything below: a thread reads, another beats.
        self._changed = threading.Condition()
        self._latest, self._events, self._answers = {}, [], {}
        self._missed = 0
        self._state, self._seen_us, self._n, self._lost = None, 0, 0, None
        # This computer's own address needs no proxy, which would be told the key.
        self._socket = connect(f"ws://{self.host}/ws", subprotocols=[SUBPROTOCOL], proxy=None)
        try:
            self._shake_hands()
            # Only now: a server that has not proved to have the key would be given it here.
            self._channels = {c["id"]: c for c in self.get("channels")["channels"]}
        except BaseException:
            self._socket.close()
            raise
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        self._socket.close()
        self._reader.join(timeout=2)

    # ---- looking ----

    def get(self, path):
        """A document of the HTTP API: `state`, `commands`, `channels`, `samples?channel=/joint/3&seconds=10`, `parameters`,
        `events`, `faults`, `recordings`."""
        request = urllib.request.Request(f"http://{self.host}/api/v1/{path}")
        request.add_header("Authorization", f"Bearer {self._digits}")
        direct = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        with direct.open(request, timeout=5) as answer:
            return json.load(answer)

    def state(self):
        """How the robot is, as it was told last; waits for the first."""
        return self._wait(lambda: self._state, 5)

    def subscribe(self, *channels, hz=50):
        """Asks for samples; `hz` is 1 to 50, or "all"."""
        self._answered({"op": "subscribe", "channels": list(channels), "hz": hz}, 5)

    def latest(self, channel):
        """The newest sample of a channel, by field, with `t_ns`; waits for the first."""
        return self._wait(lambda: self._latest.get(channel), 5)

    def missed(self):
        """Samples of what was asked for that did not come, because this program or its line was too slow."""
        with self._changed:
            return self._missed

    def events(self):
        """All events since the connection."""
        with self._changed:
            return list(self._events)

    def until(self, wanted, seconds=30):
        """Waits until `wanted(state)` is true, and gives that state."""
        return self._wait(lambda: self._state if self._state and wanted(self._state) else None, seconds)

    # ---- driving ----

    def stop(self):
        """Stops the robot, whatever the role. `Refused`: not confirmed, cut the air."""
        self._answered({"op": "stop"}, 2)

    def command(self, name, valid_ms=1000, **arguments):
        """Gives a command and waits for its end."""
        self._answered({"seen_us": self._seen_us, "valid_ms": valid_ms, "cmd": name, "args": arguments}, LONGEST_S)

    @contextlib.contextmanager
    def control(self):
        """Takes the control, keeps it while the block lasts, and releases it. Where this program ends or the connection
        is cut, the master holds the robot. The beats are a thread's: a block that hangs is not noticed."""
        self.state()
        self.command("TakeControl")
        over = threading.Event()
        beats = threading.Thread(target=self._beat, args=(over,), daemon=True)
        beats.start()
        try:
            yield self
        finally:
            over.set()
            beats.join()
            with contextlib.suppress(Refused, Lost):
                self.command("ReleaseControl")

    # ---- the contract ----

    def _shake_hands(self):
        hello = json.loads(self._socket.recv(timeout=5))
        nonce_s, nonce_c = bytes.fromhex(hello["nonce"]), secrets.token_bytes(32)
        common = _prefixed(nonce_s, nonce_c, self.role, self.name, self.host, hello["layout"], hello["commands"])
        proof = _mac(self._key, _prefixed("c1") + common)
        auth = {"op": "auth", "role": self.role, "name": self.name, "nonce": nonce_c.hex(), "mac": proof.hex()}
        self._socket.send(json.dumps({**auth, "layout": hello["layout"], "commands": hello["commands"]}))
        welcome = json.loads(self._socket.recv(timeout=5))
        if welcome["op"] != "welcome":
            raise Refused(welcome["reason"], f"{welcome['text']}; {welcome['remedy']}")
        expected = _mac(self._key, _prefixed("s1") + common + _prefixed(welcome["session"]))
        if not hmac.compare_digest(expected.hex(), welcome["mac"]):
            raise Refused("not_your_robot", "its server does not have the key")
        self.session = welcome["session"]
        self._session_key = _mac(self._key, _prefixed("k1", nonce_s, nonce_c))

    def _send(self, frame):
        """Sends a frame after those before it, and gives its number."""
        with self._changed:
            self._n += 1
            text = json.dumps({"n": self._n, **frame}).encode()
            try:
                self._socket.send(_mac(self._session_key, _prefixed("f1", text))[:16] + text)
            except ConnectionClosed as error:
                raise Lost(str(error)) from error
            return self._n

    def _answered(self, frame, seconds):
        n = self._send(frame)
        answer = self._wait(lambda: self._answers.pop(n, None), seconds)
        if answer["status"] == "unknown":
            raise Lost("nobody answered within 2 s: look at the robot")
        if answer["status"] == "refused":
            raise Refused(answer["reason"], answer.get("text", ""))

    def _beat(self, over):
        while not over.wait(BEAT_S):
            try:
                self._send({"op": "beat", "seen_us": self._seen_us})
            except Exception:
                return

    def _wait(self, found, seconds):
        result = None

        def there():
            nonlocal result
            result = found()
            return result is not None or self._lost is not None

        with self._changed:
            if not self._changed.wait_for(there, seconds):
                raise TimeoutError(f"not within {seconds} s")
            if result is None:
                raise Lost(self._lost)
            return result

    def _read(self):
        try:
            for message in self._socket:
                with self._changed:
                    if isinstance(message, str):
                        self._told(json.loads(message))
                    else:
                        self._samples(message)
                    self._changed.notify_all()
            end = "the connection has ended"
        except Exception as error:
            end = str(error)
        with self._changed:
            self._lost = end
            self._changed.notify_all()

    def _told(self, message):
        kind = message["op"]
        if kind == "answer" and message["status"] != "accepted":
            self._answers[message["n"]] = message
        elif kind == "state":
            self._state = message
            self._seen_us = max(self._seen_us, message["master_us"])
        elif kind == "event":
            self._events.append(message)

    def _samples(self, frame):
        number, missed = struct.unpack_from("<HI", frame, 1)
        channel = self._channels[number]
        self._missed += missed
        at = 7
        while at < len(frame):
            values = {"t_ns": struct.unpack_from("<Q", frame, at)[0]}
            at += 8
            for field in channel["fields"]:
                if field["wire"] == "text":
                    length = struct.unpack_from("<H", frame, at)[0]
                    values[field["name"]] = frame[at + 2 : at + 2 + length].decode()
                    at += 2 + length
                else:
                    layout = _READERS[field["wire"]]
                    values[field["name"]] = struct.unpack_from(layout, frame, at)[0]
                    at += struct.calcsize(layout)
            self._latest[channel["topic"]] = values
