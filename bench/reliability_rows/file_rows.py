"""R15 and R16: logs that end early, and archives that are no FMU."""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np

from .programs import small
from .row import Outcome, Row, Run

# --- logs that end early ----------------------------------------------------------------------------------------------


def truncated(run: Run) -> Outcome:
    """Each prefix of a log is refused in one line, or gives the samples that are whole in it."""
    from log_cases import FORMATS, content_of, converted, cut_at, sound, truth, write

    tried = refused = 0
    wrong: list[str] = []
    expected = truth()
    stride = max(1, round(1.0 / run.scale))
    folder = run.work / "cut"
    folder.mkdir(parents=True, exist_ok=True)
    for name, form in FORMATS.items():
        file = write(folder, form, sound())
        content = content_of(file, form)
        for size in range(0, len(content), stride):
            cut_at(file, form, content, size)
            tried += 1
            try:
                found = converted(file, form.map())
            except Exception as error:
                wrong.append(f"{name} at {size}: {type(error).__name__}: {error}")
                continue
            if found.columns is None:
                refused += 1
                if "\n" in found.words or not found.words:
                    wrong.append(f"{name} at {size}: not one line")
            elif not is_beginning(found.columns, expected):
                wrong.append(f"{name} at {size}: {len(found.columns['time'])} samples that are not those of the log")
    number = f"{tried:,} prefixes of logs in {len(FORMATS)} formats" + (
        f", every {stride}th byte" if stride > 1 else ", each byte"
    )
    given = tried - refused - len(wrong)
    result = f"{refused:,} refused in one line, {given:,} give the beginning of the log; {len(wrong)} wrong"
    (run.work / "wrong.txt").write_text("\n".join(wrong))
    return Outcome(number, "; ".join([result, *wrong[:3]]), not wrong)


def is_beginning(found: dict[str, np.ndarray], whole: dict[str, np.ndarray]) -> bool:
    count = len(found["time"])
    return all(np.allclose(found[name], whole[name][:count], rtol=1e-9, atol=1e-12) for name in whole)


# --- archives ---------------------------------------------------------------------------------------------------------


def limited() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
    resource.setrlimit(resource.RLIMIT_FSIZE, (2 << 30, 2 << 30))


def tree(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def tried_archive(folder: Path, file: Path, recording: Path) -> str:
    """ "" when `tendonfmu run` refuses it in one line and leaves nothing anywhere; else what it did."""
    temporary, out = folder / "temporary", folder / "out.csv"
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir()
    out.unlink(missing_ok=True)
    before = tree(folder)
    command = [sys.executable, "-m", "tendonfmu.cli", "run", str(file), str(recording), "-o", str(out), "--quiet"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, preexec_fn=limited, cwd=folder,
                              env={**os.environ, "TMPDIR": str(temporary)})  # fmt: skip
    except subprocess.TimeoutExpired:
        return "took more than 2 minutes"
    evil = Path("/tmp/reliability_evil")
    found = ["wrote outside"] * evil.exists()
    evil.unlink(missing_ok=True)
    left = sorted(tree(folder) - before - {"out.csv"})
    found += [f"left {left[0]} and {len(left) - 1} more"] if left else []
    if done.returncode == 0:
        return "; ".join([*found, "taken"])
    if done.returncode != 2 or done.stderr.count("\n") != 1 or not done.stderr.startswith("tendonfmu: "):
        found.append(f"status {done.returncode}: {done.stderr.strip()[-200:] or 'nothing said'}")
    return "; ".join([*found, "half a file"] if out.exists() else found)


def archives(run: Run) -> Outcome:
    from archive_cases import ARCHIVES, HARMLESS

    packed = small(run)
    recording = recording_of(run)
    folder = run.work / "archives"
    folder.mkdir(parents=True, exist_ok=True)
    wrong, taken = [], 0
    for name, make in ARCHIVES.items():
        file = folder / "model.fmu"
        file.unlink(missing_ok=True)
        make(packed.path, file)
        said = tried_archive(folder, file, recording)
        if said == "taken" and name in HARMLESS:
            taken += 1
        elif said:
            wrong.append(f"{name}: {said}")
    (run.work / "wrong.txt").write_text("\n".join(wrong))
    result = (
        f"{len(ARCHIVES) - taken - len(wrong)} refused in one line, {taken} run without the odd member; "
        f"nothing left, nothing outside; {len(wrong)} wrong"
    )
    return Outcome(
        f"{len(ARCHIVES)} archives, `tendonfmu run` with 4 GiB of memory and 2 minutes",
        "; ".join([result, *wrong]),
        not wrong,
    )


def recording_of(run: Run) -> Path:
    """A recording of fmu_binary.FINGER."""
    from fmu_binary import FINGER
    from tendonfmu.files import write_table

    tendons = range(1, len(FINGER["tendons"]) + 1)
    time = 0.01 * np.arange(100)
    columns = {"time": time}
    columns |= {f"tendon_force[{i}]": 5.0 + np.sin(time + i) for i in tendons}
    columns |= {f"tendon_position[{i}]": 1e-3 * np.sin(2.0 * time + i) for i in tendons}
    file = run.work / "recording.csv"
    write_table(file, columns)
    return file


ROWS = [
    Row("R15", "Logs that end early", "each byte", "logs that are cut in the middle and go on", truncated),
    Row("R16", "Archives that are no FMU", "44", "other programs that unpack them", archives),
]
