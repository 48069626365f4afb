"""Pages as a browser shows them: their elements, and what a real one measures and complains of."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge")


def find_browser() -> str | None:
    """The first that is installed."""
    return next(filter(None, map(shutil.which, BROWSERS)), None)


class Elements(HTMLParser):
    """Start tags with their attributes, and text without that of the style sheet."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self._inside = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._inside = tag

    def handle_data(self, data: str) -> None:
        if self._inside != "style":
            self.words.append(data)

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


def visit(browser: str, file: Path, *options: str) -> subprocess.CompletedProcess[str]:
    words = [browser, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars"]
    words += ["--enable-logging=stderr", f"--user-data-dir={file.parent / 'profile'}", *options, file.as_uri()]
    return subprocess.run(words, capture_output=True, text=True, check=True, timeout=180)


FRAME = """<!DOCTYPE html><meta charset="utf-8"><body style="margin:0">
<iframe id="f" style="border:0;width:{width}px;height:2400px"
srcdoc="{page}"></iframe><script>
addEventListener("load", () => {{
  const inside = document.getElementById("f").contentDocument;
  if ({measure}) {{
    for (const each of inside.querySelectorAll("details")) each.open = true;
    const root = inside.documentElement, edge = root.clientWidth + 0.5;
    const out = [...inside.body.querySelectorAll("*")].filter(
      e => !(e.closest(".scroll") && !e.matches(".scroll")) && e.getBoundingClientRect().right > edge);
    const found = {{
      width: root.clientWidth, scroll: root.scrollWidth, height: root.scrollHeight,
      images: [...inside.images].map(image => [image.naturalWidth, image.width]),
      drawings: [...inside.querySelectorAll("svg.panel")].map(drawing => drawing.getBoundingClientRect().width),
      out: out.map(e => e.outerHTML.slice(0, 80)),
      scrolled: [...inside.querySelectorAll(".scroll")].filter(e => e.scrollWidth > e.clientWidth).length,
      requests: document.getElementById("f").contentWindow.performance.getEntriesByType("resource").map(e => e.name),
      font: parseFloat(getComputedStyle(inside.body).fontSize),
    }};
    document.body.textContent = "MEASURED" + JSON.stringify(found) + "END";
  }}
}});
</script></body>"""


def framed(folder: Path, page: str, width: int, measure: bool) -> Path:
    """A page that shows the page at a width, since a window has a least one; and measures it on demand."""
    file = folder / f"frame_{width}_{measure}.html"
    file.write_text(FRAME.format(width=width, page=html.escape(page), measure=json.dumps(measure)), encoding="utf-8")
    return file


def measure(browser: str, folder: Path, page: str, width: int) -> dict[str, Any]:
    done = visit(browser, framed(folder, page, width, True), "--dump-dom")
    found = re.search(r"MEASURED(\{.*\})END", done.stdout)
    assert found is not None, done.stderr[-2000:]
    result: dict[str, Any] = json.loads(html.unescape(found[1]))
    return result
