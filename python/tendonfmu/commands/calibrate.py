"""The command `calibrate`: from free motion to a tuned FMU."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tendonfmu import calibration, files, model
from tendonfmu import recordings as recorded
from tendonfmu import report as reporting
from tendonfmu.commands.command import ExtendedFinger, FreeAtPretensions, Progress, Scheduler, command, output_option
from tendonfmu.commands.console import INTERRUPTED, Bar, fail, print_json, print_result, say, say_files
from tendonfmu.commands.result import Result
from tendonfmu.errors import InputError
from tendonfmu.options import CalibrateOptions, RecordingSources, keywords

if TYPE_CHECKING:
    from tendonfmu.calibration import Calibration
    from tendonfmu.model import Finger, FingerSource
    from tendonfmu.recordings import RecordingSource


class CalibrationWarning(UserWarning):
    """A remark of a calibration on its recordings and its result; also in `CalibrateResult.warnings`."""


@dataclass(frozen=True, eq=False, repr=False)
class CalibrateResult(Result):
    """A calibrated finger.

    Attributes
    ----------
    calibration
        The finished calibration: description, report, and what the page shows.
    """

    calibration: Calibration

    def __repr__(self) -> str:
        left = 1e3 * reporting.together(self.report["error"]["calibrated"])
        return f"<Calibration of {self.finger.name}: {left:.3g} mN·m left>"

    @property
    def finger(self) -> Finger:
        """The calibrated finger."""
        return model.finger_from_data(self.calibration.data, Path("calibrated"))

    @property
    def report(self) -> Mapping[str, Any]:
        """All results, as calibration.json has them."""
        return self.calibration.report

    def shown(self) -> Any:
        """Return what the command prints."""
        return calibration.text.tables(self.report), calibration.text.lines(self.report), "model"

    def write(self, folder: str | os.PathLike[str]) -> dict[Path, str]:
        """Write the files of `tendonfmu calibrate -o`, the diagnosis with them; returns what each contains."""
        return calibration.write_calibration(self.calibration, Path(folder))

    def _repr_html_(self) -> str:
        page = escape(calibration.calibration_page(self.calibration))
        return f'<iframe srcdoc="{page}" width="100%" height="700"></iframe>'


@keywords(CalibrateOptions)
def calibrate(finger: FingerSource, free: RecordingSources, options: CalibrateOptions) -> CalibrateResult:
    """Make a tuned FMU from free motion: find missing effects, fit all numbers, tune contact detection.

    Parameters
    ----------
    finger
        A finger, its description, or the file of it.
    free
        Free motion: recordings, DataFrames or files. One alone needs no list.

    Returns
    -------
    CalibrateResult
        The calibrated finger and how good it is.

    Raises
    ------
    InputError
        An option, a file or a recording does not allow a calibration.

    Warns
    -----
    CalibrationWarning
        Remarks on the recordings and the result; also in `CalibrateResult.warnings`.
    """
    with tempfile.TemporaryDirectory() as folder:
        scratch, described = Path(folder), model.read_finger(finger)
        given = files.StandIn.of(scratch / "finger.json", str(described.path))
        files.write_text(given, model.description_text(described.to_dict()))
        groups = {"free": free, "test": options.test, "pushes": options.pushes}
        free_files, tests, pushes = (_files(scratch / name, sources) for name, sources in groups.items())
        found = calibration.calibrate(
            given,
            free_files,
            Path(options.folder or scratch / "calibrated"),
            tests=tests,
            pushes=pushes,
            previous=None if options.previous is None else Path(options.previous),
            options=options,
            progress=options.progress,
        )
    result = CalibrateResult(found)
    result.warn(CalibrationWarning)
    return result


def _files(folder: Path, sources: RecordingSource | Sequence[RecordingSource] | None) -> list[Path]:
    """Return the files of recordings; those in memory are written into a folder."""
    listed = [] if sources is None else recorded.listed_sources(sources)
    paths = []
    for source, recording in zip(listed, recorded.read_recordings(listed), strict=True):
        if isinstance(source, str | os.PathLike):
            paths.append(Path(source))
            continue
        file = folder / f"{Path(recording.path).stem}.parquet"
        while file.exists():
            file = file.with_name(f"{file.stem}_.parquet")
        folder.mkdir(exist_ok=True)
        recording.write(file)
        paths.append(files.StandIn.of(file, str(recording.path)))
    return paths


@command("calibrate", CalibrateOptions, of=calibrate)
def calibrate_files(
    finger: ExtendedFinger,
    recordings: FreeAtPretensions,
    output: Annotated[Path, output_option("DIR", "folder for page, finger and FMU")],
    options: CalibrateOptions,
    scheduler: Scheduler = None,
    progress: Progress = None,
) -> None:
    """DIR gets the page calibration.html, finger.json, finger.fmu,
    calibration.json and the diagnosis. A repeated call with the same files
    continues where the previous one ended.

    Of a hand, every finger is calibrated in DIR/FINGER; DIR gets hand.html,
    hand.json and hand.ssp.

    --test and --pushes take several files at once after the recordings. With
    --from the structure of the earlier model stays and its numbers are the
    prior.
    """  # noqa: D205
    if scheduler is not None:
        raise InputError("--scheduler: given with a finger; expected a hand, whose fingers it computes")
    calibration.check_folder(output, [finger, *recordings, *options.files("test", "pushes", "previous")])
    try:
        with Bar(progress) as bar:
            found = calibration.calibrate(
                finger,
                recordings,
                output,
                tests=options.files("test"),
                pushes=options.files("pushes"),
                previous=next(iter(options.files("previous")), None),
                options=options,
                progress=bar.phase,
            )
            bar("writing the files")
            written = calibration.write_calibration(found, output)
    except KeyboardInterrupt as stopped:
        if not stopped.args:  # while nothing was computed yet
            raise
        fail(f"interrupted; {stopped}")
        sys.exit(INTERRUPTED)
    result = CalibrateResult(found)
    if result.report["steps"]["repeated"]:
        say(f"unchanged since the last call, not repeated: {', '.join(result.report['steps']['repeated'])}")
    print_result(result)
    say_files(written)
    print_json((output / calibration.REPORT).read_text)
