"""The demo: every step on built-in data, from free motion to a tuned FMU. This module computes and prints nothing.

Five chapters:

- calibrate: a two-joint finger is calibrated on a minute of motion;
- detect: pushes on an index finger are detected, which was calibrated on 27 min of motion;
- diagnose: what the model of the two-joint finger lacked, which is unknown to the demo, and the gain on parts of the
  recording that were not used for fitting;
- fit: the numbers of the two-joint finger alone;
- run: the FMU of the index finger runs over free motion.

One page shows all of them. If the installation cannot estimate, the chapters of the two-joint finger are left out.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import as_file
from pathlib import Path
from typing import TYPE_CHECKING

from tendonfmu.demo.figures import compensated_sheet
from tendonfmu.demo.run import DATA, IndexFinger
from tendonfmu.errors import InputError
from tendonfmu.estimate import ESTIMATION_MISSING, HAS_ESTIMATION
from tendonfmu.files import check_output_folder
from tendonfmu.report import drawn, write_figures
from tendonfmu.tasks import PhaseState

if TYPE_CHECKING:
    from tendonfmu.calibration import Calibration
    from tendonfmu.diagnosis import Diagnosis
    from tendonfmu.estimate import FitProgress, FrictionFit

TWO_JOINTS, TRAINING, UNSEEN = "two_joints.json", "two_joints_training.parquet", "two_joints_unseen.parquet"
CALIBRATION, FIT = "calibration", "fit"  # folders of the full pages
FITTED = "fitted.json"
ESTIMATING = ("calibrate", "diagnose", "fit")  # chapters that need the estimation, which some installations lack

Phase = Callable[[str, int, int | None], None]


@dataclass(frozen=True)
class Chapter:
    """A chapter of the demo."""

    name: str
    title: str
    run: Callable[[Phase], None]


class Story:
    """The demo in a folder: its chapters run in order, and `write_story` (page.py) then writes the page."""

    calibration: Calibration  # results of these chapters
    diagnosis: Diagnosis  # diagnosis of the calibration
    fit: FrictionFit

    def __init__(self, folder: Path) -> None:
        check_output_folder(folder)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder}: cannot be made ({error.strerror})") from None
        self.folder = folder
        self.finger = IndexFinger(folder)
        self._files: dict[Path, str] = {}
        all_chapters = (
            Chapter("calibrate", "From free motion to a tuned FMU", self._calibrate),
            Chapter("detect", "Contact without a touch sensor", self._detect),
            Chapter("diagnose", "What the model got wrong, and why", self._diagnose),
            Chapter("fit", "Its numbers alone, and how well they are known", self._fit),
            Chapter("run", "What the joints feel, friction subtracted", self._run),
        )
        self.chapters = [chapter for chapter in all_chapters if HAS_ESTIMATION or chapter.name not in ESTIMATING]
        self.missing = "" if HAS_ESTIMATION else f"{', '.join(ESTIMATING)} are left out: {ESTIMATION_MISSING}"

    @property
    def files(self) -> dict[Path, str]:
        """Each file with its content in words, in the order of the story, the page first."""
        return {**self._files, **self.finger.files}

    def add_page(self, page: Path) -> None:
        """Put the page of the whole story before all other files."""
        self._files = {page: "the whole demo, for a browser", **self._files}

    def _calibrate(self, phase: Phase) -> None:
        from tendonfmu.calibration import calibrate, write_calibration
        from tendonfmu.tasks import forget_steps

        def show(state: PhaseState) -> None:
            phase(state.words, state.done, state.total)

        folder = self.folder / CALIBRATION
        forget_steps(folder)  # of an earlier demo: this one shows every step
        with as_file(DATA) as data:
            calibration = calibrate(data / TWO_JOINTS, [data / TRAINING], folder, tests=[data / UNSEEN], progress=show)
        assert calibration.diagnosis is not None, "no step was there to be repeated"
        self.calibration, self.diagnosis = calibration, calibration.diagnosis
        phase("writing", 0, None)
        self._files |= write_calibration(calibration, folder)

    def _detect(self, phase: Phase) -> None:
        self.finger.pushes(lambda done, total: phase("running the FMU", done, total))

    def _diagnose(self, phase: Phase) -> None:
        """Do nothing: the chapter shows what the calibration has found."""

    def _fit(self, phase: Phase) -> None:
        from tendonfmu.estimate import FitWarning, FrictionFit
        from tendonfmu.files import write_text
        from tendonfmu.report import write_fit_page

        def show(now: FitProgress) -> None:
            phase(f"fitting: {now.phase}", now.done, now.total)

        with as_file(DATA) as data, warnings.catch_warnings():
            warnings.simplefilter("ignore", FitWarning)  # the page of the fit lists them
            self.fit = FrictionFit(data / TWO_JOINTS, progress=show).fit(data / TRAINING, compare=data / UNSEEN)
        phase("drawing the fit", 0, None)
        folder = self.folder / FIT
        page, *_ = write_fit_page(self.fit.picture(), folder)
        write_text(folder / FITTED, self.fit.description_text())
        self._files |= {page: "all of the fit", folder / FITTED: "the fitted description"}

    def _run(self, phase: Phase) -> None:
        self.finger.free_motion(lambda done, total: phase("running the FMU", done, total))
        (figure,) = write_figures(drawn([compensated_sheet(self.finger)]), self.folder)
        self.finger.files[figure] = "torques, what is left of them, contacts"
