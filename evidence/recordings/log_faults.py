"""Formats of `convert table` with faults, and logs cut off at many bytes.

python -m evidence.recordings.log_faults -o log_faults.md
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from evidence import tables
from evidence.recordings.log_cases import FAULTS, FORMATS, ROWS, Format, content_of, converted, cut_at, sound, write
from evidence.runner import parser, publish

CUTS = 60


def faults(folder: Path) -> tuple[list[list[str]], dict[str, str]]:
    """A line for each format, and the sentence for each fault."""
    lines, sentences = [], dict[str, str]()
    for name, form in FORMATS.items():
        cells = [name]
        for fault, (spoil, log) in FAULTS.items():
            result = converted(write(folder, form, spoil(sound())), form.map(**log))
            rows = "" if result.columns is None else f" {len(result.columns['time'])}"
            cells.append(f"{result.name}{rows}")
            sentences.setdefault(fault, result.words or tables.NOTHING)
        lines.append(cells)
    return lines, sentences


def cuts(folder: Path, form: Format) -> list[str]:
    """Bytes, rows left at quarters of them, refusals, and the sentence at half of the bytes."""
    file = write(folder, form, sound())
    content = content_of(file, form)
    rows, sentences = [], []
    for k in range(CUTS):
        cut_at(file, form, content, len(content) * k // CUTS)
        result = converted(file, form.map())
        rows.append("refused" if result.columns is None else str(len(result.columns["time"])))
        sentences.append(result.words)
    quarters = [rows[CUTS * k // 4] for k in (1, 2, 3)]
    return [str(len(content)), *quarters, f"{rows.count('refused')} of {CUTS}", sentences[CUTS // 2]]


def main() -> None:
    options = parser(__doc__, output=None)
    options.add_argument("-o", "--output", type=Path, required=True, help="file of the tables")
    given = options.parse_args()
    with tempfile.TemporaryDirectory() as name:
        lines, sentences = faults(Path(name))
        cut = [[title, *cuts(Path(name), form)] for title, form in FORMATS.items()]
    head = ["format", "bytes", f"rows of {ROWS} left at 1/4", "at 1/2", "at 3/4", "refused", "what is said at 1/2"]
    parts = [
        tables.table(["format", *FAULTS], lines, len(FAULTS) + 1),
        tables.table(["fault", "what is said"], sentences.items(), 2),
        tables.table(head, cut),
    ]
    publish(given.output, "\n\n".join(parts) + "\n")


if __name__ == "__main__":
    main()
