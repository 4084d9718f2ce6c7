#!/usr/bin/env python3
"""Two implementations of SPEC.md must agree, both ways.

    python3 agree.py SPEC.md JUDGE [COUNT]

JUDGE is the Rust crate's example program `judge`. Checked are: the examples
of SPEC.md; frames made here and judged there, sound ones and every kind of
unsound; frames made there, from values, and judged and made again here.
"""

import random
import re
import subprocess
import sys

from bus import INTS, Bus

RNG = random.Random(2003)


def hexed(text):
    return bytes.fromhex(re.sub(r"[^0-9A-Fa-f]", "", text))


def payload(bus, code):
    """A payload of the right size that is sound more often than not."""
    data = b""
    for _, kind, size in bus.fields[code]:
        for _ in range(200):
            part = RNG.randbytes(size)
            if RNG.random() < 0.3:
                part = RNG.choice([b"\0" * size, b"\xff" * size, b"\0" * (size - 1) + b"\1", b"\1" + b"\0" * (size - 1)])
            if kind == "SyncSlots":
                part = b"".join(slot(index) for index in range(8))
            if bus.value(kind, part) is not None:
                break
        data += part
    return data


def slot(index):
    if RNG.random() < 0.3:
        return bytes(10)
    data = bytearray(RNG.randbytes(10))
    data[9] = 1 | RNG.choice([0, 2, 8, 10])
    if index >= 6:
        data[9] &= 0b1001
        data[6:9] = bytes(3)
        data[3] = 0xFF if data[2] & 0x80 else 0
    elif data[8] == 0:
        data[6:8] = bytes(2)
    if RNG.random() < 0.01:
        data[RNG.randrange(10)] ^= 1 << RNG.randrange(8)
    return bytes(data)


def way(bus, code):
    _, kind, _ = bus.types.get(code, ("", "request", 0))
    node = RNG.randint(1, 8)
    if code == 0x01:
        return 0, 255
    return (node, 0) if kind == "answer" or code == 0x02 else (0, node)


def made_here(bus, count):
    """Streams: sound frames of every type first, then everything else."""
    for code in bus.types:
        for _ in range(8):
            yield bus.frame(code, payload(bus, code), *way(bus, code), RNG.randrange(65536))
    codes = list(bus.types)
    for _ in range(count):
        code = RNG.choice(codes)
        data, (source, destination) = payload(bus, code), way(bus, code)
        sequence, options = RNG.randrange(65536), {}
        choice = RNG.randrange(12)
        if choice == 0:
            code = RNG.randrange(256)
        elif choice == 1:
            data = (data + RNG.randbytes(3))[:RNG.randrange(len(data) + 4)]
        elif choice == 2:
            source, destination = RNG.randrange(11), RNG.choice([*range(11), 254, 255])
        elif choice == 3:
            options = {"version": RNG.randrange(4)}
        elif choice == 4:
            options = {"length": RNG.choice([0, len(data) + 1, len(data) ^ 0x100])}
        elif choice == 5:
            options = {"crc_error": 1 << RNG.randrange(32)}
        elif choice in (6, 7) and data:
            # Any value behind a right CRC.
            changed = bytearray(data)
            changed[RNG.randrange(len(data))] = RNG.choice([0, 1, 0x7F, 0x80, 0xFF, RNG.randrange(256)])
            data = bytes(changed)
        elif choice == 8:
            data = RNG.randbytes(RNG.randrange(bus.longest_payload + 4))
        stream = bytearray(bus.frame(code, data, source, destination, sequence, **options))
        if choice == 9:
            for _ in range(RNG.randint(1, 3)):
                stream[RNG.randrange(len(stream))] ^= 1 << RNG.randrange(8)
        elif choice == 10:
            del stream[RNG.randrange(len(stream)):]
            stream += b"\0"
        elif choice == 11:
            stream = RNG.randbytes(RNG.randrange(260)) + stream
        yield bytes(stream)


def encoded_again(bus, verdict):
    """The bytes of a judged message, from its text alone."""
    _, version, source, destination, sequence, text = verdict.split(" ", 5)
    name, _, rest = text.partition(" ")
    code = next(code for code, (known, _, _) in bus.types.items() if known == name)
    data, rest = b"", rest.strip("{ }") + " "
    for field, kind, size in bus.fields[code]:
        start = re.search(rf"(?:^|, ){field}: ", rest).end()
        data += from_text(bus, kind, size, rest[start:])
    return bus.frame(code, data, int(source), int(destination), int(sequence), int(version))


