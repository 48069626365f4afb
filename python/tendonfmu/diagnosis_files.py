"""The files of a diagnosis: a folder that holds all of them, or is as it was before."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tendonfmu.diagnosis_page import PAGE, write_diagnosis_page
from tendonfmu.diagnosis_report import EXTENDED, EXTENDED_FMU, NOMINAL, REPORT, build_report, report_text
from tendonfmu.diagnosis_result import Diagnosis
from tendonfmu.errors import InputError
from tendonfmu.fit_files import description_text, write_text
from tendonfmu.packaging import build_fmu
from tendonfmu.whole_file import check_output, check_output_folder

_NAMED = (REPORT, EXTENDED, EXTENDED_FMU, PAGE, NOMINAL)


def check_folder(folder: Path, inputs: Sequence[Path]) -> None:
    """Raises InputError where the folder cannot be, or a result would take the place of an input."""
    check_output_folder(folder)
    if folder.is_dir():
        for name in _NAMED:
            check_output(folder / name, *inputs)


def write_diagnosis(found: Diagnosis, folder: Path) -> dict[Path, str]:
    """Writes report, both descriptions, the FMU, page and figures. Returns file -> what is in it, in order of use.

    Everything is made beside the folder and then moved into it, the report last; files that an earlier diagnosis left
    there are removed. Raises InputError where nothing can be written: the folder is then as before.
    """
    beside = folder.absolute().parent
    try:
        beside.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=beside, prefix=f".{folder.absolute().name}-") as name:
            made = _make(found, Path(name))
            folder.mkdir(exist_ok=True)
            _remove_earlier(folder)
            for file in sorted(made, key=lambda file: file.name == REPORT):
                os.replace(file, folder / file.name)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror or error})") from None
    return {folder / file.name: what for file, what in made.items()}


def _make(found: Diagnosis, folder: Path) -> dict[Path, str]:
    """All files, in a folder of their own."""
    page = write_diagnosis_page(found, folder)
    causes = len(found.causes)
    added = "nothing added" if causes == 0 else "its cause" if causes == 1 else f"its {causes} causes"
    for name, data in ((NOMINAL, found.nominal_data), (EXTENDED, found.extended_data)):
        write_text(folder / name, description_text(dict(data)))
    build_fmu(folder / EXTENDED, folder / EXTENDED_FMU)
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


def _remove_earlier(folder: Path) -> None:
    """What the report of an earlier diagnosis lists, and nothing else: figures of causes that are no more."""
    try:
        listed = json.loads((folder / REPORT).read_bytes())["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return
    for name in listed if isinstance(listed, list) else ():
        if (
            isinstance(name, str)
            and Path(name).name == name
            and Path(name).suffix in (".html", ".png", ".json", ".fmu")
        ):
            (folder / name).unlink(missing_ok=True)
