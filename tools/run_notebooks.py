"""Runs the notebooks of examples/notebooks and keeps what they show: python tools/run_notebooks.py FOLDER.

The notebooks of the repository have no outputs, so that a change of them can be read. The site shows those of FOLDER
(`site_notebooks.py`). Needs the package, nbclient and ipykernel. An error in a cell is an error here.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
NOTEBOOKS = sorted((EXAMPLES / "notebooks").glob("*.ipynb"))
_SECONDS = 600  # a cell, on a busy machine


def run_notebook(file: Path, folder: Path) -> Any:
    """Return a notebook with its outputs. What it writes goes to `folder/notebooks`, beside links to their data.

    Parameters
    ----------
    file
        The notebook.
    folder
        An empty folder, or one of another notebook.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        A cell fails.
    """
    place = folder / "notebooks"
    place.mkdir(exist_ok=True)
    for name in ("demo_recording", "fingers"):
        if not (folder / name).exists():
            (folder / name).symlink_to(EXAMPLES / name, target_is_directory=True)
    notebook = nbformat.read(file, as_version=4)
    # Figures as JSON, which the site draws with one copy of plotly.js.
    environment = {**os.environ, "PLOTLY_RENDERER": "plotly_mimetype"}
    client = NotebookClient(notebook, timeout=_SECONDS, resources={"metadata": {"path": str(place)}})
    return client.execute(env=environment)


def main(output: Path) -> None:
    from plotly.offline import get_plotlyjs

    output.mkdir(parents=True, exist_ok=True)
    for old in output.glob("*.ipynb"):
        old.unlink()
    for file in NOTEBOOKS:
        with tempfile.TemporaryDirectory() as folder:
            notebook = run_notebook(file, Path(folder))
        nbformat.write(notebook, output / file.name)
    (output / "plotly.min.js").write_text(get_plotlyjs(), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
