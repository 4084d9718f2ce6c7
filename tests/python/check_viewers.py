"""Check the derived channels of a log, and its exports, with readers that are not ours.

    check_viewers.py RUN_DIR ROBOT.urdf PARQUET_DIR ROS2_DIR LOG.sql

RUN_DIR holds the log, ROBOT.urdf is `wheeleg export urdf` of its robot, the other two are
`wheeleg export parquet` and `wheeleg export ros2` of it. Ends with 0 if everything holds; the
first thing that does not ends it with an error.
"""

import importlib
import json
import sys
from collections import defaultdict
from importlib.metadata import version
from pathlib import Path

import duckdb
import google.protobuf.json_format
import jsonschema
import numpy as np
import pinocchio
import pyarrow
import pyarrow.parquet
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

VIEWED = ("/tf", "/joint_states", "/scene", "/scene/contacts", "/log")
# Metres: how far a frame may be from where it should be.
CLOSE_M = 1e-6


def read(path):
    """All messages of a log by topic, as (time, JSON), and its schemas and attachments."""
    messages, schemas = defaultdict(list), {}
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        attachments = {a.name: a.data for a in reader.iter_attachments()}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            schemas[channel.topic] = schema
            messages[channel.topic].append((message.log_time, json.loads(message.data)))
    return messages, schemas, attachments


def matrix(position, orientation):
    """Homogeneous transform."""
    q = pinocchio.Quaternion(*(orientation[k] for k in "wxyz"))
    assert abs(q.norm() - 1) < 1e-6, q
    return pinocchio.SE3(q.normalized(), np.array([position[k] for k in "xyz"]))


def placements(message):
    """Every child of a /tf message in the world."""
    found = {"world": pinocchio.SE3.Identity()}
    for t in message["transforms"]:
        own = matrix(t["translation"], t["rotation"])
        found[t["child_frame_id"]] = found[t["parent_frame_id"]] * own
    return found


def protobuf_time(value):
    """Times as the JSON form of protobuf has them."""
    if isinstance(value, list):
        return [protobuf_time(v) for v in value]
    if not isinstance(value, dict):
        return value
    if value.keys() == {"sec", "nsec"}:
        return value
    out = {}
    for key, v in value.items():
        if key == "timestamp":
            out[key] = f"{np.datetime64(0, 's') + np.timedelta64(v['sec'], 's')}.{v['nsec']:09}Z"
        elif key == "lifetime":
            out[key] = f"{v['sec']}.{v['nsec']:09}s"
        else:
            out[key] = protobuf_time(v)
    return out


