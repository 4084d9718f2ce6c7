"""Looks at a walking robot as Foxglove and Lichtblick do.

    python3 check_foxglove.py WHEELEG

A client of the published protocol, from its text alone. Every channel is read and fits the schema that it was
offered with; frames and joints are those of the robot that is handed out; parameters and the stop work as
they are offered; forged keys, foreign pages and what is not of the protocol are refused.
"""

import asyncio
import contextlib
import json
import random
import struct
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from pathlib import Path

import jsonschema
import websockets
from check_client import served
from wheeleg import Refused, Robot

PROTOCOLS = ["foxglove.sdk.v1", "foxglove.websocket.v1"]
URDF = "package://wheeleg/wheeleg.urdf"
PAGE = "https://viewer.example"


class Viewer:
    """One connection: what was offered, and messages as they come."""

    def __init__(self, socket):
        self.socket, self.offered, self.info, self.services = socket, {}, None, {}

    @staticmethod
    def connect(address, token, protocols=PROTOCOLS, **more):
        # A schema of a viewer's own is larger than the library expects of a message.
        return websockets.connect(
            f"ws://{address}/foxglove?token={token}", subprotocols=protocols, max_size=1 << 24, proxy=None, **more
        )

    async def greet(self):
        while not self.services:
            await self.read()
        assert self.info["op"] == "serverInfo", self.info
        return self

    async def send(self, **message):
        await self.socket.send(json.dumps(message))

    async def read(self):
        """The next message: kind, and what it says."""
        message = await asyncio.wait_for(self.socket.recv(), 10)
        if isinstance(message, str):
            message = json.loads(message)
            if message["op"] == "serverInfo":
                self.info = message
            elif message["op"] == "advertise":
                self.offered.update({channel["id"]: channel for channel in message["channels"]})
            elif message["op"] == "advertiseServices":
                self.services.update({service["name"]: service for service in message["services"]})
            return message["op"], message
        if message[0] == 1:
            subscription, t_ns = struct.unpack_from("<IQ", message, 1)
            return "data", (subscription, t_ns, message[13:])
        if message[0] == 2:
            return "time", struct.unpack_from("<Q", message, 1)[0]
        if message[0] == 3:
            service, call, length = struct.unpack_from("<III", message, 1)
            assert message[13 : 13 + length] == b"json", message
            return "called", (service, call, json.loads(message[13 + length :]))
        assert message[0] == 4, f"unknown message {message[0]}"
        request, status, length = struct.unpack_from("<IBI", message, 1)
        return "asset", (request, status, message[10 : 10 + length].decode(), message[10 + length :])

    async def until(self, kind, wanted=lambda _: True):
        begin = time.monotonic()
        while True:
            came, message = await self.read()
            if came == kind and wanted(message):
                return message
            assert time.monotonic() - begin < 20, f"no {kind}"

    async def call(self, service, encoding=b"json"):
        await self.socket.send(struct.pack("<BIII", 2, service, 5, len(encoding)) + encoding + b"{}")


async def status_of(address, token, **more):
    """Status of a refusal; None: let in."""
    try:
        async with Viewer.connect(address, token, **more) as socket:
            await Viewer(socket).greet()
            return None
    except websockets.InvalidStatus as error:
        return error.response.status_code


async def refusals(address, keys):
    view = keys["view"].strip()
    for token in ("", "0" * 64, "9" * 64, view[:-1], view + "0"):
        assert await status_of(address, token) == 401, token
    for origin, status in (("https://evil.example", 403), ("null", 403), (PAGE, None)):
        assert await status_of(address, view, origin=origin) == status, origin
    assert await status_of(address, view, protocols=["foxglove.websocket.v2"]) == 400
    for protocol in PROTOCOLS:
        assert await status_of(address, view, protocols=[protocol]) is None, protocol
    chance = random.Random(1)
    hostile = ["{", "[]", '{"op":7}', "[" * 30_000, " " * 100_000, b"", b"\2", b"\2" + b"\xff" * 12, b"\x07" * 50]
    hostile += [bytes(chance.randrange(3, 256) for _ in range(chance.randrange(1, 300))) for _ in range(30)]
    for message in hostile:
        async with Viewer.connect(address, view) as socket:
            viewer = await Viewer(socket).greet()
            await socket.send(message)
            try:
                while True:
                    await viewer.read()
            except websockets.ConnectionClosed as closed:
                assert closed.rcvd is None or closed.rcvd.code in (4003, 1009), (message, closed)


