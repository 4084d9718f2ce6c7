#!/usr/bin/env python3
"""Writes frames.json: conformance vectors of the board bus.

A second implementation of SPEC.md in another language, written from the
specification alone: bit-wise CRC-32C, COBS by searching zeros, struct.pack.
Nothing is shared with the Rust crate. Run it in this folder to write the
file anew; the Rust test decodes and encodes every vector.

    python3 make_vectors.py > frames.json
"""

import json
import random
import struct

RNG = random.Random(2003)
MASTER, BROADCAST = 0, 255


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


assert crc32c(b"123456789") == 0xE3069283


def cobs(data):
    out = bytearray()
    for block in bytes(data).split(b"\0"):
        assert len(block) < 254
        out.append(len(block) + 1)
        out += block
    return bytes(out)


def seal(body):
    """Adds CRC, COBS and delimiters to header and payload."""
    return b"\0" + cobs(body + struct.pack("<I", crc32c(body))) + b"\0"


def frame(kind, payload, source, destination, sequence, version=1, length=None):
    length = len(payload) if length is None else length
    head = struct.pack("<BBBBHH", version, kind, source, destination, sequence, length)
    return seal(head + payload)


ENUMS = {
    "NodeMode": {0: "Boot", 1: "Idle", 2: "Armed", 3: "Tracking", 4: "Hold", 5: "Exhaust", 6: "Fault"},
    "BoardKind": {1: "Joint", 2: "Wheel"},
    "OpenMode": {0: "Exhaust", 1: "BlowThrough"},
    "Correction": {0: "Pd", 1: "Id"},
    "WheelControlMode": {0: "Idle", 1: "Position", 2: "ProportionalVelocity", 3: "Trapezoidal", 4: "IntegralVelocity"},
    "DisarmReason": {0: "None", 1: "Reset", 2: "Command", 3: "LinkLost", 4: "Fault", 5: "EmergencyStop",
                     6: "EmergencyBrake", 7: "OpenAllValves"},
    "NackReason": {1: "UnknownMessage", 2: "BadLength", 3: "OutOfRange", 4: "Busy", 5: "WrongMode", 6: "NotArmed",
                   7: "Armed", 8: "Duplicate", 9: "Expired", 10: "UnknownParameter", 11: "ReadOnly",
                   12: "VersionMismatch", 13: "FaultLatched", 14: "WrongBoard", 15: "LinkDown", 16: "NotReady",
                   17: "StoreFailed"},
    "ResetCause": {0: "Unknown", 1: "PowerUp", 2: "Watchdog", 3: "BrownOut", 4: "ProcessorFault", 5: "Panic",
                   6: "ClockLoss", 7: "Software", 8: "Pin", 9: "OptionBytes"},
}
FAULTS = {1: "LinkLost", 2: "StaleMaster", 3: "SlotOverrun", 32: "SensorRange",
          33: "SensorRate", 34: "FollowingError", 35: "TickOverrun", 36: "ParameterCorrupt", 37: "StateCorrupt",
          38: "SupplyLost", 39: "EmergencyStop", 40: "OverTravel", 41: "EncoderFault", 42: "UnexpectedReset",
          43: "DuplicateAddress", 44: "NoMotion"}
INTS = {"u8": ("B", 0, 2**8 - 1), "u16": ("<H", 0, 2**16 - 1), "u32": ("<I", 0, 2**32 - 1),
        "u64": ("<Q", 0, 2**64 - 1), "i16": ("<h", -2**15, 2**15 - 1), "i32": ("<i", -2**31, 2**31 - 1)}
# Checked numbers: wire integer, range, text.
CHECKED = {"Count24": ("i32", -2**23, 2**23 - 1, "Count24(WheelCount({}))"),
           "Speed7": ("u8", 0, 127, "Speed7({})"),
           "Acceleration8p8": ("u16", 0, 0x7FFF, "Acceleration8p8({})"),
           "SyncFlags": ("u8", 0, 1, "SyncFlags({})"),
           "InputBits": ("u8", 0, 63, "InputBits({})"),
           "LimitBits": ("u8", 0, 255, "LimitBits({})"),
           "FaultBits": ("u16", 0, 65535, "FaultBits({})")}
ADDRESSES = list(range(9)) + [255]