def check_schemas(messages, schemas):
    """Every message fits the schema in the log, and Foxglove's own protobuf where it has the type."""
    for topic in VIEWED:
        schema = schemas[topic]
        assert schema.encoding == "jsonschema" and schema.name.startswith("foxglove."), schema.name
        validator = jsonschema.validators.validator_for({})(json.loads(schema.data))
        name = schema.name.removeprefix("foxglove.")
        try:
            module = importlib.import_module(f"foxglove_schemas_protobuf.{name}_pb2")
        except ModuleNotFoundError:
            module = None
        last = 0
        # A contact message has hundreds of fields: a part of them is enough.
        step = max(1, len(messages[topic]) // 100)
        for time, message in messages[topic][::step]:
            assert time >= last
            last = time
            validator.validate(message)
            if module is not None:
                parsed = getattr(module, name)()
                google.protobuf.json_format.ParseDict(protobuf_time(message), parsed)
        print(f"{topic}: {len(messages[topic])} {schema.name}, protobuf: {module is not None}")


def check_frames(messages, urdf):
    """/tf is the URDF at the positions of /joint_states, link by link."""
    model = pinocchio.buildModelFromUrdf(str(urdf), pinocchio.JointModelFreeFlyer())
    data = model.createData()
    bodies = {f.name for f in model.frames if f.type == pinocchio.FrameType.BODY}
    states = dict(messages["/joint_states"])
    moving = {n for n in model.names if n not in ("universe", "root_joint")}
    low, high = {}, {}
    for time, message in messages["/tf"]:
        found = placements(message)
        assert set(found) - {"world"} == bodies, set(found) ^ bodies
        joints = {j["name"]: j for j in states[time]["joints"]}
        assert joints.keys() == moving, joints.keys() ^ moving
        q = pinocchio.neutral(model)
        base = found["base_link"]
        q[:7] = pinocchio.SE3ToXYZQUAT(base)
        for name, joint in joints.items():
            at = model.joints[model.getJointId(name)]
            if at.nq == 2:
                q[at.idx_q : at.idx_q + 2] = np.cos(joint["position"]), np.sin(joint["position"])
            else:
                q[at.idx_q] = joint["position"]
        pinocchio.framesForwardKinematics(model, data, q)
        for name in bodies:
            ours = found[name]
            theirs = data.oMf[model.getFrameId(name)]
            gap = np.linalg.norm(ours.translation - theirs.translation)
            assert gap < CLOSE_M, f"{name} at {time} ns: {gap} m"
            turn = np.linalg.norm(pinocchio.log3(theirs.rotation.T @ ours.rotation))
            assert turn < 1e-6, f"{name} at {time} ns: {turn} rad"
            place = np.r_[ours.translation, ours.rotation.ravel()]
            low[name] = np.minimum(low.get(name, place), place)
            high[name] = np.maximum(high.get(name, place), place)
    still = [name for name in bodies if (high[name] - low[name]).max() < 1e-4]
    assert not still, f"never move: {still}"
    # The joints are those of the channels of the log.
    for n in range(1, 7):
        logged = {t: m["position_mm"] for t, m in messages[f"/joint/{n}"]}
        for time, state in states.items():
            joint = next(j for j in state["joints"] if j["name"] == f"/joint/{n}")
            assert abs(joint["position"] - logged[time] * 1e-3) < 1e-6, (n, time)
    print(f"{len(bodies)} links and {len(moving)} joints, {len(states)} times, pinocchio {pinocchio.__version__}")


def check_contacts(messages):
    """Arrows begin at a sole, tread or corner, are as long as the forces, and carry the robot."""
    frames = dict(messages["/tf"])
    loads = {side: dict(messages[f"/foot/{side}"]) for side in ("left", "right")}
    arrows = 0
    for time, message in messages["/scene/contacts"]:
        found = placements(frames[time])
        for entity in message["entities"]:
            told = {m["key"]: m["value"] for m in entity["metadata"]}
            drawn = 0.0
            for arrow in entity["arrows"]:
                arrows += 1
                start = np.array([arrow["pose"]["position"][k] for k in "xyz"])
                far = np.linalg.norm(start - found[entity["id"]].translation)
                assert far < 1.0, f"{entity['id']} at {time} ns: {far} m"
                q = np.array(list(arrow["pose"]["orientation"].values()))
                assert abs(np.linalg.norm(q) - 1) < 5e-3, q
                drawn += (arrow["shaft_length"] + arrow["head_length"]) / 0.002
            total = sum(float(v) for k, v in told.items() if k.endswith(".force_n"))
            # Two lengths of an arrow have half a millimetre each.
            assert abs(drawn - total) <= 0.51 * len(entity["arrows"]) + 0.01, (entity["id"], time, drawn, total)
            if entity["id"].endswith("_foot"):
                normal = loads[entity["id"].removesuffix("_foot")][time]["normal_force_n"]
                # Friction adds to it, at most its 0.8.
                assert normal - 0.2 <= total <= 1.3 * normal + 0.2, (entity["id"], time, total, normal)
            assert all(told[k.replace("force_n", "material")] for k in told if k.endswith("force_n"))
    assert arrows > 100, arrows
    (_, scene), = messages["/scene"]
    ids = {e["id"] for e in scene["entities"]}
    assert "ground" in ids and "robot/chassis" in ids, ids
    print(f"{arrows} arrows, {len(ids)} things in the scene")


def check_parquet(messages, folder, sql):
    """Tables have the values of the log, to the bit; the shipped question runs."""
    rows = 0
    for topic, logged in messages.items():
        if topic in VIEWED:
            continue
        path = folder / (topic.strip("/").replace("/", "-") + ".parquet")
        table = pyarrow.parquet.read_table(path)
        facts = table.schema.metadata
        columns = json.loads(facts[b"wheeleg.columns"])
        assert facts[b"wheeleg.channel"].decode() == topic
        assert [c["name"] for c in columns] == table.column_names
        assert all(c["unit"] and c["meaning"] for c in columns)
        values = table.to_pydict()
        assert values.pop("t_ns") == [time for time, _ in logged], topic
        for name, column in values.items():
            assert column == [message[name] for _, message in logged], f"{topic}.{name}"
        rows += len(logged)
    connection = duckdb.connect()
    connection.execute(f"SET VARIABLE folder = '{folder}'")
    found = 0
    with open(sql, encoding="utf-8") as file:
        for statement in duckdb.extract_statements(file.read()):
            answer = connection.execute(statement).fetchall()
            assert answer and all(v is not None for v in answer[0]), answer
            found += len(answer)
    print(f"{rows} rows equal, {found} answers; pyarrow {pyarrow.__version__}, duckdb {duckdb.__version__}")


def check_ros2(messages, folder, urdf):
    """Two readers of bags decode every message, and find the values of the log."""
    expected = {
        "/clock": len(messages["/tf"]),
        "/joint_states": len(messages["/joint_states"]),
        "/robot_description": 1,
        "/tf": len(messages["/tf"]),
        "/tf_static": 1,
    }
    counts = defaultdict(int)
    states, frames = dict(messages["/joint_states"]), dict(messages["/tf"])

    def compare(topic, time, message):
        counts[topic] += 1
        if topic == "/joint_states":
            joints = states[time]["joints"]
            assert list(message.name) == [j["name"] for j in joints]
            assert list(message.position) == [j["position"] for j in joints]
            assert list(message.velocity) == [j["velocity"] for j in joints]
            assert list(message.effort) == [j.get("effort", 0.0) for j in joints]
            assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == time
        elif topic.startswith("/tf"):
            ours = {t["child_frame_id"]: t for t in frames[time]["transforms"]}
            for t in message.transforms:
                own = ours[t.child_frame_id]
                assert t.header.frame_id == own["parent_frame_id"]
                assert all(getattr(t.transform.translation, k) == own["translation"][k] for k in "xyz")
                assert all(getattr(t.transform.rotation, k) == own["rotation"][k] for k in "xyzw")
        elif topic == "/robot_description":
            assert message.data == urdf
        elif topic == "/clock":
            assert message.clock.sec * 10**9 + message.clock.nanosec == time

    (bag,) = folder.glob("*.mcap")
    with open(bag, "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()], validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        for _, channel, message, decoded in reader.iter_decoded_messages():
            compare(channel.topic, message.log_time, decoded)
    assert counts == expected, counts
    counts.clear()
    with AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        assert {c.topic for c in reader.connections} == expected.keys()
        for connection, time, raw in reader.messages():
            compare(connection.topic, time, reader.deserialize(raw, connection.msgtype))
        still = [t for c, _, raw in reader.messages([c for c in reader.connections if c.topic == "/tf_static"])
                 for t in reader.deserialize(raw, c.msgtype).transforms]
    assert counts == expected, counts
    assert {t.child_frame_id for t in still} == {
        "chassis", "left_crank_end", "left_foot", "right_crank_end", "right_foot"
    }
    print(f"bag: {dict(counts)}; mcap-ros2-support {version('mcap-ros2-support')}, rosbags {version('rosbags')}")


def main(arguments):
    if len(arguments) != 6:
        print(__doc__, file=sys.stderr)
        return 2
    run, urdf, tables, bag, sql = map(Path, arguments[1:])
    messages, schemas, attachments = read(run / "log.mcap")
    text = urdf.read_text(encoding="utf-8")
    assert attachments["robot.urdf"].decode() == text, "the log's robot is not the exported one"
    check_schemas(messages, schemas)
    check_frames(messages, urdf)
    check_contacts(messages)
    levels = {m["level"] for _, m in messages["/log"]}
    assert len(messages["/log"]) == len(messages["/events"]) and 2 in levels, levels
    check_parquet(messages, tables, sql)
    check_ros2(messages, bag, text)
    print(f"mcap {version('mcap')}, foxglove-schemas-protobuf {version('foxglove-schemas-protobuf')}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
