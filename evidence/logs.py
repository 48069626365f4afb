"""Which logs does `convert table` read, recover or refuse?"""

from __future__ import annotations

from pathlib import Path

from evidence import table
from evidence.part import Figures, Part
from made_logs import FAULTS, FORMATS, ROWS, Format, content_of, converted, cut_at, sound, write

CUTS = 60  # places at which a log is cut off


def faults(folder: Path, workers: int) -> Figures:
    """What becomes of every fault in every format, and of logs that are cut off."""
    lines, ends = [], []
    for fault, (spoil, log) in FAULTS.items():
        results = [converted(write(folder, form, spoil(sound())), form.map(**log)) for form in FORMATS.values()]
        rows = [0 if result.columns is None else len(result.columns["time"]) for result in results]
        same = {(result.name, kept) for result, kept in zip(results, rows, strict=True)}
        ends += [result.name for result in results]
        # CSV is the first format, and the others say the same of their own columns
        words = ", ".join(f"{name}, {kept} rows kept" if kept else name for name, kept in sorted(same))
        lines.append([fault, words, results[0].words.split(";")[0] or table.NOTHING])
    cut = [[name, *cuts(folder, form)] for name, form in FORMATS.items()]
    return {
        "logs": len(ends),
        "ends": {name: ends.count(name) for name in sorted(set(ends))},
        "recovered_from_half": sum(cells[3] != "refused" for cells in cut),
        "lines": lines,
        "cut": cut,
    }


def cuts(folder: Path, form: Format) -> list[str]:
    """Bytes, rows left at quarters of them, and how many of all places are refused."""
    file = write(folder, form, sound())
    content = content_of(file, form)
    rows = []
    for k in range(CUTS):
        cut_at(file, form, content, len(content) * k // CUTS)
        columns = converted(file, form.map()).columns
        rows.append("refused" if columns is None else str(len(columns["time"])))
    return [str(len(content)), *(rows[CUTS * k // 4] for k in (1, 2, 3)), f"{rows.count('refused')} of {CUTS}"]


PARTS = {
    "faults": Part(
        faults,
        minutes=0.3,
        needs=("h5py", "mcap", "mcap_protobuf", "rosbags"),
        headlines={
            "ends.read": (16, 16),
            "ends.recovered": (48, 48),
            "ends.refused": (64, 64),
            "ends.warned": (16, 16),
            "recovered_from_half": (11, 11),
        },
        tables={
            "faults": table.of_cells("lines", ["fault", "all 16 formats", "what the user reads (CSV)"], 3),
            "cut": table.of_cells(
                "cut", ["format", "bytes", f"rows of {ROWS} left at 1/4", "at 1/2", "at 3/4", "refused"]
            ),
        },
    ),
}