def integer(kind, pick):
    _, low, high = INTS[kind]
    return value_in(low, high, pick)


def value_in(low, high, pick):
    if pick == "low":
        return low
    if pick == "high":
        return high
    if RNG.random() < 0.3:
        return RNG.choice([v for v in (low, high, 0, 1, -1, 255, 256) if low <= v <= high])
    return RNG.randint(low, high)


def slot(index, pick):
    """Reference, velocity, next reference, cycles to it, flags."""
    if pick == "low" or (pick == "any" and RNG.random() < 0.25):
        return (0, 0, 0, 0, 0)
    track = 8 * (1 if pick == "high" else RNG.randint(0, 1))
    velocity = integer("i16", pick)
    if index >= 6:
        return (value_in(-2**23, 2**23 - 1, pick), velocity, 0, 0, 1 | track)
    cycles = value_in(0, 255, pick)
    following = integer("i16", pick) if cycles else 0
    action = 1 if pick == "high" else RNG.randint(0, 1)
    return (integer("i32", pick), velocity, following, cycles, 1 | action << 1 | track)


def choose(kind, pick):
    """A value of this kind: the lowest, the highest, or any."""
    def one_of(values):
        return values[0] if pick == "low" else values[-1] if pick == "high" else RNG.choice(values)

    if kind in INTS:
        return integer(kind, pick)
    if kind in CHECKED:
        return value_in(CHECKED[kind][1], CHECKED[kind][2], pick)
    if kind in ENUMS:
        return one_of(sorted(ENUMS[kind]))
    if kind == "Address":
        return one_of(ADDRESSES)
    if kind == "FaultCode":
        return one_of([0, *sorted(FAULTS)])
    if kind == "SyncSlots":
        return [slot(i, pick) for i in range(8)]
    count = int(kind.removeprefix("bytes"))
    return [{"low": 0, "high": 255}.get(pick, RNG.randrange(256)) for _ in range(count)]


def render(kind, value):
    """Bytes and text of a value."""
    if kind in INTS:
        return struct.pack(INTS[kind][0], value), str(value)
    if kind in CHECKED:
        wire, low, high, text = CHECKED[kind]
        assert low <= value <= high
        return struct.pack(INTS[wire][0], value), text.format(value)
    if kind in ENUMS:
        return bytes([value]), ENUMS[kind][value]
    if kind == "Address":
        return bytes([value]), f"Address({value})"
    if kind == "FaultCode":
        return bytes([value]), f"FaultCode(Some({FAULTS[value]}))" if value else "FaultCode(None)"
    if kind == "SyncSlots":
        names = ("reference", "velocity", "next_reference", "cycles_to_next", "flags")
        texts = ["SyncSlot { %s }" % ", ".join(f"{n}: {v}" for n, v in zip(names, s)) if s[4] & 1 else "Empty"
                 for s in value]
        return b"".join(struct.pack("<ihhBB", *s) for s in value), "SyncSlots([%s])" % ", ".join(texts)
    return bytes(value), "[%s]" % ", ".join(map(str, value))


