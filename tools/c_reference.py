"""Reads the public C headers: each declaration with the comment above it, as Markdown for the documentation site."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_NAME = re.compile(r"^}\s*(\w+);|\b(\w+)\(|\bstruct (\w+) \w+;", re.MULTILINE)


@dataclass(frozen=True)
class Declaration:
    """comment: its text without stars. code: as in the header. name: of the function or type."""

    name: str
    comment: str
    code: str


def header_markdown(header: Path) -> str:
    """A section for a header: its introduction, then its declarations under the headings that it has."""
    text = header.read_text(encoding="utf-8")
    introduction, _, rest = text.partition("*/")
    if 'extern "C" {' in rest:
        body = rest[rest.index('extern "C" {') :].split("#endif", 1)[1].rsplit("#ifdef __cplusplus", 1)[0]
    else:  # generated: types alone, and a first comment for those who would edit it
        introduction, body = "", rest.partition("#define")[2].partition("\n")[2].rpartition("#endif")[0]
    parts = [f"## `{header.name}`", _paragraphs(_plain(introduction))]
    for title, block in _sections(body):
        if title:
            parts.append(f"### {title}")
        for each in _declarations(block):
            parts.append(f"#### `{each.name}`\n\n```c\n{each.code}\n```\n\n{_paragraphs(each.comment)}")
    return "\n\n".join(part for part in parts if part) + "\n"


def _sections(body: str) -> list[tuple[str, str]]:
    pieces = re.split(r"/\* --- (.+?) -+ \*/", body)
    return [("", pieces[0]), *zip(pieces[1::2], pieces[2::2], strict=True)]


def _declarations(block: str) -> list[Declaration]:
    """Paragraphs of a header: a comment that begins a line, and the code until the next blank line."""
    found = []
    for paragraph in _split(block):
        comment = re.match(r"/\*.*?\*/\s*", paragraph, re.DOTALL)
        head = comment[0] if comment else ""
        code = paragraph[len(head) :].strip()
        name = _NAME.search(_COMMENT.sub("", code))
        if code and name:
            found.append(Declaration(next(filter(None, name.groups())), _plain(head), code))
    return found


def _split(block: str) -> list[str]:
    """Blank lines divide declarations, but for those inside of a comment or of braces."""
    paragraphs: list[str] = []
    lines: list[str] = []
    for line in block.splitlines():
        text = "\n".join(lines)
        if not line.strip() and text.count("/*") == text.count("*/") and text.count("{") == text.count("}"):
            paragraphs.append(text)
            lines = []
        else:
            lines.append(line)
    return [text.strip() for text in [*paragraphs, "\n".join(lines)] if text.strip()]


def _plain(comment: str) -> str:
    """The text of a comment without its marks."""
    inside = comment.strip().removeprefix("/*").removesuffix("*/")
    return "\n".join(re.sub(r"^ ?\* ?", "", line).rstrip() for line in inside.strip().splitlines())


def _paragraphs(text: str) -> str:
    """Running text as it is, indented lines (lists of arguments, examples) as preformatted text."""
    done: list[str] = []
    indented: list[str] = []
    for line in [*text.splitlines(), ""]:
        if line.startswith("  "):
            indented.append(line[2:])
            continue
        if indented:
            done.append("\n```text\n" + "\n".join(indented) + "\n```\n")
            indented = []
        done.append(line)
    return "\n".join(done).strip()
