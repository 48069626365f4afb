"""Table: formats of `convert table` with faults, and logs cut off at many bytes. Writes Markdown.

python bench/log_faults.py -o log_faults.md
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "python_tests" / "support"))

from log_cases import FAULTS, FORMATS, ROWS, Format, content_of, converted, cut_at, sound, write

CUTS = 60


def faults(folder: Path) -> tuple[list[str], dict[str, str]]:
    """The lines of the table, and one sentence for each fault."""
    lines = [f"| format | {' | '.join(FAULTS)} |", f"| --- |{' --- |' * len(FAULTS)}"]
    words: dict[str, str] = {}
    for name, form in FORMATS.items():
        cells = []
        for fault, (spoil, log) in FAULTS.items():
            found = converted(write(folder, form, spoil(sound())), form.map(**log))
            rows = "" if found.columns is None else f" {len(found.columns['time'])}"
            cells.append(f"{found.name}{rows}")
            words.setdefault(fault, found.words)
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return lines, words


def cuts(folder: Path, form: Format) -> tuple[str, str]:
    """The row of a format, and the sentence at half of its bytes."""
    file = write(folder, form, sound())
    content = content_of(file, form)
    rows, said = [], ""
    for k in range(CUTS):
        cut_at(file, form, content, len(content) * k // CUTS)
        found = converted(file, form.map())
        rows.append(-1 if found.columns is None else len(found.columns["time"]))
        said = found.words if k == CUTS // 2 else said
    refused = sum(count < 0 for count in rows)
    at = " | ".join(str(rows[CUTS * k // 4]) if rows[CUTS * k // 4] >= 0 else "refused" for k in (1, 2, 3))
    return f"{len(content)} | {at} | {refused} of {CUTS}", said


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, required=True)
    output = parser.parse_args().output
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lines, words = faults(folder)
        text = [*lines, "", "| fault | what is said |", "| --- | --- |"]
        text += [f"| {fault} | {said or '–'} |" for fault, said in words.items()]
        text += [
            "",
            f"| format | bytes | rows of {ROWS} left at 1/4 | at 1/2 | at 3/4 | refused | what is said at 1/2 |",
        ]
        text += ["| --- | ---: | ---: | ---: | ---: | ---: | --- |"]
        for title, form in FORMATS.items():
            row, said = cuts(folder, form)
            text.append(f"| {title} | {row} | {said} |")
    output.write_text("\n".join(text) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
