"""The command `calibrate`: from free motion to a tuned FMU."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tendonfmu import calibration
from tendonfmu import report as reporting
from tendonfmu.commands.command import ExtendedFinger, FreeAtPretensions, Progress, Scheduler, command, output_option
from tendonfmu.commands.console import INTERRUPTED, Bar, Result, fail, print_json, print_result, say, say_files
from tendonfmu.errors import InputError
from tendonfmu.options import CalibrateOptions, RecordingSources, keywords

if TYPE_CHECKING:
    from tendonfmu.calibration import Calibration
    from tendonfmu.model import Finger, FingerSource


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
        return self.calibration.finger

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
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.folder or Path(scratch) / "calibrated"
        result = CalibrateResult(calibration.calibrate(finger, free, folder, options))
    result.warn(CalibrationWarning)
    return result


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
            given = replace(options, progress=bar.phase)
            found = calibration.calibrate(finger, recordings, output, given)
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
