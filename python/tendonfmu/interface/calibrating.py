"""Calibrates a finger on free motion (`tendonfmu calibrate`)."""

from __future__ import annotations

import os
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tendonfmu.calibration import Calibration, calibration_page, write_calibration
from tendonfmu.calibration import calibrate as run
from tendonfmu.files import StandIn, write_text
from tendonfmu.model import Finger, FingerSource, description_text, finger_from_data, read_finger
from tendonfmu.options import CalibrateOptions
from tendonfmu.recordings import RecordingSource, listed_sources, read_recordings
from tendonfmu.report import together
from tendonfmu.tasks import PhaseState


class CalibrationWarning(UserWarning):
    """A remark of a calibration on its recordings and its result; also in `CalibrateResult.warnings`."""


@dataclass(frozen=True, eq=False, repr=False)
class CalibrateResult:
    """A calibrated finger.

    Attributes
    ----------
    calibration
        The finished calibration: description, report, and what the page shows.
    """

    calibration: Calibration

    def __repr__(self) -> str:
        return (
            f"<Calibration of {self.finger.name}: {1e3 * together(self.report['error']['calibrated']):.3g} mN·m left>"
        )

    @property
    def finger(self) -> Finger:
        """The calibrated finger."""
        return finger_from_data(self.calibration.data, Path("calibrated"))

    @property
    def report(self) -> Mapping[str, Any]:
        """All results, as calibration.json has them."""
        return self.calibration.report

    @property
    def warnings(self) -> list[str]:
        """Remarks on the recordings and the result, one sentence each."""
        return list(self.report["warnings"])

    def write(self, folder: str | os.PathLike[str]) -> dict[Path, str]:
        """Write the files of `tendonfmu calibrate -o`, the diagnosis with them; returns what each contains."""
        return write_calibration(self.calibration, Path(folder))

    def _repr_html_(self) -> str:
        from html import escape

        return f'<iframe srcdoc="{escape(calibration_page(self.calibration))}" width="100%" height="700"></iframe>'


def calibrate(
    finger: FingerSource,
    free: RecordingSource | Sequence[RecordingSource],
    *,
    test: RecordingSource | Sequence[RecordingSource] | None = None,
    pushes: RecordingSource | Sequence[RecordingSource] | None = None,
    previous: str | os.PathLike[str] | None = None,
    folder: str | os.PathLike[str] | None = None,
    false_alarms_per_hour: float = 6.0,
    kinematics: int = 1,
    seed: int = 0,
    jobs: int = 1,
    progress: Callable[[PhaseState], None] | None = None,
) -> CalibrateResult:
    """Find missing effects, fit all numbers, and tune contact detection, from free motion.

    Parameters
    ----------
    finger
        A finger, its description, or the file of it.
    free, test, pushes
        Recordings, DataFrames or files: free motion; free motion that only judges (None: parts of `free`); and
        recordings with labelled contact. One alone needs no list.
    previous
        Description or fit report of an earlier calibration, as the prior (`--from`), for little data.
    folder
        Folder for the results of the steps: a repeated call goes on there. None: nothing is kept.
    false_alarms_per_hour
        Rate of false alarms in other free motion of the same finger, at most (1/h).
    kinematics
        1 tendon positions, 2 measured joint positions, 3 joint positions and velocities.
    seed, jobs
        Of the random numbers; processor cores, with the same result.
    progress
        Called with each `PhaseState`.

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
    options = CalibrateOptions.of(locals())
    with tempfile.TemporaryDirectory() as scratch:
        described = read_finger(finger)
        given = StandIn.of(Path(scratch) / "finger.json", str(described.path))
        write_text(given, description_text(described.to_dict()))
        groups = [
            _files(Path(scratch) / name, sources)
            for name, sources in (("free", free), ("test", test), ("pushes", pushes))
        ]
        found = run(
            given,
            groups[0],
            Path(scratch) / "calibrated" if folder is None else Path(folder),
            tests=groups[1],
            pushes=groups[2],
            previous=None if previous is None else Path(previous),
            options=options,
            progress=progress,
        )
    for sentence in found.report["warnings"]:
        warnings.warn(sentence, CalibrationWarning, stacklevel=2)
    return CalibrateResult(found)


def _files(folder: Path, sources: RecordingSource | Sequence[RecordingSource] | None) -> list[Path]:
    """Return the files of recordings; those in memory are written into a folder."""
    listed = [] if sources is None else listed_sources(sources)
    files = []
    for source, recording in zip(listed, read_recordings(listed), strict=True):
        if isinstance(source, str | os.PathLike):
            files.append(Path(source))
            continue
        file = folder / f"{Path(recording.path).stem}.parquet"
        while file.exists():
            file = file.with_name(f"{file.stem}_.parquet")
        folder.mkdir(exist_ok=True)
        recording.write(file)
        files.append(StandIn.of(file, str(recording.path)))
    return files
