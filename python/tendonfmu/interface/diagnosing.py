"""Finds what a model gets wrong, or what has changed (`tendonfmu diagnose`)."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tendonfmu.diagnosis import Cause, reported_causes
from tendonfmu.diagnosis import Diagnosis as Found
from tendonfmu.diagnosis import diagnose as find
from tendonfmu.estimate import check_given_once
from tendonfmu.model import Finger, FingerSource, finger_from_data
from tendonfmu.options import DiagnoseOptions
from tendonfmu.recordings import RecordingSource, listed_sources
from tendonfmu.report import build_report, diagnosis_sheets, diagnosis_text, html_of, write_diagnosis
from tendonfmu.statistics import Interval
from tendonfmu.tasks import PhaseState


class DiagnosisWarning(UserWarning):
    """A remark of a diagnosis on its recordings and its result; also in `Diagnosis.warnings`."""


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis:
    """What a model gets wrong, or what has changed, and what correcting it gains.

    Attributes
    ----------
    found
        The finished diagnosis, with everything that it found.
    """

    found: Found

    def __repr__(self) -> str:
        causes = ", ".join(cause.effect for cause in self.causes) or "no cause"
        return f"<Diagnosis of {self.found.finger}: {self.verdict}; {causes}>"

    @property
    def verdict(self) -> str:
        """One of "adequate", "explained", "partly explained" and "unexplained"."""
        return self.found.verdict

    @property
    def causes(self) -> tuple[Cause, ...]:
        """The causes in order of their gain, as in diagnosis.json: `effect`, `joint`, `tendon`, `gain`, `size`, ..."""
        return tuple(reported_causes(self.found))

    @property
    def gain(self) -> Interval:
        """Share of the rms on unseen data that the causes remove, with its 95 % interval: `value`, `low`, `high`."""
        return self.found.gain

    @property
    def extended(self) -> Finger:
        """The finger with its causes, fitted."""
        return finger_from_data(self.found.extended_data, Path("extended"))

    @property
    def nominal(self) -> Finger:
        """The given structure, fitted."""
        return finger_from_data(self.found.nominal_data, Path("nominal"))

    @property
    def report(self) -> Mapping[str, Any]:
        """All results, as diagnosis.json has them."""
        return build_report(self.found, [])

    @property
    def warnings(self) -> list[str]:
        """Remarks on the recordings and the result, one sentence each."""
        return list(self.found.warnings)

    def write(self, folder: str | os.PathLike[str]) -> dict[Path, str]:
        """Write page, report, both fingers and the FMU, as `tendonfmu diagnose -o`.

        Parameters
        ----------
        folder
            Output folder; it is made if missing.

        Returns
        -------
        dict of Path to str
            What each file contains.

        Raises
        ------
        InputError
            The files cannot be written. The folder is then as before.
        """
        return write_diagnosis(self.found, Path(folder))

    def plot(self, residuals: bool = True) -> Any:
        """Draw the evidence for each cause, then the residual at each joint, before and after.

        Parameters
        ----------
        residuals
            Whether the residuals are drawn, eight panels a joint.

        Returns
        -------
        plotly.graph_objects.Figure
            The figures of diagnosis.html.
        """
        from tendonfmu.drawing import sheets_figure

        sheets = [sheet for sheet in diagnosis_sheets(self.found) if residuals or sheet.section != "views"]
        return sheets_figure(repr(self)[1:-1], sheets)

    def _repr_html_(self) -> str:
        tables, lines = diagnosis_text.tables(self.found), diagnosis_text.lines(self.found)
        return html_of(repr(self)[1:-1], tables, lines, self.warnings)


def diagnose(
    finger: FingerSource,
    recordings: RecordingSource | Sequence[RecordingSource],
    *,
    test: RecordingSource | Sequence[RecordingSource] = (),
    reference: RecordingSource | Sequence[RecordingSource] | None = None,
    kinematics: int = 1,
    least_gain: float = 0.03,
    seed: int = 0,
    jobs: int = 1,
    progress: Callable[[PhaseState], None] | None = None,
) -> Diagnosis:
    """Show what the model gets wrong, name the cause, add it to the model and measure the gain.

    The given structure is fitted first: a cause is what no fit of it can explain. With `reference` a cause is what has
    changed since.

    Parameters
    ----------
    finger
        A finger, its description, or the file of it.
    recordings
        Free motion: recordings, DataFrames or files. One alone needs no list.
    test
        Recordings to measure the gain on, not to fit; without any, parts of `recordings`.
    reference
        Recordings of the same finger when it was well.
    kinematics
        1 tendon positions, 2 measured joint positions, 3 joint positions and velocities.
    least_gain
        Least drop of the rms on unseen data for a cause, 0 to 0.5.
    seed
        Seed of the random numbers.
    jobs
        Processor cores to use; no effect on the result.
    progress
        Called with the phase and what is done of it.

    Returns
    -------
    Diagnosis
        Verdict, causes, gain and the extended finger.

    Raises
    ------
    InputError
        A file or an option is at fault.

    Warns
    -----
    DiagnosisWarning
        Remarks on the recordings and the result; also in `Diagnosis.warnings`.
    """
    options = DiagnoseOptions.of(locals())
    now, tests = listed_sources(recordings), listed_sources(test)
    before = [] if reference is None else listed_sources(reference)
    check_given_once(now, tests, "a test")
    check_given_once([*now, *tests], before, "the reference")
    diagnosis = find(finger, now, tests, reference=before or None, progress=progress, **vars(options))
    for sentence in diagnosis.warnings:
        warnings.warn(sentence, DiagnosisWarning, stacklevel=2)  # at the call of tendonfmu.diagnose
    return Diagnosis(diagnosis)
