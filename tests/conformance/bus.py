"""The board bus a second time, with SPEC.md as the only source.

The tables of SPEC.md (limits, addresses, message types, fields, slot,
enumerations, faults) are read from the document itself; what its sentences say
(COBS, CRC, order of the checks, ranges of the few checked types) is written
here. Nothing is shared with the Rust crate.
"""

import re
import struct

INTS = {"u8": (1, False), "i8": (1, True), "u16": (2, False), "i16": (2, True), "u32": (4, False),
        "i32": (4, True), "u64": (8, False)}
# Checked numbers: bytes on the wire, signed, smallest, largest, how the examples write them.
CHECKED = {"Count24": (4, True, -2**23, 2**23 - 1, "Count24(WheelCount({}))"),
           "Speed7": (1, False, 0, 127, "Speed7({})"),
           "Acceleration8p8": (2, False, 0, 0x7FFF, "Acceleration8p8({})")}
# Sets of bits that may all be set: their bits are numbered by the tables of faults and limits.
OPEN_BITS = ("FaultBits", "LimitBits")


class Reject(Exception):
    """Why bytes are no message; the text is that of the vectors."""


def table(text, name):
    """Rows of the table between `<!-- begin NAME -->` and `<!-- end NAME -->`."""
    return rows(re.search(rf"<!-- begin {name} -->(.*?)<!-- end {name} -->", text, re.S).group(1))


def rows(text):
    found = [[cell.strip() for cell in line.strip().strip("|").split(" | ")]
             for line in text.splitlines() if line.startswith("| ")]
    return [[cell.strip("` |") for cell in row] for row in found[1:] if not set(row[0]) <= set("-|")]


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def cobs(data):
    return b"".join(bytes([len(block) + 1]) + block for block in bytes(data).split(b"\0"))


