"""Runs the notebooks of a folder, each in a process of its own, cell by cell.

Usage: run_notebooks.py FOLDER
"""

import json
import pathlib
import subprocess
import sys
import time


def run(path: pathlib.Path) -> None:
    notebook = json.loads(path.read_text(encoding="utf-8"))
    assert notebook["nbformat"] == 4, f"{path.name}: nbformat {notebook['nbformat']}"
    names = {"__name__": "__main__"}
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    for number, cell in enumerate(cells, start=1):
        assert cell["outputs"] == [], f"{path.name}: clear its outputs"
        # The place in a traceback.
        code = compile("".join(cell["source"]), f"{path.name}, code cell {number}", "exec")
        exec(code, names)


def main() -> int:
    given = pathlib.Path(sys.argv[1])
    if given.is_file():
        run(given)
        return 0
    notebooks = sorted(given.glob("*.ipynb"))
    assert notebooks, f"no notebook in {given}"
    failed = 0
    for path in notebooks:
        begin = time.monotonic()
        status = subprocess.run([sys.executable, __file__, str(path)]).returncode
        print(f"notebook {path.name}: exit {status}, {time.monotonic() - begin:.1f} s", flush=True)
        failed += status != 0
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
