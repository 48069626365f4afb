"""The demo: the whole story on built-in data, from free motion to a tuned FMU. Computes, prints nothing.

Five chapters: a two-joint finger is calibrated on a minute of motion; pushes on an index finger are detected that was
calibrated on 27 min; what the two-joint finger's model lacked, which the demo is not told, is looked at, with the gain
on a recording that nobody has seen; its numbers are fitted alone; and the index finger's FMU runs over free motion. One
page tells all of it. Where the installation cannot estimate, the chapters of the two-joint finger are left out.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import as_file
from pathlib import Path
from typing import TYPE_CHECKING

from tendonfmu.demo.run import DATA, IndexFinger
from tendonfmu.errors import InputError
from tendonfmu.estimate import ESTIMATION_MISSING, HAS_ESTIMATION
from tendonfmu.tasks import PhaseState

if TYPE_CHECKING:
    from tendonfmu.calibrate import Calibration
    from tendonfmu.diagnose import Diagnosis
    from tendonfmu.estimate import FitProgress, FrictionFit

TWO_JOINTS, TRAINING, UNSEEN = "two_joints.json", "two_joints_training.parquet", "two_joints_unseen.parquet"
CALIBRATION, FIT = "calibration", "fit"  # folders of the full pages
FITTED = "fitted.json"
ESTIMATING = ("calibrate", "diagnose", "fit")  # chapters that need what not every installation has

Phase = Callable[[str, int, int | None], None]


@dataclass(frozen=True)
class Chapter:
    """name: a word. title: what it is about. run: tells it; called with a function that
    gets what is being done, how much of it is done, and of how much (None: unknown).
    """

    name: str
    title: str
    run: Callable[[Phase], None]


class Story:
    """The demo in a folder: the chapters are run one by one, in order; `write_story` (page.py) then makes the page.

    finger: of detect and run. calibration, fit: of theirs. diagnosis: of the calibration. files: path -> what is in it.
    missing: why chapters are left out, empty if none is.
    """

    calibration: Calibration
    diagnosis: Diagnosis
    fit: FrictionFit

    def __init__(self, folder: Path) -> None:
        """Raises InputError where the folder cannot be made."""
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder}: cannot be made ({error.strerror})") from None
        self.folder = folder
        self.finger = IndexFinger(folder)
        self._files: dict[Path, str] = {}
        told = (
            Chapter("calibrate", "From free motion to a tuned FMU", self._calibrate),
            Chapter("detect", "Contact without a touch sensor", self._detect),
            Chapter("diagnose", "What the model got wrong, and why", self._diagnose),
            Chapter("fit", "Its numbers alone, and how well they are known", self._fit),
            Chapter("run", "What the joints feel, friction subtracted", self._run),
        )
        self.chapters = [each for each in told if HAS_ESTIMATION or each.name not in ESTIMATING]
        self.missing = "" if HAS_ESTIMATION else f"{', '.join(ESTIMATING)} are left out: {ESTIMATION_MISSING}"

    @property
    def files(self) -> dict[Path, str]:
        """In the order of the story, the page first."""
        return {**self._files, **self.finger.files}

    def add_page(self, page: Path) -> None:
        """Puts the page of the whole story before all other files."""
        self._files = {page: "the whole story, to be read in a browser", **self._files}

    def _calibrate(self, phase: Phase) -> None:
        from tendonfmu.calibrate import calibrate, write_calibration
        from tendonfmu.tasks import forget_steps

        def show(state: PhaseState) -> None:
            phase(state.words, state.done, state.total)

        folder = self.folder / CALIBRATION
        forget_steps(folder)  # of an earlier demo: this one shows the work
        with as_file(DATA) as data:
            found = calibrate(data / TWO_JOINTS, [data / TRAINING], folder, tests=[data / UNSEEN], progress=show)
        assert found.diagnosis is not None, "no step was there to be repeated"
        self.calibration, self.diagnosis = found, found.diagnosis
        phase("writing", 0, None)
        self._files |= write_calibration(found, folder)

    def _detect(self, phase: Phase) -> None:
        self.finger.pushes(lambda done, total: phase("running the FMU", done, total))

    def _diagnose(self, phase: Phase) -> None:
        """A closer look at what the calibration has found."""

    def _fit(self, phase: Phase) -> None:
        from tendonfmu.estimate import FitWarning, FrictionFit
        from tendonfmu.files import write_text
        from tendonfmu.report import write_fit_page

        def show(now: FitProgress) -> None:
            phase(f"fitting: {now.phase}", now.done, now.total)

        with as_file(DATA) as data, warnings.catch_warnings():
            warnings.simplefilter("ignore", FitWarning)  # they are on the fit's page
            self.fit = FrictionFit(data / TWO_JOINTS, progress=show).fit(data / TRAINING, compare=data / UNSEEN)
        phase("drawing the fit", 0, None)
        folder = self.folder / FIT
        page, *_ = write_fit_page(self.fit.picture(), folder)
        write_text(folder / FITTED, self.fit.description_text())
        self._files |= {page: "all of the fit", folder / FITTED: "the fitted description"}

    def _run(self, phase: Phase) -> None:
        self.finger.free_motion(lambda done, total: phase("running the FMU", done, total))
