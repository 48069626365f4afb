"""Pages of the documentation site from notebooks: cells as Markdown, tables as HTML, Plotly figures as scripts.

`run_notebooks.sh` makes notebooks with outputs. Without them the pages have text and code, and a note.
"""

from __future__ import annotations

import html
import json
import os
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
SOURCES = ROOT / "examples" / "notebooks"
EXECUTED = ROOT / "build" / "notebooks"
PLOTLY = "notebooks/plotly.min.js"  # in the site
_FIGURE = "application/vnd.plotly.v1+json"
_LINK = re.compile(r"(\[[^\]]+\]\()([^)\s#:]+)")
_ANSI = re.compile(r"\x1b\[[0-9;]*m")
_WARNING = re.compile(r"^\S+\.py:\d+: (\w*Warning: .*)\n(?:  .*\n)?", re.MULTILINE)  # with the place and its line
_NOTE = "!!! note\n    The site was built without the package: this page has no outputs. Open `{}` to run it."


def page_of(name: str) -> str:
    """Return the page of a notebook, as a path in the site's Markdown sources."""
    return f"notebooks/{name}.md"


def notebook_pages() -> dict[str, str]:
    """Return the generated files of the site by path: pages, and the scripts of their figures."""
    found: dict[str, str] = {}
    for file in sorted(SOURCES.glob("*.ipynb")):
        executed = EXECUTED / file.name
        fresh = executed.exists() and _sources(executed) == _sources(file)
        notebook = json.loads((executed if fresh else file).read_text(encoding="utf-8"))
        page, figures = markdown_of(notebook, file.stem)
        if not fresh:
            title, _, rest = page.partition("\n")
            page = f"{title}\n\n{_NOTE.format(file.relative_to(ROOT))}\n{rest}"
        found[page_of(file.stem)] = page
        found |= {f"notebooks/{name}": script for name, script in figures.items()}
    if len(found) > len(list(SOURCES.glob("*.ipynb"))):
        found[PLOTLY] = (EXECUTED / "plotly.min.js").read_text(encoding="utf-8")
    return found


def markdown_of(notebook: dict[str, Any], name: str) -> tuple[str, dict[str, str]]:
    """Return a notebook as Markdown, and the scripts that draw its figures by file name.

    Parameters
    ----------
    notebook
        Content of the file, nbformat 4.
    name
        Of the page, without suffix.
    """
    parts: list[str] = []
    figures: dict[str, str] = {}
    for cell in notebook["cells"]:
        source = _text(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(_LINK.sub(_relocated, source))
            continue
        parts.append(f"```python\n{source}\n```")
        for k, output in enumerate(cell["outputs"]):
            data = output.get("data", {})
            if _FIGURE in data:
                own = f"{name}-{cell['id']}-{k}"
                figures[f"{own}.js"] = _script(own, data[_FIGURE])
                parts.append(_place(own, data[_FIGURE], first=len(figures) == 1))
            elif "text/html" in data:
                parts.append(f'<div class="notebook-output">{_text(data["text/html"])}</div>')
            else:
                text = _WARNING.sub(r"\1\n", _ANSI.sub("", _text(output.get("text", data.get("text/plain", "")))))
                kind = "notebook-output" + (" notebook-warning" if output.get("name") == "stderr" else "")
                parts.append(f'<pre class="{kind}">{html.escape(text.rstrip())}</pre>')
    return "\n\n".join(parts) + "\n", figures


def _text(lines: str | list[str]) -> str:
    return lines if isinstance(lines, str) else "".join(lines)


def _sources(file: Path) -> list[str]:
    return [_text(cell["source"]) for cell in json.loads(file.read_text(encoding="utf-8"))["cells"]]


def _script(name: str, figure: dict[str, Any]) -> str:
    settings = {"responsive": True, "displaylogo": False}
    arguments = (json.dumps(each, separators=(",", ":")) for each in (name, figure["data"], figure["layout"], settings))
    return f"Plotly.newPlot({','.join(arguments)});"


def _place(name: str, figure: dict[str, Any], *, first: bool) -> str:
    plotly = f'<script src="{Path(PLOTLY).name}"></script>' if first else ""
    height = figure["layout"].get("height", 450)
    place = f'<div class="notebook-figure" id="{name}" style="height: {height:g}px"></div>'
    return f'{place}{plotly}<script src="{name}.js"></script>'


def _relocated(link: re.Match[str]) -> str:
    """A link relative to examples/notebooks as one relative to docs/notebooks."""
    target = (SOURCES / link[2]).resolve()
    if target.suffix == ".ipynb" and target.parent == SOURCES:
        return f"{link[1]}{target.stem}.md"
    return f"{link[1]}{os.path.relpath(target, ROOT / 'docs' / 'notebooks')}"