def from_text(bus, kind, size, text):
    if kind == "SyncSlots":
        slots = re.findall(r"Empty|SyncSlot \{[^}]*\}", text)
        made = b""
        for one in slots:
            values = dict(re.findall(r"(\w+): (-?\d+)", one))
            for name, field_kind in bus.slot:
                count, signed = INTS[field_kind]
                made += int(values.get(name, 0)).to_bytes(count, "little", signed=signed)
        return made
    if kind.startswith("["):
        inner, count = re.fullmatch(r"\[(\w+); (\d+)\]", kind).groups()
        numbers = text[text.index("[") + 1:text.index("]")].split(", ")
        assert len(numbers) == int(count)
        step, signed = INTS[inner]
        return b"".join(int(number).to_bytes(step, "little", signed=signed) for number in numbers)
    if kind in bus.enums and kind not in bus.bit_sets:
        word = re.match(r"\w+", text).group(0)
        return bytes([next(number for number, name in bus.enums[kind].items() if name == word)])
    if kind == "FaultCode":
        word = re.match(r"FaultCode\((?:Some\((\w+)\)|None)\)", text).group(1)
        return bytes([next((number for number, name in bus.faults.items() if name == word), 0)])
    number = int(re.search(r"-?\d+", text[re.match(r"[A-Za-z]\w*\(", text).end():]
                           if re.match(r"[A-Za-z]", text) else text).group(0))
    return number.to_bytes(size, "little", signed=number < 0)


def judged_there(judge, streams):
    lines = "".join(stream.hex() + "\n" for stream in streams)
    answer = subprocess.run([judge, "check"], input=lines, capture_output=True, text=True, check=True)
    return answer.stdout.splitlines()


def main():
    spec = open(sys.argv[1], encoding="utf-8").read()
    judge, count = sys.argv[2], int(sys.argv[3]) if len(sys.argv) > 3 else 4000
    bus, wrong, kinds = Bus(spec), [], {}

    examples = re.findall(r"```example\nline  (.*?)\nplain (.*?)\nway   (.*?)\nmeans (.*?)\n```", spec)
    for line, plain, _, means in examples:
        verdict = bus.judge(hexed(line))
        if len(verdict) != 1 or not verdict[0].endswith(means) or encoded_again(bus, verdict[0]) != hexed(line):
            wrong.append(f"example {means}: {verdict}")
    assert len(examples) == len(bus.types), "an example for every type"

    streams = list(made_here(bus, count))
    verdicts = judged_there(judge, streams)
    assert len(verdicts) == len(streams)
    for stream, there in zip(streams, verdicts):
        here = " | ".join(bus.judge(stream))
        for one in bus.judge(stream):
            kind = one.split(" {")[0] if one.startswith("no") else "ok"
            kind += " (message)" if "message_type" in one and kind == "no Length" else ""
            kinds[kind] = kinds.get(kind, 0) + 1
        if here != there:
            wrong.append(f"{stream.hex()}\n   here:  {here}\n   there: {there}")

    made = subprocess.run([judge, "emit", str(count)], capture_output=True, text=True, check=True)
    there_count, types = 0, set()
    for line in made.stdout.splitlines():
        data, _, said = line.partition("\t")
        here = bus.judge(bytes.fromhex(data))
        there_count += 1
        types.add(bytes.fromhex(data)[3])
        if here != [said]:
            wrong.append(f"{data}\n   here:  {here}\n   there: {said}")
        elif encoded_again(bus, said).hex() != data:
            wrong.append(f"{data}\n   encoded here: {encoded_again(bus, said).hex()}")

    print(f"    {len(examples)} examples; {len(streams)} streams made here, judged there; "
          f"{there_count} frames made there, judged and made again here")
    print("    verdicts: " + ", ".join(f"{kind} {number}" for kind, number in sorted(kinds.items())))
    for text in wrong[:5]:
        print("    DISAGREE " + text)
    expected = {"ok", "no Overflow", "no Truncated", "no Short", "no Crc", "no Version", "no Length",
                "no Length (message)", "no Address", "no UnknownType", "no Route", "no Value"}
    missing = expected - set(kinds)
    if missing or there_count < count or wrong:
        sys.exit(f"{len(wrong)} disagreements, verdicts never seen: {sorted(missing)}, {there_count} frames made there")


main()
