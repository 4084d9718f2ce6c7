"""The checker of logs must accept a good log and refuse each kind of broken one."""

import json
import tempfile
import unittest
from pathlib import Path

from mcap.writer import Writer

import check_mcap

GOOD_SCHEMA = {
    "type": "object",
    "properties": {
        "position_mm": {"type": "number", "unit": "mm"},
        "mode": {"type": "string", "unit": "1"},
    },
}
GOOD = {"position_mm": 1.5, "mode": "hold"}


class CheckMcap(unittest.TestCase):
    """Each test writes one log and looks at the defects found."""

    def defects(self, *, topic="/joint/1", name="joint", encoding="jsonschema", schema=None, message_encoding="json",
                messages=((0, GOOD), (10, GOOD)), metadata=None, raw=None, cut=0):
        """Defects of a log that is good but for the arguments."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "log.mcap"
            with open(path, "wb") as stream:
                writer = Writer(stream)
                writer.start()
                schema_id = writer.register_schema(name, encoding, json.dumps(schema or GOOD_SCHEMA).encode())
                channel_id = writer.register_channel(topic, message_encoding, schema_id, metadata or {})
                for time, value in messages:
                    data = raw if raw is not None else json.dumps(value).encode()
                    writer.add_message(channel_id, time, data, time)
                writer.finish()
            if cut:
                path.write_bytes(path.read_bytes()[:-cut])
            return check_mcap.check(path)[0]

    def refused(self, text, **change):
        """The log is refused, for the reason meant."""
        found = self.defects(**change)
        self.assertTrue(any(text in line for line in found), found)

    def test_good(self):
        self.assertEqual(self.defects(), [])

    def test_units_agree(self):
        self.assertEqual(self.defects(metadata={"unit.position_mm": "mm"}), [])
        self.refused("another in the metadata", metadata={"unit.position_mm": "m"})

    def test_foreign(self):
        schema = {
            "type": "object",
            "properties": {"level": {"oneOf": [{"const": 2}, {"const": 4}]}},
            "required": ["level"],
        }
        log = {"name": "foxglove.Log", "schema": schema}
        self.assertEqual(self.defects(messages=((0, {"level": 2}),), **log), [])
        self.refused("level", messages=((0, {"level": 3}),), **log)
        self.refused("required", messages=((0, {}),), **log)

    def test_description(self):
        self.refused("no topic", topic=" ")
        self.refused("schema without a name", name="")
        self.refused("schema encoding", encoding="protobuf")
        self.refused("message encoding", message_encoding="cbor")
        self.refused("without properties", schema={"type": "object"})
        blank = {"type": "object", "properties": {**GOOD_SCHEMA["properties"], "mode": {"type": "string", "unit": " "}}}
        self.refused("mode: no unit", schema=blank)

    def test_messages(self):
        self.refused("no message", messages=())
        self.refused("no message", messages=(), metadata={"written": "always", "rate_hz": "on change"})
        for written in ("on change", "in walks", "live"):
            self.assertEqual(self.defects(messages=(), metadata={"written": written}), [])
        self.refused("not JSON", raw=b"{")
        self.refused("not an object", raw=b"[1]")
        self.refused("fields differ", messages=((0, {"position_mm": 1.0}),))
        self.refused("fields differ", messages=((0, {**GOOD, "more": 1}),))
        self.refused("is no number", messages=((0, {**GOOD, "position_mm": "1.5"}),))
        self.refused("is no number", raw=b'{"position_mm": NaN, "mode": "hold"}')
        self.refused("is no number", raw=b'{"position_mm": true, "mode": "hold"}')

    def test_time(self):
        self.refused("runs backwards", messages=((10, GOOD), (9, GOOD)))
        self.assertEqual(self.defects(messages=((10, GOOD), (10, GOOD))), [])

    def test_torn_file(self):
        self.assertNotEqual(self.defects(cut=40), [])


if __name__ == "__main__":
    unittest.main()
