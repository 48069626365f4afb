"""The demo: the whole story on built-in data, from tendon forces to a named cause. Computes, prints nothing.

Four chapters, in this order: an FMU run over recordings of the index finger; the numbers of a two-joint finger fitted;
pushes on the index finger detected; and what the two-joint finger's model lacks, which the demo is not told, found,
named, built into the model and measured on a recording that nobody has seen. One page tells all of it. Where the
installation cannot estimate, the second and the last chapter are left out.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import as_file
from pathlib import Path
from typing import TYPE_CHECKING

from tendonfmu.demo_run import DATA, IndexFinger
from tendonfmu.errors import InputError
from tendonfmu.estimation import ESTIMATION_MISSING, HAS_ESTIMATION
from tendonfmu.phases import PhaseState

if TYPE_CHECKING:
    from tendonfmu.diagnosis_result import Diagnosis
    from tendonfmu.fit_methods import Progress
    from tendonfmu.fitting import FrictionFit

TWO_JOINTS, TRAINING, UNSEEN = "two_joints.json", "two_joints_training.parquet", "two_joints_unseen.parquet"
FIT, DIAGNOSIS = "fit", "diagnosis"  # folders of the full pages
FITTED = "fitted.json"
ESTIMATING = ("fit", "diagnose")  # chapters that need what not every installation has

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
    """The demo in a folder: the chapters are run one by one, in order; `write` then makes the page of all of them.

    finger: of run and detect. fit, diagnosis: of theirs. files: path -> what is in it. missing: why chapters are left
    out, empty if none is.
    """

    fit: FrictionFit
    diagnosis: Diagnosis

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
            Chapter("run", "What the joints feel, friction subtracted", self._run),
            Chapter("fit", "Friction learned from motion", self._fit),
            Chapter("detect", "Contact without a touch sensor", self._detect),
            Chapter("diagnose", "What the model gets wrong, and why", self._diagnose),
        )
        self.chapters = [each for each in told if HAS_ESTIMATION or each.name not in ESTIMATING]
        self.missing = "" if HAS_ESTIMATION else f"{' and '.join(ESTIMATING)} are left out: {ESTIMATION_MISSING}"

    @property
    def files(self) -> dict[Path, str]:
        """In the order of the story, the page first."""
        return {**self._files, **self.finger.files}

    def write(self) -> Path:
        """The page of the whole story."""
        from tendonfmu.demo_page import PAGE, write_story

        page = self.folder / PAGE
        write_story(self, page)
        self._files = {page: "the whole story, to be read in a browser", **self._files}
        return page

    def _run(self, phase: Phase) -> None:
        self.finger.free_motion(lambda done, total: phase("running the FMU", done, total))

    def _fit(self, phase: Phase) -> None:
        from tendonfmu.fit_files import write_text
        from tendonfmu.fit_page import write_fit_page
        from tendonfmu.fitting import FitWarning, FrictionFit

        def show(now: Progress) -> None:
            phase(f"fitting: {now.phase}", now.done, now.total)

        with as_file(DATA) as data, warnings.catch_warnings():
            warnings.simplefilter("ignore", FitWarning)  # they are on the fit's page
            self.fit = FrictionFit(data / TWO_JOINTS, progress=show).fit(data / TRAINING, compare=data / UNSEEN)
        phase("drawing the fit", 0, None)
        folder = self.folder / FIT
        page, *_ = write_fit_page(self.fit.picture(), folder)
        write_text(folder / FITTED, self.fit.description_text())
        self._files |= {page: "all of the fit", folder / FITTED: "the fitted description"}

    def _detect(self, phase: Phase) -> None:
        self.finger.pushes(lambda done, total: phase("running the FMU", done, total))

    def _diagnose(self, phase: Phase) -> None:
        from tendonfmu.diagnosis import diagnose
        from tendonfmu.diagnosis_files import write_diagnosis

        def show(state: PhaseState) -> None:
            phase(state.words, state.done, state.total)

        with as_file(DATA) as data:
            self.diagnosis = diagnose(data / TWO_JOINTS, [data / TRAINING], [data / UNSEEN], progress=show)
        phase("writing", 0, None)
        written = write_diagnosis(self.diagnosis, self.folder / DIAGNOSIS)
        named = ("diagnosis.html", "diagnosis.json", "extended.json", "extended.fmu")
        self._files |= {file: what for file, what in written.items() if file.name in named}
        self._files[self.folder / DIAGNOSIS / "diagnosis.html"] = "all of the diagnosis"
