"""From recordings of free motion to a tuned finger: structure, numbers, thresholds, and their errors.

Its steps are those of `diagnose`, of a fit to all recordings, of `tune` and of `score`, in this order. Their results
stay in the folder, so that a repeated call continues where the previous one ended.

Examples
--------
>>> from tendonfmu.calibration import calibrate
>>> free = ["free_10N.parquet", "free_30N.parquet"]
>>> found = calibrate("finger.json", free, "calibrated", pushes=["pushes.parquet"])
>>> found.report["error"], found.report["detection"], found.data
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from tendonfmu.arrays import Data
from tendonfmu.calibration.fit import CalibratedFit, earlier_finger, fit_again, fit_all, stretches_for_diagnosis
from tendonfmu.calibration.report import (
    OF_PUSH,
    OF_SCORE,
    errors_of,
    left_out,
    record_next,
    recording_of,
    structure_of,
    tuning_of,
    typical_motion,
    typical_push,
)
from tendonfmu.detect import ContactTuning, TuneWarning, require_no_contact, score_recordings
from tendonfmu.detect import score_report as detect_score_report
from tendonfmu.diagnosis import Diagnosis, FitSettings, diagnose
from tendonfmu.errors import InputError
from tendonfmu.estimate import check_given_once, check_unseen, described
from tendonfmu.files import finite, path_of, write_text
from tendonfmu.model import Finger, description_text, read_finger
from tendonfmu.options import CalibrateOptions, ScoreOptions
from tendonfmu.recordings import (
    UNFIT_FOR_SEARCH,
    FitRecording,
    Held,
    Signals,
    admit,
    learn_routing,
    prepare,
    read_recording,
    require_noise,
    routed,
    routing_entry,
)
from tendonfmu.report import MotionShown, PushShown, diagnosis_page, together, write_diagnosis
from tendonfmu.tasks import FOLDER, Phases, PhaseState, Steps, digest_of, digest_of_file

Options = CalibrateOptions  # its name in earlier versions
USUAL = CalibrateOptions()
FORMAT = "tendonfmu-calibration-1"
DIAGNOSIS = "diagnosis"  # folder of the full diagnosis
HELD = Held(0.2, 10.0)  # part of the recordings to measure the errors on if there are no tests
BIAS_TIME = 2.0  # s: a fitted model needs no faster bias, and that learns pushes (docs/evidence/detection.md)
NOTHING_ASKED: dict[str, Any] = {
    "verdict": "not done: the structure is that of the earlier calibration",
    "causes": [],
    "recordings": [],
    "tests": [],
    "unexplained": "",
    "next_experiment": "",
    "warnings": [],
}
PHASES = {
    "reading": 3.0,
    "what the model lacks": 45.0,
    "all its numbers": 20.0,
    "thresholds of contact": 30.0,
    "pushes": 8.0,
}


@dataclass(frozen=True)
class Calibration:
    """A finished calibration."""

    data: Data  # the calibrated description
    report: dict[str, Any]  # `calibration.json`, without the list of files
    # the diagnosis; None if this call did not make it, because it was resumed or not asked for
    diagnosis: Diagnosis | None
    shown: MotionShown  # what it leaves of a typical stretch of unseen motion
    push: PushShown | None  # a typical push of those that it finds


def _of_alarms(options: CalibrateOptions) -> dict[str, float]:
    """Return the options that affect the thresholds only."""
    return {"false_alarms_per_hour": options.false_alarms_per_hour, "confidence": options.confidence}


def _of_all(options: CalibrateOptions) -> dict[str, int]:
    """Return the options that affect all results."""
    return {"kinematics": options.kinematics, "seed": options.seed}


def calibrate(
    finger: Path | str,
    free: Sequence[Path | str],
    folder: Path | str,
    *,
    tests: Sequence[Path | str] = (),
    pushes: Sequence[Path | str] = (),
    previous: Path | str | None = None,
    options: CalibrateOptions = USUAL,
    progress: Callable[[PhaseState], None] | None = None,
) -> Calibration:
    """Calibrate a finger on free motion.

    Parameters
    ----------
    finger
        Description; its structure is kept, and extended by the causes that a diagnosis finds.
    free
        Recordings of free motion.
    folder
        Folder for the results of the steps and the page of the diagnosis.
    tests
        Free motion to measure the errors on. Without it, that is every fifth stretch of 10 s of `free`, which no number
        is fitted to.
    pushes
        Recordings with labelled contact, to count what is found.
    previous
        Description or fit report of an earlier calibration, for little data: its structure stays, and its numbers are
        the prior.
    options
        Further options.
    progress
        Called with the state of the computation.

    Returns
    -------
    Calibration
        Description and report.

    Raises
    ------
    InputError
        A file or an option does not allow a calibration.
    """
    begun = perf_counter()
    phases = Phases(PHASES, progress or (lambda state: None))
    with phases.start("reading"):
        earlier = None if previous is None else path_of(previous)
        case = _read(
            path_of(finger), earlier, [[path_of(file) for file in files] for files in (free, tests, pushes)], options
        )
    run = _Run(case, Path(folder), options, phases)
    report, data = run.report()
    report["seconds"] = perf_counter() - begun
    shown = typical_motion(case.finger.data, data, case.judged, not case.tests)
    return Calibration(data, {key: finite(value) for key, value in report.items()}, run.diagnosed, shown, run.push)


# --- what is given ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Case:
    """The finger to begin with, the file of an earlier calibration or None, and the recordings of a calibration."""

    finger: Finger
    previous: Path | None
    free: list[FitRecording]
    tests: list[FitRecording]
    pushes: list[Path]
    sentences: list[str]
    routing: dict[str, Any] | None  # what was learned of it; None if it is as described

    @property
    def judged(self) -> list[FitRecording]:
        return self.tests or self.free

    @property
    def made_from(self) -> dict[str, Any]:
        from tendonfmu import __version__

        files = [recording.path for recording in (*self.free, *self.tests)]
        return {
            "version": __version__,
            "finger": digest_of({"data": self.finger.data}),
            "previous": None if self.previous is None else digest_of_file(self.previous),
            "recordings": [(file.name, digest_of_file(file)) for file in files],
            "tests": len(self.tests),
        }

    def errors(self, data: Data | None) -> list[float]:
        """Return [n] the error of a description on unseen motion (N·m); that of the bias alone if None."""
        return errors_of(data, self.judged, not self.tests, self.finger.data if data is None else None)


def _finger(file: Path, previous: Path | None) -> Finger:
    """Read the finger to begin with: that of an earlier calibration, if there is one."""
    given = read_finger(file)
    if previous is None:
        return given
    earlier = earlier_finger(given, previous)
    for what, names, other in (
        ("joints", given.joint_names, earlier.joint_names),
        ("tendons", given.tendon_names, earlier.tendon_names),
    ):
        if names != other:
            raise InputError(f"{previous}: {what} {', '.join(other)}; expected {', '.join(names)} as of {file}")
    return earlier


def _read(file: Path, previous: Path | None, recordings: Sequence[list[Path]], options: CalibrateOptions) -> _Case:
    free, tests, pushes = recordings
    finger = _finger(file, previous)
    if not free:
        raise InputError("no recording; expected at least one of free motion")
    check_given_once(free, tests, "a test")
    check_given_once(free, pushes, "one with pushes")
    read, others, touched = ([read_recording(path) for path in group] for group in (free, tests, pushes))
    for recording in (*read, *others):
        require_no_contact(recording)
    given, learned = finger, learn_routing(finger, [*read, *others])
    finger, moved = routed(given, learned)
    routing = routing_entry(given, learned) if moved or any(each.varying for each in learned) else None
    sentences = admit(finger, [*read, *others, *touched], unfit=UNFIT_FOR_SEARCH)
    held = Held() if tests else HELD
    seen = [prepare(finger, recording, options.kinematics, held) for recording in read]
    unseen = [prepare(finger, recording, options.kinematics, Held()) for recording in others]
    require_noise(finger, seen)
    check_unseen(read, others)
    return _Case(finger, previous, seen, unseen, pushes, sentences, routing)


# --- the steps --------------------------------------------------------------------------------------------------------


class _Run:
    """One calibration: each step works on the results of the previous ones."""

    def __init__(self, case: _Case, folder: Path, options: CalibrateOptions, phases: Phases) -> None:
        self._case, self._folder, self._options, self._phases = case, folder, options, phases
        self._steps = Steps(folder, {**case.made_from, **_of_all(options)})
        self._seconds: dict[str, float] = {}
        self.diagnosed: Diagnosis | None = None
        self.push: PushShown | None = None

    def report(self) -> tuple[dict[str, Any], Data]:
        """Return the report, and the calibrated description."""
        case, steps = self._case, self._steps
        if case.previous is None:
            page = self._folder / DIAGNOSIS / diagnosis_page.PAGE
            lacks = self._step("what the model lacks", "diagnosis", {}, self._diagnosis, page)
            fitted = self._step("all its numbers", "fit", {}, lambda step: self._fit(lacks))
        else:
            lacks = NOTHING_ASKED
            fitted = self._step("all its numbers", "refit", {}, lambda step: self._refit())
        tuned = self._step(
            "thresholds of contact", "tune", _of_alarms(self._options), lambda step: self._tune(fitted, step)
        )
        pushed = None
        if case.pushes:
            files = {"pushes": [(file.name, digest_of_file(file)) for file in case.pushes]}
            pushed = self._step(
                "pushes", "score", files, lambda step: self._score(tuned, fitted["error"]["calibrated"], step)
            )
            example = pushed.pop("example", None)  # earlier folders have none
            self.push = None if example is None else PushShown(**example)
        report = {
            "format": FORMAT,
            "finger": case.finger.name,
            "joints": case.finger.joint_names,
            "recordings": [recording_of(recording) for recording in case.free],
            "tests": [recording_of(recording) for recording in case.tests],
            "routing": case.routing,
            "error": fitted["error"],
            "structure": {key: value for key, value in lacks.items() if key not in ("extended", "nominal", "warnings")},
            "detection": {key: value for key, value in tuned.items() if key not in ("finger", "warnings")},
            "pushes": pushed,
            "next": list(record_next(lacks, tuned)),
            "warnings": [
                *case.sentences,
                *(f"{each.path.name}: {text}" for each in (*case.free, *case.tests) for text in each.warnings),
                *lacks["warnings"],
                *fitted["warnings"],
                *tuned["warnings"],
                *([] if pushed is None else pushed["warnings"]),
            ],
            "options": {**_of_all(self._options), **_of_alarms(self._options)},
            "steps": {"seconds": self._seconds, "repeated": steps.repeated},
        }
        return report, tuned["finger"]

    def _step(
        self,
        words: str,
        name: str,
        made_from: Mapping[str, Any],
        compute: Callable[[Callable[[float], None]], dict[str, Any]],
        page: Path | None = None,
    ) -> dict[str, Any]:
        begun = perf_counter()
        with self._phases.start(words, 100) as step:
            result = self._steps.result(name, made_from, lambda: compute(lambda share: step(int(100 * share))), page)
        self._seconds[name] = perf_counter() - begun
        return result

    def _diagnosis(self, step: Callable[[float], None]) -> dict[str, Any]:
        case, options = self._case, self._options
        seen, judged = stretches_for_diagnosis(
            [each.recording for each in case.free], [each.recording for each in case.tests]
        )

        def show(state: PhaseState) -> None:
            part = state.done / state.total if state.total else 0.0
            step((state.number - 1 + part) / state.count)

        diagnosis = diagnose(
            case.finger,
            seen,
            judged,
            kinematics=options.kinematics,
            seed=options.seed,
            jobs=options.jobs,
            checked=True,
            progress=show,
        )
        self.diagnosed = diagnosis
        write_diagnosis(diagnosis, self._folder / DIAGNOSIS)
        return structure_of(diagnosis)

    def _fit(self, lacks: dict[str, Any]) -> dict[str, Any]:
        case = self._case
        smoothed = Signals(**lacks["smoothing"])
        extended = self._fitted(lacks, "extended", smoothed)
        # without presliding, raw signals often serve the given structure better: it gets the better ones
        nominal = [case.errors(self._fitted(lacks, "nominal", signals).data) for signals in {smoothed, Signals()}]
        error = {
            "held_out": not case.tests,
            "bias_only": case.errors(None),
            "as_given": case.errors(case.finger.data),
            "fitted": min(nominal, key=together),
            "calibrated": case.errors(extended.data),
        }
        return {"finger": extended.data, "error": error, "warnings": [*extended.warnings, *left_out(extended.events)]}

    def _refit(self) -> dict[str, Any]:
        """Fit with the previous numbers as the prior; keep those if the new ones are no better on unseen motion."""
        case, options = self._case, self._options
        fitted = fit_again(
            case.finger,
            case.previous or Path(),
            case.free,
            share=0.0 if case.tests else HELD.share,
            kinematics=options.kinematics,
            threads=options.jobs,
        )
        before, after = case.errors(case.finger.data), case.errors(fitted.data)
        error = {"held_out": not case.tests, "bias_only": case.errors(None), "previous": before, "calibrated": after}
        if sum(value**2 for value in after) <= sum(value**2 for value in before):
            return {"finger": fitted.data, "error": error, "warnings": list(fitted.warnings)}
        kept = (
            f"the new numbers leave an error of {1e3 * together(after):.3g} mN·m on unseen motion, "
            f"the earlier ones {1e3 * together(before):.3g}: the earlier ones are kept"
        )
        return {
            "finger": case.finger.data,
            "error": {**error, "calibrated": before},
            "warnings": [*fitted.warnings, kept],
        }

    def _fitted(self, lacks: dict[str, Any], name: str, signals: Signals) -> CalibratedFit:
        """Fit the nominal or the extended description to all recordings."""
        case, options = self._case, self._options
        return fit_all(
            described(case.finger, lacks[name]),
            case.free,
            signals,
            FitSettings(threads=options.jobs, path=case.finger.path),
            given=case.finger.data,
            seed=options.seed,
            uncertainty=name == "extended",
            only_sliding=name == "extended" and lacks.get("fits_sliding", False),  # earlier folders do not say
        )

    def _tune(self, fitted: dict[str, Any], step: Callable[[float], None]) -> dict[str, Any]:
        case, options = self._case, self._options
        tuning = ContactTuning(
            described(case.finger, fitted["finger"]),
            false_alarms_per_hour=options.false_alarms_per_hour,
            confidence=options.confidence,
            kinematics=options.kinematics,
            bias_time=BIAS_TIME,
            progress=lambda done, total: step(done / max(total, 1)),
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TuneWarning)  # the report lists them
            tuning.tune([each.recording for each in (*case.free, *case.tests)], checked=True)
        return tuning_of(tuning)

    def _score(self, tuned: dict[str, Any], left: Sequence[float], step: Callable[[float], None]) -> dict[str, Any]:
        file = self._folder / FOLDER / "tuned.json"
        write_text(file, description_text(tuned["finger"]))
        options = ScoreOptions(kinematics=self._options.kinematics, seed=self._options.seed)
        scored = score_recordings(
            file, self._case.pushes, options, progress=lambda done, total: step(done / max(total, 1))
        )
        report = detect_score_report.build_report(scored)
        return {
            **{key: report[key] for key in OF_SCORE},
            "sizes": detect_score_report.by_size(scored, left),
            "list": [
                {"recording": Path(each["path"]).name, **{key: event[key] for key in OF_PUSH}}
                for each in report["recordings"]
                for event in each["event_list"]
            ],
            "false_alarm_list": [
                {"recording": Path(each["path"]).name, **alarm}
                for each in report["recordings"]
                for alarm in each["false_alarm_list"]
            ],
            "warnings": list(scored.warnings),
            "example": typical_push(scored),
        }
