"""The manifest of an indexed job, against the schema that Kubernetes publishes for it, strictly: no field that
it does not know.

usage: check_kubernetes.py WHEELEG FOLDER
"""

import subprocess
import sys
from pathlib import Path

import kubernetes_validate
import yaml

# `backoffLimitPerIndex` is stable from there on.
OLDEST = "1.33"


def main():
    program, folder = sys.argv[1], Path(sys.argv[2])
    words = ["campaign", "submit", "three-step-spread", "--kubernetes", "--shards", "8"]
    manifest = subprocess.run(
        [program, *words, "--image", "registry.example/wheeleg:1", "--out", str(folder / "parts")],
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    job = yaml.safe_load(manifest)
    newest = kubernetes_validate.latest_version()
    for version in (OLDEST, newest):
        kubernetes_validate.validate(job, version, strict=True)
    wrong = yaml.safe_load(manifest)
    wrong["spec"]["completionmode"] = wrong["spec"].pop("completionMode")
    try:
        kubernetes_validate.validate(wrong, newest, strict=True)
    except kubernetes_validate.ValidationError:
        pass
    else:
        raise AssertionError("a wrong field is accepted")
    print(f"kubernetes: the job is valid by the schemas of {OLDEST} and {newest}, strictly")


main()
