"""What is not imported before it is needed, so that `import tendonfmu` and every command start at once."""

from __future__ import annotations

import json
import subprocess
import sys

from tendonfmu.cli.program import app

HEAVY = {
    "dask",
    "fmpy",
    "jinja2",
    "lxml",
    "matplotlib",
    "mcap",
    "mujoco",
    "pandas",
    "pint",
    "plotly",
    "pyarrow",
    "scipy",
}
COMMANDS = sorted(str(each.name or getattr(each.callback, "__name__", "")) for each in app.registered_commands)
START = """
import contextlib, io, json, sys
from tendonfmu.cli import program
with contextlib.redirect_stdout(io.StringIO()):
    for name in sys.argv[1:]:
        with contextlib.suppress(SystemExit):
            program.app([name, "--help"], standalone_mode=False)
print(json.dumps(sorted(sys.modules)))
"""


def modules_after(code: str, *arguments: str) -> set[str]:
    answer = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True)
    return {name.partition(".")[0] for name in json.loads(answer.stdout)}


def test_the_package_imports_nothing_heavy() -> None:
    found = modules_after("import json, sys, tendonfmu; print(json.dumps(sorted(sys.modules)))")
    assert "tendonfmu" in found and found & (HEAVY | {"numpy", "typer", "rich"}) == set()


def test_help_of_every_command_imports_nothing_heavy() -> None:
    assert len(COMMANDS) > 10
    found = modules_after(START, *COMMANDS)
    assert "typer" in found and found & HEAVY == set()
