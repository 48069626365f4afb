"""The search for causes by itself: a tenth of a diagnosis's time, for campaigns that only count names."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tendonfmu.campaign_cases import Case
from tendonfmu.description import read_finger
from tendonfmu.diagnosis_result import Event, Where
from tendonfmu.diagnosis_search import search
from tendonfmu.diagnosis_series import Trial
from tendonfmu.fit_recordings import Held, prepare
from tendonfmu.recording import read_recording


@dataclass(frozen=True)
class Named:
    """A cause: where it is, what it may be confused with, and its family-wise p."""

    where: Where
    confusable_with: tuple[Where, ...]
    p_value: float


def find_names(case: Case) -> tuple[list[Named], tuple[Event, ...]]:
    """Causes, the largest gain first, and events, as `diagnose` finds them before it measures anything."""
    assert case.finger is not None
    finger = read_finger(Path(case.finger))
    recordings = [prepare(finger, read_recording(path), case.kinematics, Held()) for path in case.recordings]
    found = search(finger.data, recordings, case.seed, lambda what, done, total: None, 1)
    causes = [
        Named(_where(cause.found.trial), tuple(_where(each) for each in cause.found.alike), cause.found.p_value)
        for cause in found.causes
    ]
    return causes, found.events


def _where(trial: Trial) -> Where:
    return Where(trial.effect, trial.joint, trial.tendon)
