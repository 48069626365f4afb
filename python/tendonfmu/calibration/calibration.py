"""From recordings of free motion to a tuned finger: structure, numbers, thresholds, and their errors.

All three are chosen on the same motion. The tests, or else every fifth stretch of 10 s, are cut out before anything
else and choose nothing: on them the finished finger runs as it is delivered.

Its steps are those of `diagnose`, of a fit to all recordings, of `tune` and of `score`, in this order. Their results
stay in the folder, so that a repeated call continues where the previous one ended.

Examples
--------
>>> from tendonfmu.calibration import calibrate
>>> free = ["free_10N.parquet", "free_30N.parquet"]
>>> found = calibrate("finger.json", free, "calibrated", CalibrateOptions(pushes=["pushes.parquet"]))
>>> found.report["error"], found.report["detection"], found.finger
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from tendonfmu.calibration.fit import CalibratedFit, earlier_finger, fit_again, fit_all, stretches_for_diagnosis
from tendonfmu.calibration.report import (
    OF_PUSH,
    OF_SCORE,
    Delivered,
    Judged,
    by_size,
    compared,
    left_out,
    record_next,
    recording_of,
    structure_of,
    tuning_of,
    typical_motion,
    typical_push,
    without_held_out,
)
from tendonfmu.detect import ContactTuning, TuneWarning, build_report, require_no_contact, score_recordings
from tendonfmu.diagnosis import Diagnosis, diagnose
from tendonfmu.errors import InputError
from tendonfmu.estimate import check_given_once, check_unseen, unseen_square
from tendonfmu.files import finite, path_of, percent, read_json
from tendonfmu.model import Finger, FingerSource, finger_from_data, read_finger
from tendonfmu.options import CalibrateOptions, RecordingSources, ScoreOptions
from tendonfmu.recordings import (
    UNFIT_FOR_SEARCH,
    FitRecording,
    Held,
    Recording,
    RecordingSource,
    RoutingEntry,
    admit,
    learn_routing,
    listed_sources,
    prepare,
    read_recordings,
    require_noise,
    routed,
    routing_entry,
)
from tendonfmu.report import MotionShown, PushShown, diagnosis_page, write_diagnosis
from tendonfmu.tasks import Phases, PhaseState, Steps, digest_of, digest_of_arrays

USUAL = CalibrateOptions()
FORMAT = "tendonfmu-calibration-1"
DIAGNOSIS = "diagnosis"  # folder of the full diagnosis
HELD = Held(0.2, 10.0)  # part of the recordings that chooses nothing and is judged on if there are no tests
BIAS_TIME = 2.0  # s: a fitted model needs no faster bias, and that learns pushes (docs/evidence/contact.md)
TUNED = ("bias", "contact", "sensor_fault")  # what `tune` learns
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

    finger: Finger  # calibrated
    report: dict[str, Any]  # `calibration.json`, without the list of files
    # the diagnosis; None if this call did not make it, because it was resumed or not asked for
    diagnosis: Diagnosis | None
    shown: MotionShown  # what it leaves of a typical stretch of unseen motion
    push: PushShown | None  # a typical push of those that it finds
    folder: Path  # of its steps and the diagnosis


def calibrate(
    finger: FingerSource,
    free: RecordingSources,
    folder: Path | str | os.PathLike[str],
    options: CalibrateOptions = USUAL,
) -> Calibration:
    """Calibrate a finger on free motion; results of the steps and the page of the diagnosis go to the folder."""
    # Without `test`, every fifth stretch of 10 s of `free` is measured on and used for nothing else. `previous`, for
    # little data: its structure stays, and its numbers are the prior. After Ctrl-C the steps that are done are kept.
    begun = perf_counter()
    phases = Phases(PHASES, options.progress or (lambda state: None))
    with phases.start("reading"):
        case = _read(finger, [listed_sources(each) for each in (free, options.test, options.pushes)], options)
    run = _Run(case, Path(folder), options, phases)
    report, calibrated, shown = run.report()
    report["seconds"] = perf_counter() - begun
    report = {key: finite(value) for key, value in report.items()}
    return Calibration(calibrated, report, run.diagnosed, shown, run.push, Path(folder))


# --- what is given ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Case:
    """The finger to begin with, the file of an earlier calibration or None, and the recordings of a calibration."""

    finger: Finger
    previous: Path | None
    free: list[FitRecording]  # what numbers, structure and thresholds are chosen on
    whole: list[FitRecording]  # the same recordings with what is held out of them
    judged: Judged
    pushes: list[Recording]
    sentences: list[str]
    routing: RoutingEntry | None  # what was learned of it; None if it is as described

    @property
    def tests(self) -> Sequence[FitRecording]:
        return () if self.judged.held_out else self.judged.recordings

    @property
    def made_from(self) -> dict[str, Any]:
        from tendonfmu import __version__

        previous = None if self.previous is None else digest_of(read_json(self.previous, "an earlier calibration"))
        return {
            "version": __version__,
            "finger": digest_of({"data": self.finger.data}),
            "previous": previous,
            "recordings": [_digest(each.recording) for each in self.free],
            "held_out": [HELD.share, HELD.block] if self.judged.held_out else None,
        }


def _refuse_twice(recordings: Sequence[Recording]) -> None:
    """Refuse samples that are given twice, as if they were two measurements."""
    seen: dict[str, Path] = {}
    for recording in recordings:
        _, digest = _digest(recording)
        if digest in seen:
            raise InputError(f"{recording.path}: given twice, as {seen[digest]}; expected each recording once")
        seen[digest] = recording.path


def _digest(recording: Recording) -> tuple[str, str]:
    return recording.path.name, digest_of_arrays(recording.arrays())


def _finger(source: FingerSource, previous: Path | None) -> Finger:
    """Read the finger to begin with: that of an earlier calibration, if there is one."""
    given = read_finger(source)
    if previous is None:
        return given
    earlier = earlier_finger(given, previous)
    for what, names, other in (
        ("joints", given.joint_names, earlier.joint_names),
        ("tendons", given.tendon_names, earlier.tendon_names),
    ):
        if names != other:
            raise InputError(f"{previous}: {what} {', '.join(other)}; expected {', '.join(names)} as of {given.path}")
    return earlier


def _read(source: FingerSource, recordings: Sequence[list[RecordingSource]], options: CalibrateOptions) -> _Case:
    given_free, tests, pushes = recordings
    previous = None if options.previous is None else path_of(options.previous)
    finger = _finger(source, previous)
    if not given_free:
        raise InputError("no recording; expected at least one of free motion")
    check_given_once(given_free, tests, "a test")
    check_given_once(given_free, pushes, "one with pushes")
    read, others, touched = map(read_recordings, recordings)
    _refuse_twice(read)
    check_unseen(read, touched, "one with pushes")
    for recording in (*read, *others, *touched):
        recording.require(finger.joints, finger.tendons, ())
    for recording in (*read, *others):
        require_no_contact(recording)
    held = None if tests else HELD
    used = read if held is None else [without_held_out(recording, held) for recording in read]
    given, learned = finger, learn_routing(finger, used)
    finger, moved = routed(given, learned)
    routing = routing_entry(given, learned) if moved or any(each.varying for each in learned) else None
    sentences = admit(finger, [*read, *others, *touched], unfit=UNFIT_FOR_SEARCH)

    def prepared(listed: Sequence[Recording], apart: Held | None = None) -> list[FitRecording]:
        return [prepare(finger, recording, options.kinematics, apart or Held()) for recording in listed]

    free, whole = prepared(used), prepared(read, held)
    judged = Judged(whole, True) if held else Judged(prepared(others), False)
    require_noise(finger, free)
    check_unseen(read, others)
    return _Case(finger, previous, free, whole, judged, touched, sentences, routing)


# --- the steps --------------------------------------------------------------------------------------------------------


class _Run:
    """One calibration: each step works on the results of the previous ones."""

    def __init__(self, case: _Case, folder: Path, options: CalibrateOptions, phases: Phases) -> None:
        self._case, self._folder, self._options, self._phases = case, folder, options, phases
        self._of_all = {"kinematics": options.kinematics, "seed": options.seed}  # options that affect all results
        self._of_alarms = {"false_alarms_per_hour": options.false_alarms_per_hour}  # and the thresholds only
        self._steps = Steps(folder, {**case.made_from, **self._of_all})
        self._seconds: dict[str, float] = {}
        self.diagnosed: Diagnosis | None = None
        self.push: PushShown | None = None

    def report(self) -> tuple[dict[str, Any], Finger, MotionShown]:
        """Return the report, the calibrated finger, and what it leaves of a typical stretch."""
        case, steps = self._case, self._steps
        if case.previous is None:
            page = self._folder / DIAGNOSIS / diagnosis_page.PAGE
            lacks = self._step("what the model lacks", "diagnosis", {}, self._diagnosis, page)
            fitted = self._step("all its numbers", "fit", {}, lambda step: self._fit(lacks))
        else:
            lacks = NOTHING_ASKED
            fitted = self._step("all its numbers", "refit", {}, lambda step: self._refit())
        tuned = self._step("thresholds of contact", "tune", self._of_alarms, lambda step: self._tune(fitted, step))
        calibrated = finger_from_data(tuned["finger"], Path("calibrated"))
        before, after = (Delivered(finger, case.judged) for finger in (case.finger, calibrated))
        error = compared(before, after, case.judged, "previous" if case.previous else "as_given")
        pushed = None
        if case.pushes:
            files = {"pushes": list(map(_digest, case.pushes))}
            left = error["calibrated"]
            pushed = self._step("pushes", "score", files, lambda step: self._score(calibrated, left, step))
            example = pushed.pop("example")
            self.push = None if example is None else PushShown(**example)
        report = {
            "format": FORMAT,
            "finger": case.finger.name,
            "joints": case.finger.joint_names,
            "recordings": [recording_of(recording) for recording in case.whole],
            "tests": [recording_of(recording) for recording in case.tests],
            "routing": case.routing,
            "error": error,
            "alarms": after.alarms(),
            "structure": {key: value for key, value in lacks.items() if key not in ("extended", "nominal", "warnings")},
            "detection": {key: value for key, value in tuned.items() if key not in ("finger", "warnings")},
            "pushes": pushed,
            "next": list(record_next(lacks, tuned)),
            "warnings": [
                *case.sentences,
                *(f"{each.path.name}: {text}" for each in (*case.whole, *case.tests) for text in each.warnings),
                *lacks["warnings"],
                *fitted["warnings"],
                *tuned["warnings"],
                *([] if pushed is None else pushed["warnings"]),
            ],
            "options": {**self._of_all, **self._of_alarms},
            "steps": {"seconds": self._seconds, "repeated": steps.repeated},
        }
        return report, calibrated, typical_motion(before, after, case.judged)

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
            try:
                result = self._steps.result(
                    name, made_from, lambda: compute(lambda share: step(int(100 * share))), page
                )
            except KeyboardInterrupt:
                done = f"{', '.join(self._seconds)} done" if self._seconds else "no step done yet"
                raise KeyboardInterrupt(f"{done}; the same call goes on from there, with {self._folder}") from None
        self._seconds[name] = perf_counter() - begun
        return result

    def _diagnosis(self, step: Callable[[float], None]) -> dict[str, Any]:
        case, options = self._case, self._options
        seen, judged = stretches_for_diagnosis([each.recording for each in case.free])

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
        """Fit the extended description to all recordings, and to four fifths of them."""
        case, options = self._case, self._options

        settings: dict[str, int] = {"threads": options.jobs, "seed": options.seed}
        whole = fit_all(case.finger.with_data(lacks["extended"]), case.free, **settings)
        most = fit_all(whole.finger, self._most(), **settings)
        return {
            "finger": whole.finger.data,
            "most": most.finger.data,
            "warnings": [*whole.warnings, *left_out(whole.events)],
        }

    def _refit(self) -> dict[str, Any]:
        """Fit with the previous numbers as the prior; keep those if new ones are no better on motion set apart."""
        case, inner = self._case, self._most()
        most = self._fitted_again([without_held_out(each.recording, HELD) for each in case.free])
        before, after = (unseen_square(each, inner) for each in (case.finger, most.finger))
        if after <= before:
            whole = self._fitted_again([each.recording for each in case.free])
            return {"finger": whole.finger.data, "most": most.finger.data, "warnings": list(whole.warnings)}
        kept = (
            f"fitted to four fifths of the motion, new numbers leave {percent((after / before) ** 0.5 - 1.0)} more of "
            "the last fifth than the earlier ones: the earlier ones are kept"
        )
        return {"finger": case.finger.data, "most": case.finger.data, "warnings": [*most.warnings, kept]}

    def _most(self) -> list[FitRecording]:
        """Return the motion to choose on with a fifth set apart, which shows what a fit leaves of other motion."""
        finger, kinematics = self._case.finger, self._options.kinematics
        return [prepare(finger, each.recording, kinematics, HELD) for each in self._case.free]

    def _fitted_again(self, recordings: Sequence[Recording]) -> CalibratedFit:
        case, options = self._case, self._options
        assert case.previous is not None
        return fit_again(case.finger, case.previous, recordings, kinematics=options.kinematics, threads=options.jobs)

    def _tune(self, fitted: dict[str, Any], step: Callable[[float], None]) -> dict[str, Any]:
        """Choose thresholds with the numbers of most motion, which does not fit the rest better than other motion."""
        case, options = self._case, self._options
        tuning = ContactTuning(
            case.finger.with_data(fitted["most"]),
            false_alarms_per_hour=options.false_alarms_per_hour,
            kinematics=options.kinematics,
            bias_time=BIAS_TIME,
            progress=lambda done, total: step(done / max(total, 1)),
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TuneWarning)  # the report lists them
            tuning.tune([each.recording for each in case.free], checked=True)
        report = tuning_of(tuning)
        tuned = {key: report["finger"].get(key) for key in TUNED}
        start = (fitted["finger"].get("bias") or {}).get("initial_torque")
        if start is not None:
            tuned["bias"] = {**tuned["bias"], "initial_torque": start}
        kept = {key: value for key, value in fitted["finger"].items() if key not in TUNED}
        return {**report, "finger": {**kept, **{key: value for key, value in tuned.items() if value is not None}}}

    def _score(self, finger: Finger, left: Sequence[float], step: Callable[[float], None]) -> dict[str, Any]:
        options = ScoreOptions(kinematics=self._options.kinematics, seed=self._options.seed)
        scored = score_recordings(
            finger, self._case.pushes, options, progress=lambda done, total: step(done / max(total, 1))
        )
        report = build_report(scored)

        def of(key: str) -> list[tuple[str, dict[str, Any]]]:
            return [(Path(each["path"]).name, row) for each in report["recordings"] for row in each[key]]

        return {
            **{key: report[key] for key in OF_SCORE},
            "sizes": by_size(scored, left),
            "list": [{"recording": name, **{key: event[key] for key in OF_PUSH}} for name, event in of("event_list")],
            "false_alarm_list": [{"recording": name, **alarm} for name, alarm in of("false_alarm_list")],
            "warnings": list(scored.warnings),
            "example": typical_push(scored),
        }