DEADLINE = ("deadline_cycle", "u16")
MESSAGES = {
    0x01: ("Sync", [("cycle", "u16"), ("master_time_us", "u32"), ("flags", "SyncFlags"), ("slots", "SyncSlots")]),
    0x02: ("SlotReply", [("position_raw", "i32"), ("velocity_raw", "i16"), ("effort_raw", "i16"),
                         ("active_faults", "FaultBits"), ("mode", "NodeMode"), ("limits", "LimitBits"),
                         ("inputs", "InputBits"), ("sync_echo", "u8")]),
    0x10: ("Identify", []),
    0x11: ("Arm", [("schema_hash", "u64")]),
    0x12: ("Disarm", []),
    0x13: ("ClearFault", []),
    0x14: ("FaultReport", []),
    0x15: ("EmergencyBrake", []),
    0x16: ("TransmitPosition", []),
    0x17: ("Discover", []),
    0x18: ("LinkReport", []),
    0x19: ("LogRead", [("lease_ms", "u16")]),
    0x20: ("PositionReference", [("reference_raw", "i32"), DEADLINE]),
    0x21: ("OpenAllValves", [("mode", "OpenMode")]),
    0x22: ("SelectCorrection", [("correction", "Correction")]),
    0x30: ("WheelReference", [("position", "Count24"), DEADLINE]),
    0x31: ("WheelVelocity", [("velocity_raw", "i16"), DEADLINE]),
    0x32: ("WheelMaxSpeed", [("speed", "Speed7")]),
    0x33: ("WheelAcceleration", [("acceleration", "Acceleration8p8")]),
    0x34: ("WheelFilter", [("zero", "u8"), ("pole", "u8"), ("gain", "u8")]),
    0x35: ("WheelSampleTimer", [("timer", "u8")]),
    0x36: ("WheelMode", [("mode", "WheelControlMode")]),
    0x40: ("ParamGet", [("id", "u16")]),
    0x41: ("ParamSet", [("id", "u16"), ("value", "i32")]),
    0x42: ("ParamSave", []),
    0x80: ("Ack", [("request", "u8")]),
    0x81: ("Nack", [("request", "u8"), ("reason", "NackReason")]),
    0x82: ("Identity", [("board", "BoardKind"), ("address", "Address"), ("firmware", "bytes3"),
                        ("schema_hash", "u64"), ("unique_id", "bytes12")]),
    0x83: ("Position", [("position_raw", "i32"), ("velocity_raw", "i16"), ("cycle", "u16"), ("age_us", "u16")]),
    0x84: ("ParamValue", [("id", "u16"), ("value", "i32")]),
    0x85: ("FaultRecord", [("active", "FaultBits"), ("sticky", "FaultBits"), ("first_fault", "FaultCode"),
                           ("first_time_us", "u32"), ("disarm_reason", "DisarmReason"), ("limits", "LimitBits"),
                           ("reset_cause", "ResetCause"), ("clock_offset_us", "u32")]),
    0x86: ("LinkRecord", [("frames", "u32"), ("overflow", "u16"), ("truncated", "u16"), ("short", "u16"),
                          ("crc", "u16"), ("version", "u16"), ("length", "u16"), ("address", "u16"),
                          ("unsent", "u16"), ("drift_ppm", "i16"), ("parameters", "u32")]),
    0x87: ("LogRecords", [("lost", "u16"), ("left", "u8"), ("entries", "bytes32")]),
}