class Bus:
    """Encoder and decoder of the interface that a SPEC.md describes."""

    def __init__(self, spec):
        limits = dict(row[:2] for row in table(spec, "limits"))
        self.version = int(limits["protocol version"])
        self.longest = int(limits["longest decoded frame"].split()[0])
        self.longest_payload = int(limits["longest payload"].split()[0])
        self.addresses = {int(row[0]): row[1] for row in table(spec, "addresses")}
        self.types = {int(row[0], 16): (row[1], row[2], int(row[3])) for row in table(spec, "types")}
        self.slot = [(row[2], row[3]) for row in table(spec, "slot")]
        self.faults = {int(row[0]): row[2] for row in table(spec, "faults")}
        self.enums = {}
        part = re.search(r"<!-- begin enums -->(.*?)<!-- end enums -->", spec, re.S).group(1)
        for section in part.split("### ")[1:]:
            name, _, body = section.partition("\n")
            self.enums[name.strip()] = {int(row[0]): row[1] for row in rows(body)}
        sentence = re.search(r"Of bit sets \(([^)]*)\)", " ".join(spec.split())).group(1)
        self.bit_sets = [name.strip() for name in sentence.split(",")]
        self.any_version = [code for code, (name, _, _) in self.types.items()
                            if name in ("Identify", "Identity", "Nack")]
        self.fields = {code: self.fields_of(spec, name) for code, (name, _, _) in self.types.items()}
        for code, (name, _, size) in self.types.items():
            assert size == sum(self.size(kind, count) for _, kind, count in self.fields[code]), name

    def fields_of(self, spec, name):
        body = re.search(rf"^### {name} \(0x.*?$(.*?)(?=^### |^<!-- end messages)", spec, re.S | re.M).group(1)
        body = body.split("```")[0]
        return [(row[2], row[3], int(row[1])) for row in rows(body)] if "| field |" in body else []

    def size(self, kind, stated=None):
        """Bytes of a type; the table must state the same."""
        array = re.fullmatch(r"\[(\w+); (\d+)\]", kind)
        if array:
            size = self.size(array[1]) * int(array[2])
        elif kind in INTS:
            size = INTS[kind][0]
        elif kind in CHECKED:
            size = CHECKED[kind][0]
        elif kind == "SyncSlots":
            size = 8 * sum(INTS[field][0] for _, field in self.slot)
        elif kind in OPEN_BITS:
            size = stated
        elif kind in self.enums or kind in ("Address", "FaultCode"):
            size = 1
        else:
            raise AssertionError(f"SPEC.md does not say what {kind} is")
        assert stated in (None, size), (kind, stated, size)
        return size

    # Frames.

    def frame(self, code, payload, source, destination, sequence, version=None, length=None, crc_error=0):
        version = self.version if version is None else version
        length = len(payload) if length is None else length
        body = struct.pack("<BBBBHH", version, code, source, destination, sequence, length) + payload
        return b"\0" + cobs(body + struct.pack("<I", crc32c(body) ^ crc_error)) + b"\0"

    def judge(self, stream):
        """What a receiver makes of a stream: one text for each stretch between delimiters."""
        return [self.verdict(stretch) for stretch in stream.split(b"\0")[:-1] if stretch]

    def verdict(self, stretch):
        try:
            version, code, source, destination, sequence, payload = self.unframe(stretch)
            text = self.decode(code, source, destination, payload)
            return f"ok {version} {source} {destination} {sequence} {text}"
        except Reject as reason:
            return f"no {reason}"

    def unframe(self, stretch):
        data, at, truncated = b"", 0, False
        while at < len(stretch):
            block = stretch[at + 1:at + stretch[at]]
            truncated = len(block) < stretch[at] - 1
            data += (b"\0" if at else b"") + block
            at += stretch[at]
        if len(data) > self.longest:
            raise Reject("Overflow")
        if truncated:
            raise Reject("Truncated")
        if len(data) < 12:
            raise Reject("Short")
        body, crc = data[:-4], data[-4:]
        if struct.pack("<I", crc32c(body)) != crc:
            raise Reject("Crc")
        version, code, source, destination, sequence, length = struct.unpack("<BBBBHH", body[:8])
        if version != self.version and code not in self.any_version:
            raise Reject(f"Version {{ found: {version} }}")
        if length != len(body) - 8:
            raise Reject("Length")
        if source not in self.addresses or destination not in self.addresses \
                or self.addresses[source] == "broadcast":
            raise Reject("Address")
        return version, code, source, destination, sequence, body[8:]

    # Messages.

    def may_go(self, name, kind, source, destination):
        who = self.addresses
        node = lambda address: who[address] not in ("master", "broadcast")
        if name == "Sync":
            return who[source] == "master" and who[destination] == "broadcast"
        if kind == "answer" or name == "SlotReply":
            return node(source) and who[destination] == "master"
        return who[source] == "master" and node(destination)

    def decode(self, code, source, destination, payload):
        """Text of a message; type, size, way and values are looked at in this order."""
        if code not in self.types:
            raise Reject(f"UnknownType {{ code: {code} }}")
        name, kind, size = self.types[code]
        if len(payload) != size:
            raise Reject(f"Length {{ message_type: {name}, found: {len(payload)} }}")
        if not self.may_go(name, kind, source, destination):
            raise Reject(f"Route {{ message_type: {name} }}")
        texts, at = [], 0
        for field, field_kind, count in self.fields[code]:
            text = self.value(field_kind, payload[at:at + count])
            if text is None:
                raise Reject(f"Value {{ message_type: {name} }}")
            texts.append(f"{field}: {text}")
            at += count
        return f"{name} {{ {', '.join(texts)} }}" if texts else name

    def value(self, kind, data):
        """Text of a value, or None if it is outside its range."""
        array = re.fullmatch(r"\[(\w+); (\d+)\]", kind)
        if array:
            step = self.size(array[1])
            parts = [self.value(array[1], data[at:at + step]) for at in range(0, len(data), step)]
            return None if None in parts else f"[{', '.join(parts)}]"
        if kind in INTS:
            return str(int.from_bytes(data, "little", signed=INTS[kind][1]))
        if kind == "SyncSlots":
            slots = [self.slot_text(index, data[10 * index:10 * index + 10]) for index in range(8)]
            return None if None in slots else f"SyncSlots([{', '.join(slots)}])"
        number = int.from_bytes(data, "little")
        if kind in CHECKED:
            _, signed, low, high, text = CHECKED[kind]
            number = int.from_bytes(data, "little", signed=signed)
            return text.format(number) if low <= number <= high else None
        if kind in OPEN_BITS:
            return f"{kind}({number})"
        if kind == "Address":
            return f"Address({number})" if number in self.addresses else None
        if kind == "FaultCode":
            if number == 0:
                return "FaultCode(None)"
            return f"FaultCode(Some({self.faults[number]}))" if number in self.faults else None
        if kind in self.bit_sets:
            known = sum(1 << bit for bit in self.enums[kind])
            return f"{kind}({number})" if number & ~known == 0 else None
        return self.enums[kind].get(number)

    def slot_text(self, index, data):
        values, at = {}, 0
        for name, kind in self.slot:
            size, signed = INTS[kind]
            values[name] = int.from_bytes(data[at:at + size], "little", signed=signed)
            at += size
        flags = values["flags"]
        if not flags & 1:
            return "Empty" if not any(data) else None
        action, others = flags >> 1 & 3, flags & ~0b1111
        if others or action not in self.enums["LinkLossAction"]:
            return None
        if values["cycles_to_next"] == 0 and values["next_reference"] != 0:
            return None
        if index >= 6 and (values["next_reference"] or values["cycles_to_next"] or action
                           or not -2**23 <= values["reference"] < 2**23):
            return None
        return "SyncSlot { %s }" % ", ".join(f"{name}: {value}" for name, value in values.items())
