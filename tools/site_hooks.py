"""What mkdocs.yml adds to MkDocs: links that leave docs/ are checked, the C headers and the notebooks become pages."""

from __future__ import annotations

import logging
import os
import re
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

from mkdocs.structure.files import File, Files
from site_notebooks import SOURCES, notebook_pages, page_of

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
HEADERS = (
    "tendonfmu.h",
    "tendonfmu_outputs.h",
    "tendonfmu_description.h",
    "tendonfmu_estimation.hpp",
    "tendonfmu_plant.h",
)
_MARK = re.compile(r"<!-- headers: .*? -->")
_LINK = re.compile(r"(?<!!)\[((?:[^\[\]]|\[[^\]]*\])+)\]\(([^)\s#:]+)(#[^)\s]*)?\)")
log = logging.getLogger("mkdocs.hooks.site")  # a warning ends a strict build


def on_files(files: Files, config: Any, **_: Any) -> Files:
    for path, content in notebook_pages().items():
        files.append(File.generated(config, path, content=content))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    markdown = _MARK.sub(lambda _: headers(), markdown)
    return _LINK.sub(lambda match: shown(match, page), markdown)


def headers() -> str:
    texts = {name: (ROOT / "runtime" / "include" / name).read_text(encoding="utf-8") for name in HEADERS}
    language = {".h": "c", ".hpp": "cpp"}
    return "\n".join(f"### `{name}`\n\n```{language[Path(name).suffix]}\n{text}```\n" for name, text in texts.items())


def shown(link: re.Match[str], page: Any) -> str:
    """A link to a page of the site as it is; to a file of the repository its path, if it is there."""
    target = (DOCS / page.file.src_uri).parent / link[2]
    resolved = target.resolve()
    if resolved.is_relative_to(DOCS):
        return link[0]
    if resolved.parent == SOURCES and resolved.suffix == ".ipynb":
        page_folder = (DOCS / page.file.src_uri).parent
        return f"[{link[1]}]({os.path.relpath(DOCS / page_of(resolved.stem), page_folder)}{link[3] or ''})"
    if not resolved.exists():
        log.warning("%s: %s: no such file in the repository", page.file.src_uri, link[2])
    text, path = link[1], resolved.relative_to(ROOT).as_posix()
    return text if path in text or text.strip("`") == Path(path).name else f"{text} (`{path}`)"
