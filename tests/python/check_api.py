"""Asks the HTTP API of the console whatever its own document allows, and what it does not, by schemathesis.

    python3 check_api.py WHEELEG

For each path of the OpenAPI document that the server hands out: requests that fit it and requests that do not, with the
control key, with the view key, and with none. No answer is a 5xx, and each is as the document says: its status, its
type, its schema. The robot is as alive afterwards as before.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from check_client import served
from wheeleg import Robot

CHECKS = "not_a_server_error,status_code_conformance,content_type_conformance,response_headers_conformance,response_schema_conformance"
EXAMPLES = 60
SEED = 20030001


def asks(address, key, examples):
    """What schemathesis says at its end: how many cases it has tried."""
    command = [str(Path(sys.executable).with_name("schemathesis")), "run", f"http://{address}/openapi.json", "--url", f"http://{address}/api/v1"]
    command += ["--checks", CHECKS, "--max-examples", str(examples), "--seed", str(SEED), "--no-color", "--request-timeout", "5"]
    # Requests one by one: it is the answers that are judged. Nothing is left behind.
    command += ["--phases", "examples,coverage,fuzzing", "--generation-database", "none", "--warnings", "off"]
    if key:
        command += ["--header", f"Authorization: Bearer {key}"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tempfile.gettempdir())
    found = re.search(r"(\d+) generated", done.stdout)
    if done.returncode != 0 or not found:
        sys.exit(f"{done.stdout[-4000:]}\n{done.stderr[-2000:]}")
    return int(found.group(1))


def main(program):
    with tempfile.TemporaryDirectory() as home, served(program, Path(home)) as (address, keys, _, _):
        control, view = keys["control"].strip(), keys["view"].strip()
        with Robot(address, view, role="view") as robot:
            robot.until(lambda state: state["ready"])
            tried = [asks(address, control, EXAMPLES), asks(address, view, EXAMPLES // 4), asks(address, None, EXAMPLES // 4)]
            begin = robot.state()["master_us"]
            robot.until(lambda state: state["alive"] and state["master_us"] > begin + 500_000, 5)
    assert min(tried) > 50, f"hardly anything was asked: {tried}"
    print(f"{tried[0]} requests with the control key, {tried[1]} with the view key, {tried[2]} without: no 5xx, all as the document says")


if __name__ == "__main__":
    main(sys.argv[1])
