"""Pages as a browser shows them: their elements, and what a real one measures and complains of."""

from __future__ import annotations

import base64
import html
import json
import re
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np


class Elements(HTMLParser):
    """Start tags with their attributes, and text without that of style sheets and scripts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.scripts: list[str] = []
        self._inside = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._inside = tag

    def handle_data(self, data: str) -> None:
        if self._inside == "script":
            self.scripts.append(data)
        elif self._inside != "style":
            self.words.append(data)

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


def visit(browser: str, file: Path, *options: str) -> subprocess.CompletedProcess[str]:
    words = [browser, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars"]
    words += [
        "--virtual-time-budget=60000",
        "--enable-logging=stderr",
        f"--user-data-dir={file.parent / 'profile'}",
        *options,
        file.as_uri(),
    ]
    return subprocess.run(words, capture_output=True, text=True, check=True, timeout=180)


FRAME = """<!DOCTYPE html><meta charset="utf-8"><body style="margin:0">
<iframe id="f" style="border:0;width:{width}px;height:2400px"
srcdoc="{page}"></iframe><script>
addEventListener("load", () => {{
  const frame = document.getElementById("f"), inside = frame.contentDocument;
  const zoom = async plots => {{
    if (!plots.length) return [];
    const {{ figures }} = JSON.parse(inside.getElementById("panels").textContent);
    const zooms = plots.map(e => figures[e.dataset.figure].zoom), first = plots[zooms.findIndex(name => name)];
    if (!first) return [];
    await frame.contentWindow.Plotly.relayout(first, {{ "xaxis.range": [1, 2] }});
    await new Promise(done => setTimeout(done, 500));
    return plots.flatMap((e, k) => `${{e._fullLayout.xaxis.range}}` === "1,2" ? [zooms[k]] : []);
  }};
  const measure = async () => {{
    if (inside.getElementById("plotly") && !frame.contentWindow.Plotly) return;
    clearInterval(waiting);
    for (const each of inside.querySelectorAll("details")) each.open = true;
    frame.contentWindow.dispatchEvent(new Event("beforeprint"));
    const root = inside.documentElement, edge = root.clientWidth + 0.5;
    const out = [...inside.body.querySelectorAll("*")].filter(
      e => !(e.closest(".scroll") && !e.matches(".scroll")) && !e.closest("svg")
        && e.getBoundingClientRect().right > edge);
    const plots = [...inside.querySelectorAll(".plot.drawn")];
    const found = {{
      width: root.clientWidth, scroll: root.scrollWidth, height: root.scrollHeight,
      drawings: plots.map(e => e.querySelector(".main-svg").getBoundingClientRect().width),
      drawn: plots.map(e => e.querySelectorAll("path.js-line, path.point, .hm image").length),
      described: plots.filter(e => e.getAttribute("role") === "img").map(e => e.getAttribute("aria-label")),
      out: out.map(e => e.outerHTML.slice(0, 80)),
      scrolled: [...inside.querySelectorAll(".scroll")].filter(e => e.scrollWidth > e.clientWidth).length,
      requests: frame.contentWindow.performance.getEntriesByType("resource").map(e => e.name),
      font: parseFloat(getComputedStyle(inside.body).fontSize),
      paper: getComputedStyle(inside.body).backgroundColor,
      ink: plots.flatMap(e => [...e.querySelectorAll('[style*="stroke: rgb(34, 34, 34)"]')])
        .map(e => getComputedStyle(e).stroke),
      zoomed: await zoom(plots),
    }};
    document.body.textContent = "MEASURED" + JSON.stringify(found) + "END";
  }};
  const waiting = {measure} ? setInterval(measure, 100) : 0;
}});
</script></body>"""


def figures_of(page: str) -> list[dict[str, Any]]:
    """The figures that a page draws, as Plotly has them, in its order; packed numbers as arrays."""
    script = re.search(r'id="panels">(.*?)</script>', page)

    def unpacked(node: dict[str, Any]) -> Any:
        if "bdata" not in node:
            return node
        numbers = np.frombuffer(base64.b64decode(node["bdata"]), node["dtype"])
        return numbers.reshape([int(size) for size in node.get("shape", "-1").split(",")])

    figures: list[dict[str, Any]] = [] if script is None else json.loads(script[1], object_hook=unpacked)["figures"]
    return figures


def needs_nothing_else(page: str) -> None:
    """No file or address but those in it; the three scripts are the figures, packed plotly.js, and what draws them."""
    elements = Elements(page)
    assert not {name for name, _ in elements.tags} & {"iframe", "object", "embed", "base", "form"}
    assert [each.get("id") for each in elements.all("script")] in ([], ["panels", "plotly", None])
    for tag, attributes in elements.tags:
        assert not [name for name in attributes if name.startswith("on")], tag
        for name in ("src", "href"):
            address = attributes.get(name)
            assert address is None or not re.match(r"[a-z]+:(?!,)", address), (tag, address)
    assert not re.search(r"url\(|@import|https?://", page)


def framed(folder: Path, page: str, width: int, measure: bool) -> Path:
    """A page that shows the page at a width, since a window has a least one; and measures it on demand."""
    file = folder / f"frame_{width}_{measure}.html"
    file.write_text(FRAME.format(width=width, page=html.escape(page), measure=json.dumps(measure)), encoding="utf-8")
    return file


def measure(browser: str, folder: Path, page: str, width: int, *options: str) -> dict[str, Any]:
    """Sizes, figures, requests; and which groups of figures are zoomed once the first of one is."""
    done = visit(browser, framed(folder, page, width, True), "--dump-dom", *options)
    found = re.search(r"MEASURED(\{.*\})END", done.stdout)
    assert found is not None, done.stderr[-2000:]
    result: dict[str, Any] = json.loads(html.unescape(found[1]))
    return result