async def channels(viewer):
    """Reads every channel that was offered, while the robot walks."""
    await viewer.send(op="fetchAsset", uri=URDF, requestId=3)
    request, status, why, file = await viewer.until("asset")
    assert (request, status, why) == (3, 0, ""), why
    root = ET.fromstring(file)
    links = {link.get("name") for link in root.iter("link")}
    joints = {joint.get("name") for joint in root.iter("joint")}
    judges = {i: jsonschema.Draft202012Validator(json.loads(c["schema"])) for i, c in viewer.offered.items()}
    wanted = [{"id": 1000 + i, "channelId": i} for i in viewer.offered]
    await viewer.send(op="subscribe", subscriptions=wanted)
    topics = {i: channel["topic"] for i, channel in viewer.offered.items()}
    missing, counts, frames = set(topics.values()), dict.fromkeys(topics.values(), 0), set()
    begin = time.monotonic()
    while missing or counts["/tf"] < 100:
        assert time.monotonic() - begin < 60, f"no {missing}"
        kind, message = await viewer.read()
        if kind != "data":
            continue
        subscription, _, payload = message
        topic, value = topics[subscription - 1000], json.loads(payload)
        if counts[topic] < 20:
            judges[subscription - 1000].validate(value)
        counts[topic] += 1
        missing.discard(topic)
        if topic == "/tf":
            frames |= {at["child_frame_id"] for at in value["transforms"]}
            parents = {at["parent_frame_id"] for at in value["transforms"]}
            assert parents <= links | {"world"}, parents - links
        if topic == "/joint_states":
            told = {joint["name"] for joint in value["joints"]}
            assert told <= joints, told - joints
        if topic == "/robot_description":
            assert value["data"].encode() == file
    assert frames <= links, frames - links
    # Every link moves with one above it, but the root of the tree with the world.
    assert frames == links, links - frames
    await viewer.send(op="unsubscribe", subscriptionIds=[s["id"] for s in wanted])
    return counts


async def parameters(address, keys):
    name = "/joint/3/error_scale"
    control, view = keys["control"].strip(), keys["view"].strip()
    async with Viewer.connect(address, control) as socket, Viewer.connect(address, view) as other:
        writer, reader = await Viewer(socket).greet(), await Viewer(other).greet()
        await reader.send(op="getParameters", parameterNames=[], id="all")
        all_of_them = (await reader.until("parameterValues"))["parameters"]
        assert len({p["name"] for p in all_of_them}) == len(all_of_them) > 200
        before = next(p["value"] for p in all_of_them if p["name"] == name)
        await reader.send(op="subscribeParameterUpdates", parameterNames=[name])
        setting = [{"name": name, "value": before + 2, "type": "float64"}]
        await reader.send(op="setParameters", parameters=setting, id="view")
        told = await reader.until("parameterValues", lambda m: m.get("id") == "view")
        assert told["parameters"][0]["value"] == before, told
        await writer.send(op="setParameters", parameters=setting, id="control")
        told = await writer.until("parameterValues", lambda m: m.get("id") == "control")
        assert told["parameters"][0]["value"] == before + 2, told
        assert (await reader.until("parameterValues"))["parameters"][0]["value"] == before + 2
        await writer.send(op="setParameters", parameters=[{"name": name, "value": before}], id="back")
        await writer.until("parameterValues", lambda m: m["parameters"][0]["value"] == before)


async def look(address, keys, drive):
    await refusals(address, keys)
    await parameters(address, keys)
    async with Viewer.connect(address, keys["view"].strip()) as socket:
        viewer = await Viewer(socket).greet()
        assert set(viewer.info["capabilities"]) == {"time", "parameters", "parametersSubscribe", "services", "assets"}
        walking = asyncio.get_running_loop().run_in_executor(None, drive)
        counts = await channels(viewer)
        begin = await viewer.until("time")
        assert await viewer.until("time", lambda t: t > begin) > begin
        await viewer.call(viewer.services["EmergencyStop"]["id"])
        service, call, answer = await viewer.until("called")
        assert call == 5 and answer["stopped"] is True, answer
        await walking
        await viewer.call(99)
        assert (await viewer.until("serviceCallFailure"))["callId"] == 5
    return counts


def main(program):
    options = ("--allow-origin", PAGE, "--foxglove-write")
    with tempfile.TemporaryDirectory() as home, served(program, Path(home), *options) as (address, keys, _, _):
        with Robot(address, keys["control"]) as robot:
            robot.until(lambda state: state["ready"])

        def drive():
            """Walks until somebody stops the robot."""
            with Robot(address, keys["control"]) as robot, robot.control():
                robot.command("Arm")
                robot.command("Stand")
                walk = dict(speed=100.0, turn=0.0, pattern="alternate", lift=60.0, nose=-20.0)
                # It has no end but the stop.
                with contextlib.suppress(Refused):
                    robot.command("Walk", **walk)
                robot.until(lambda state: state["emergency_stop"])

        counts = asyncio.run(look(address, keys, drive))
    told = ", ".join(f"{topic} {count}" for topic, count in sorted(counts.items()))
    print(f"{len(counts)} channels read: {told}")


if __name__ == "__main__":
    main(*sys.argv[1:])
