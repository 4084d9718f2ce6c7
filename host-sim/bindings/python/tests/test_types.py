"""Stubs and docstrings say what there is."""

import inspect
import subprocess
import sys

import wheeleg


def test_the_stubs_are_those_of_the_package():
    told = subprocess.run(
        [sys.executable, "-m", "mypy.stubtest", "wheeleg", "--concise"],
        capture_output=True,
        text=True,
    )
    assert told.returncode == 0, told.stdout + told.stderr


def test_everything_public_says_what_it_does():
    silent = []
    for name in wheeleg.__all__:
        thing = getattr(wheeleg, name)
        if not inspect.isclass(thing):
            continue
        members = [(f"{name}.{m}", getattr(thing, m)) for m in vars(thing) if not m.startswith("_")]
        silent += [where for where, what in [(name, thing), *members] if not inspect.getdoc(what)]
    assert silent == []
