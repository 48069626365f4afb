"""How results show themselves in a notebook: the tables and sentences that the commands print."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

Row = Sequence[str]


def html_of(
    title: str, tables: Iterable[tuple[str, Row, Sequence[Row]]], lines: Iterable[str], warnings: Iterable[str] = ()
) -> str:
    """Return a result as an HTML element."""
    parts = [f"<p><b>{escape(title)}</b></p>"]
    for caption, headings, rows in tables:
        parts += ["<table>", f'<caption style="text-align: left">{escape(caption)}</caption>', _row("th", headings)]
        parts += [*(_row("td", row) for row in rows), "</table>"]
    parts += [f"<p>{escape(line)}</p>" for line in lines if line]
    remarks = "".join(f"<li>{escape(sentence)}</li>" for sentence in warnings)
    parts += [f"<p>Warnings:</p><ul>{remarks}</ul>"] if remarks else []
    return f'<div style="font-size: 13px">{"".join(parts)}</div>'


def _row(cell: str, texts: Row) -> str:
    return "<tr>" + "".join(f"<{cell}>{escape(text)}</{cell}>" for text in texts) + "</tr>"
