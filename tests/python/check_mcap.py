"""Check the MCAP log of a run with the Python reader.

    check_mcap.py RUN_DIR

Every channel must have a topic, a schema (name, encoding `jsonschema`, one
property per field, each with a type and a unit) and at least one message; only a
channel whose metadata say that it is not `written` always may be empty.
Every message must be JSON that fits its schema, and the time of a channel must
never run backwards. A channel whose schema is one of Foxglove's has no units; its
messages are held against that schema with all that it says. Ends with 0 if all of that holds, with 1 and one line per defect if
not, with 2 if there is no log to check.
"""

import json
import math
import sys
from pathlib import Path

import jsonschema
from mcap.exceptions import McapError
from mcap.reader import make_reader

# Defects shown per log; a broken writer makes the same one a thousand times.
SHOWN = 40

# Schemas that others publish.
FOREIGN = "foxglove."

JSON_TYPES = {
    "number": lambda v: isinstance(v, (int, float)) and not isinstance(v, bool) and math.isfinite(v),
    "integer": lambda v: isinstance(v, int) and not isinstance(v, bool),
    "boolean": lambda v: isinstance(v, bool),
    "string": lambda v: isinstance(v, str),
    "array": lambda v: isinstance(v, list),
    "object": lambda v: isinstance(v, dict),
    "null": lambda v: v is None,
}


def check_schema(channel, schema, defect):
    """Check the description of one channel; return its properties (empty if unusable)."""
    topic = channel.topic
    if not topic.strip():
        defect(f"channel {channel.id}: no topic")
    if channel.message_encoding != "json":
        defect(f"{topic}: message encoding {channel.message_encoding!r}, not 'json'")
    if schema is None:
        defect(f"{topic}: no schema")
        return {}
    if not schema.name.strip():
        defect(f"{topic}: schema without a name")
    if schema.encoding != "jsonschema":
        defect(f"{topic}: schema encoding {schema.encoding!r}, not 'jsonschema'")
        return {}
    try:
        root = json.loads(schema.data)
    except ValueError as error:
        defect(f"{topic}: schema is not JSON: {error}")
        return {}
    properties = root.get("properties") if isinstance(root, dict) else None
    if not isinstance(properties, dict) or not properties:
        defect(f"{topic}: schema without properties")
        return {}
    if root.get("type") != "object":
        defect(f"{topic}: schema type {root.get('type')!r}, not 'object'")
    if schema.name.startswith(FOREIGN):
        return {}
    for name, field in properties.items():
        unit = field.get("unit")
        if not isinstance(unit, str) or not unit.strip():
            defect(f"{topic}.{name}: no unit")
        elif channel.metadata.get(f"unit.{name}", unit) != unit:
            defect(f"{topic}.{name}: unit {unit!r} in the schema, another in the metadata")
        kinds = field.get("type")
        kinds = kinds if isinstance(kinds, list) else [kinds]
        if not all(kind in JSON_TYPES for kind in kinds):
            defect(f"{topic}.{name}: type {field.get('type')!r}")
    return properties


def check_message(topic, properties, data, defect):
    """Check one message against its schema."""
    try:
        value = json.loads(data)
    except ValueError as error:
        defect(f"{topic}: message is not JSON: {error}")
        return
    if not isinstance(value, dict):
        defect(f"{topic}: message is not an object")
        return
    if value.keys() != properties.keys():
        odd = sorted(value.keys() ^ properties.keys())
        defect(f"{topic}: fields differ from the schema: {', '.join(odd)}")
        return
    for name, field in properties.items():
        kinds = field.get("type")
        kinds = kinds if isinstance(kinds, list) else [kinds]
        if not any(JSON_TYPES.get(kind, lambda _: False)(value[name]) for kind in kinds):
            defect(f"{topic}.{name}: {value[name]!r} is no {field.get('type')}")


def check_foreign(topic, validator, data, defect):
    """Check one message against a schema that others publish."""
    try:
        value = json.loads(data)
    except ValueError as error:
        defect(f"{topic}: message is not JSON: {error}")
        return
    error = next(validator.iter_errors(value), None)
    if error is not None:
        defect(f"{topic}: {error.json_path}: {error.message}")


def check(path):
    """All defects of the log at `path`, and a table of (topic, schema, messages)."""
    defects = []
    with open(path, "rb") as stream:
        reader = make_reader(stream)
        try:
            summary = reader.get_summary()
        except McapError as error:
            return [f"cannot read the summary: {error}"], []
        if summary is None or not summary.channels:
            return ["no channels"], []
        properties = {}
        counts = {}
        topics = {}
        for channel in summary.channels.values():
            schema = summary.schemas.get(channel.schema_id)
            properties[channel.id] = check_schema(channel, schema, defects.append)
            counts[channel.id] = 0
            if channel.topic in topics:
                defects.append(f"{channel.topic}: two channels of this name")
            topics[channel.topic] = channel.id
        foreign = {
            channel.id: jsonschema.Draft202012Validator(json.loads(summary.schemas[channel.schema_id].data))
            for channel in summary.channels.values()
            if channel.schema_id in summary.schemas
            and summary.schemas[channel.schema_id].name.startswith(FOREIGN)
        }
        last = {}
        try:
            # In the order of the file: within a channel it must be the order of time.
            for _, channel, message in reader.iter_messages(log_time_order=False):
                if message.log_time < last.get(channel.id, 0):
                    defects.append(f"{channel.topic}: time runs backwards at {message.log_time} ns")
                last[channel.id] = message.log_time
                counts[channel.id] += 1
                if channel.id in foreign:
                    check_foreign(channel.topic, foreign[channel.id], message.data, defects.append)
                elif properties[channel.id]:
                    check_message(channel.topic, properties[channel.id], message.data, defects.append)
                if len(defects) > SHOWN:
                    break
        except McapError as error:
            defects.append(f"cannot read the messages: {error}")
    rows = []
    for channel in summary.channels.values():
        schema = summary.schemas.get(channel.schema_id)
        if counts[channel.id] == 0 and channel.metadata.get("written", "always") == "always":
            defects.append(f"{channel.topic}: no message")
        rows.append((channel.topic, schema.name if schema else "-", counts[channel.id]))
    return defects, sorted(rows)


def main(arguments):
    """Check the one log in the folder given."""
    if len(arguments) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    folder = Path(arguments[1])
    logs = sorted(folder.glob("*.mcap")) if folder.is_dir() else []
    if len(logs) != 1:
        print(f"{folder}: expected one .mcap file, found {len(logs)}", file=sys.stderr)
        return 2
    defects, rows = check(logs[0])
    for topic, schema, count in rows:
        print(f"{topic:<32} {schema:<32} {count:>8}")
    for text in defects[:SHOWN]:
        print(f"{logs[0].name}: {text}", file=sys.stderr)
    print(f"{len(rows)} channels, {sum(row[2] for row in rows)} messages, {len(defects)} defects")
    return 1 if defects else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv))