MM = 65536  # raw I16F16 per millimetre
# The worked examples of SPEC.md.
EXAMPLES = {
    # Joint 3 at 90 mm, next reference 120 mm in 7 cycles, exhaust allowed, track; joint 6 holds 12.5 mm;
    # wheel 7 at 66 000 counts with 34 counts per sample.
    0x01: [300, 3_000_000, 0, [(0, 0, 0, 0, 0), (0, 0, 0, 0, 0), (90 * MM, 0, 120 * 64, 7, 1 | 1 << 1 | 8),
                               (0, 0, 0, 0, 0), (0, 0, 0, 0, 0), (12 * MM + MM // 2, -160, 0, 0, 1 | 8),
                               (66_000, 34 * 16, 0, 0, 1 | 8), (0, 0, 0, 0, 0)]],
    # 89.75 mm, -20 mm/s, duty 0.25, tracking, duty saturated, front and rear foot switch.
    0x02: [89 * MM + 3 * MM // 4, -320, 4096, 0, 3, 1, 5, 300 % 256],
    0x11: [0x0123456789ABCDEF],
    0x19: [2_000],
    0x20: [90 * MM, 305],
    0x21: [0],
    0x22: [1],
    0x30: [-8_388_608, 305],
    0x31: [34 * 16, 305],
    0x32: [60],
    0x33: [16],
    0x34: [229, 64, 64],
    0x35: [64],
    0x36: [3],
    0x40: [0x0101],
    0x41: [0x0101, 335_544],
    0x80: [0x12],
    0x81: [0x11, 13],
    0x82: [1, 3, [0, 1, 0], 0x0123456789ABCDEF, list(range(0x30, 0x3C))],
    0x83: [89 * MM + 3 * MM // 4, -320, 300, 1_250],
    0x84: [0x0101, 335_544],
    0x85: [1 | 1 << 4, 1 | 1 << 4, 32, 4_200_000, 4, 0, 1, 4_294_000_000],
    # Two lost bytes and a flipped bit among 12 000 frames; the clock is 35 ppm slow.
    0x86: [12_000, 0, 2, 0, 1, 0, 0, 0, 0, -35, 0x9E3779B1],
    # From Armed to Tracking, then a fault.
    0x87: [0, 0, [64, 66, 15, 0, 1, 2, 3, 0, 128, 132, 30, 0, 2, 44, 3, 0] + [0] * 16],
}


def message(kind, pick):
    name, fields = MESSAGES[kind]
    values = EXAMPLES.get(kind, []) if pick == "example" else [choose(k, pick) for _, k in fields]
    assert len(values) == len(fields)
    made = [(field, *render(field_kind, value)) for (field, field_kind), value in zip(fields, values)]
    text = "%s { %s }" % (name, ", ".join(f"{f}: {t}" for f, _, t in made)) if made else name
    return b"".join(b for _, b, _ in made), text


def addresses(kind):
    node = RNG.randint(1, 8)
    if kind == 0x01:
        return MASTER, BROADCAST, 0
    if kind == 0x02:
        return node, MASTER, 0
    if kind >= 0x80:
        return node, MASTER, RNG.randrange(65536)
    low, high = (1, 6) if 0x20 <= kind < 0x30 else (7, 8) if 0x30 <= kind < 0x40 else (1, 8)
    return MASTER, RNG.randint(low, high), RNG.randrange(65536)


def accepted():
    for pick in ["example", "low", "high"] + ["any"] * 5:
        for kind in MESSAGES:
            payload, text = message(kind, pick)
            source, destination, sequence = addresses(kind)
            yield {"hex": frame(kind, payload, source, destination, sequence).hex(), "version": 1, "type": kind,
                   "source": source, "destination": destination, "sequence": sequence, "text": text}
    # Messages that keep their layout in every version.
    for kind in (0x10, 0x81, 0x82):
        for version in (0, 2, 255):
            payload, text = message(kind, "any")
            source, destination, sequence = addresses(kind)
            yield {"hex": frame(kind, payload, source, destination, sequence, version).hex(), "version": version,
                   "type": kind, "source": source, "destination": destination, "sequence": sequence, "text": text}


def rejected():
    def bad(why, data, what):
        return {"hex": data.hex(), "reason": why, "what": what}

    def value(kind, payload, what):
        return bad(f"Value {{ message_type: {MESSAGES[kind][0]} }}", frame(kind, payload, *addresses(kind)), what)

    for kind in MESSAGES:
        payload, _ = message(kind, "any")
        source, destination, sequence = addresses(kind)
        good = frame(kind, payload, source, destination, sequence)
        head = struct.pack("<BBBBHH", 1, kind, source, destination, sequence, len(payload))
        body = head + payload
        name = MESSAGES[kind][0]
        broken = bytearray(body + struct.pack("<I", crc32c(body)))
        broken[RNG.randrange(len(broken))] ^= 1 << RNG.randrange(8)
        yield bad("Crc", b"\0" + cobs(broken) + b"\0", "one bit of the decoded frame inverted")
        yield bad("Truncated", b"\0" + cobs(body + b"\x01\x02\x03\x04")[:-2] + b"\0", "last two bytes lost")
        for length in (len(payload) + 1, len(payload) ^ 0x100):
            yield bad("Length", frame(kind, payload, source, destination, sequence, length=length),
                      "length field changed, CRC right for it")
        yield bad(f"Length {{ message_type: {name}, found: {len(payload) + 1} }}",
                  frame(kind, payload + b"\0", source, destination, sequence), "one byte too many, all else right")
        if kind not in (0x10, 0x81, 0x82):
            yield bad("Version { found: 2 }", frame(kind, payload, source, destination, sequence, 2), "next version")
        assert good[0] == good[-1] == 0
    for source, destination in ((9, 0), (255, 0), (0, 9), (0, 254), (128, 1)):
        yield bad("Address", frame(0x10, b"", source, destination, 1), "address that does not exist as such")
    for kind, ways in {0x01: ((0, 1), (1, 255), (3, 0)), 0x02: ((0, 0), (0, 1), (2, 3), (2, 255)),
                       0x11: ((1, 2), (0, 255), (0, 0), (3, 0)), 0x80: ((0, 1), (0, 0), (1, 2), (1, 255))}.items():
        for way in ways:
            yield bad(f"Route {{ message_type: {MESSAGES[kind][0]} }}", frame(kind, message(kind, "any")[0], *way, 1),
                      "a way this message may not go")
    for kind in (0x00, 0x03, 0x1A, 0x7F, 0x88, 0xFF):
        yield bad(f"UnknownType {{ code: {kind} }}", frame(kind, b"\1\2", 0, 1, 1), "unassigned message type")
    yield bad("Short", b"\0" + cobs(b"123") + b"\0", "three bytes")
    yield bad("Short", b"\0" + cobs(bytes(range(11))) + b"\0", "eleven bytes")
    yield bad("Overflow", b"\0" + cobs(bytes([7] * 198)) + b"\0", "one byte more than a frame can have")
    yield bad("Overflow", b"\0" + cobs(bytes(198)) + b"\0", "one byte more, all zeros")
    yield bad("Overflow", b"\0" + bytes([255] * 300) + b"\0", "300 bytes without a delimiter")

    def sync(header, index, **fields):
        s = [(0, 0, 0, 0, 0)] * 8
        names = ("reference", "velocity", "following", "cycles", "flags")
        s[index] = tuple(fields.get(n, 0) for n in names)
        return struct.pack("<HIB", 5, 6, header) + b"".join(struct.pack("<ihhBB", *one) for one in s)

    yield value(0x01, sync(2, 0), "reserved header bit")
    yield value(0x01, sync(0x80, 0), "reserved header bit")
    yield value(0x01, sync(0, 0, flags=0x10 | 1), "reserved slot bit")
    yield value(0x01, sync(0, 5, flags=1 | 2 << 1), "reserved link-loss action 2")
    yield value(0x01, sync(0, 5, flags=1 | 3 << 1), "reserved link-loss action 3")
    yield value(0x01, sync(0, 2, reference=1), "empty slot with a reference")
    yield value(0x01, sync(0, 2, flags=8), "empty slot with the track bit")
    yield value(0x01, sync(0, 2, following=5, flags=1), "next reference without its time")
    yield value(0x01, sync(0, 6, reference=2**23, flags=1), "wheel reference beyond 24 bits")
    yield value(0x01, sync(0, 7, reference=-2**23 - 1, flags=1), "wheel reference beyond 24 bits")
    yield value(0x01, sync(0, 7, cycles=1, flags=1), "next reference for a wheel")
    yield value(0x01, sync(0, 6, flags=3), "link-loss action of a joint for a wheel")
    reply = struct.pack("<ihhH", 1, 2, 3, 4)
    yield value(0x02, reply + bytes([7, 0, 0, 0]), "mode 7")
    yield value(0x02, reply + bytes([1, 0, 64, 0]), "reserved input bit")
    yield value(0x21, b"\2", "open mode 2")
    yield value(0x22, b"\2", "correction 2")
    yield value(0x30, struct.pack("<iH", 2**23, 0), "beyond 24 bits")
    yield value(0x30, struct.pack("<iH", -2**31, 0), "beyond 24 bits")
    yield value(0x32, b"\x80", "speed 128")
    yield value(0x33, b"\x00\x80", "acceleration 128")
    yield value(0x36, b"\5", "wheel mode 5")
    yield value(0x81, b"\x10\x00", "nack reason 0")
    yield value(0x81, b"\x10\x12", "nack reason 18")
    yield value(0x82, bytes([3, 1]) + bytes(23), "board kind 3")
    yield value(0x82, bytes([1, 9]) + bytes(23), "address 9")
    yield value(0x85, struct.pack("<HHBIBBBI", 0, 0, 5, 0, 0, 0, 0, 0), "fault number 5")
    yield value(0x85, struct.pack("<HHBIBBBI", 0, 0, 96, 0, 0, 0, 0, 0), "a limit as first fault")
    yield value(0x85, struct.pack("<HHBIBBBI", 0, 0, 0, 0, 8, 0, 0, 0), "disarm reason 8")
    yield value(0x85, struct.pack("<HHBIBBBI", 0, 0, 0, 0, 0, 0, 10, 0), "reset cause 10")


print(json.dumps({"source": "make_vectors.py", "accepted": list(accepted()), "rejected": list(rejected())}, indent=1))
