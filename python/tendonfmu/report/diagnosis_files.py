"""Which files a diagnosis writes. The output folder gets all of them, or stays as it was."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from tendonfmu.diagnosis import Diagnosis
from tendonfmu.errors import OutputError, own_fault
from tendonfmu.files import check_output, check_output_folder, in_use, is_about, remove_left_behind, write_text
from tendonfmu.fmu import build_fmu
from tendonfmu.model import description_text
from tendonfmu.report.diagnosis_page import PAGE, write_diagnosis_page
from tendonfmu.report.diagnosis_report import EXTENDED, EXTENDED_FMU, NOMINAL, REPORT, build_report, report_text
from tendonfmu.tasks import uninterrupted

_SUFFIXES = (".html", ".json", ".fmu", ".png")  # .png: earlier versions wrote figures beside the page
_NAMED = (REPORT, EXTENDED, EXTENDED_FMU, PAGE, NOMINAL)


def check_folder(folder: Path, inputs: Sequence[Path]) -> None:
    """Check before a long computation that the results can be written to a folder."""
    check_output_folder(folder)
    if folder.is_dir():
        for name in _NAMED:
            check_output(folder / name, *inputs)


def write_diagnosis(found: Diagnosis, folder: Path) -> dict[Path, str]:
    """Write the report, both descriptions, the FMU and the page."""
    beside = folder.absolute().parent
    try:
        beside.mkdir(parents=True, exist_ok=True)
        with _folder_beside(folder) as made_in:
            (made_in / "new").mkdir()
            with own_fault("the files of the diagnosis"):
                made = _make_for(found, made_in / "new", folder)
            with uninterrupted():
                _move(made, folder, made_in / "old")
    except OSError as error:
        if not is_about(error, beside):
            raise
        raise OutputError(f"{folder}: cannot be written ({error.strerror or error})") from None
    return {folder / file.name: what for file, what in made.items()}


def _make_for(found: Diagnosis, folder: Path, named: Path) -> dict[Path, str]:
    """Make the files in a folder. A refusal names the folder that the user gave."""
    try:
        return _make(found, folder)
    except OutputError as refused:
        raise OutputError(str(refused).replace(str(folder), str(named))) from None


@contextmanager
def _folder_beside(folder: Path) -> Iterator[Path]:
    """Make a temporary folder on the same disk. Its removal is not interrupted."""
    remove_left_behind(folder.absolute())
    name = tempfile.mkdtemp(dir=folder.absolute().parent, prefix=f".{folder.absolute().name}-")
    try:
        with in_use(Path(name)):
            yield Path(name)
    finally:
        with uninterrupted():
            shutil.rmtree(name, ignore_errors=True)


def _move(files: Iterable[Path], folder: Path, old: Path) -> None:
    """Move files into a folder, the report last, and move those of an earlier diagnosis to `old`; undo all on error."""
    is_new = not folder.exists()
    folder.mkdir(exist_ok=True)
    old.mkdir()
    moved: list[tuple[Path, Path]] = []
    ordered = sorted(files, key=lambda file: file.name == REPORT)
    names = {*_earlier(folder), *(file.name for file in ordered)}
    leaving = [(folder / name, old / name) for name in sorted(names) if (folder / name).is_file()]
    try:
        for source, target in (*leaving, *((file, folder / file.name) for file in ordered)):
            os.replace(source, target)
            moved.append((source, target))
    except BaseException:
        for source, target in reversed(moved):
            os.replace(target, source)
        if is_new:
            folder.rmdir()
        raise


def _make(found: Diagnosis, folder: Path) -> dict[Path, str]:
    """Write all files to an empty folder."""
    page = write_diagnosis_page(found, folder)
    causes = len(found.causes)
    added = "nothing added" if causes == 0 else "its cause" if causes == 1 else f"its {causes} causes"
    for name, data in ((NOMINAL, found.nominal_data), (EXTENDED, found.extended_data)):
        write_text(folder / name, description_text(dict(data)))
    build_fmu(folder / EXTENDED, folder / EXTENDED_FMU, illustrated=False)  # drawing takes longer than all the rest
    files = {
        folder / PAGE: page.pop(folder / PAGE),
        folder / REPORT: "the same numbers",
        folder / EXTENDED: f"the finger with {added}, fitted",
        folder / EXTENDED_FMU: "the same as an FMU",
        folder / NOMINAL: "the given structure, fitted",
        **page,
    }
    write_text(folder / REPORT, report_text(build_report(found, [file.name for file in files])))
    return files


def _earlier(folder: Path) -> list[str]:
    """List the files that the report of an earlier diagnosis names, including figures of causes no longer found."""
    try:
        listed = json.loads((folder / REPORT).read_bytes())["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    texts = [name for name in listed if isinstance(name, str)] if isinstance(listed, list) else []
    return [name for name in texts if Path(name).name == name and Path(name).suffix in _SUFFIXES]
