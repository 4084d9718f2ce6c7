"""The examples of the guide's page about Python run as they are printed."""

import re
from pathlib import Path

GUIDE = Path(__file__).parents[4] / "docs/guide/python.md"


def test_the_examples_of_the_guide_run(capsys):
    blocks = re.findall(r"^```python\n(.*?)^```$", GUIDE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    assert len(blocks) >= 3
    names = {}
    for number, block in enumerate(blocks, start=1):
        exec(compile(block, f"{GUIDE.name}, example {number}", "exec"), names)
    # The piston of the first example has reached its reference.
    assert abs(names["rows"]["stroke_m"][-1] - 0.14) < 0.001
    assert capsys.readouterr().out.count("\n") >= 2
