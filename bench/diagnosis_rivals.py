"""Other ways of explaining a recording, on the very residual and columns of `diagnose`.

- correlation, bic, random_cv, sindy: rival_selection.py (sindy needs PySINDy);
- knockoffs: rival_knockoffs.py (needs knockpy);
- parity: rival_parity.py, the structural-residual test of fault diagnosis;
- discrepancy: rival_discrepancy.py, a Gaussian process that predicts and names nothing.

    tendonfmu campaign cases.json -o campaign --beside bench/diagnosis_rivals.py:beside
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from pathlib import Path

from rival_columns import plain
from rival_discrepancy import gain_of_discrepancy
from rival_knockoffs import by_knockoffs
from rival_parity import by_parity
from rival_selection import by_bic, by_correlation, by_random_cv, by_sindy, stepwise
from tendonfmu.diagnosis.campaign.cases import Case
from tendonfmu.diagnosis.campaign.judging import Answer
from tendonfmu.diagnosis.cause_search import View, look
from tendonfmu.diagnosis.extension_fit import FitSettings
from tendonfmu.diagnosis.signal_choice import choose
from tendonfmu.model.balance import moment_arms
from tendonfmu.model.description import read_finger
from tendonfmu.recordings.prepared import FitRecording, Held, prepare
from tendonfmu.recordings.recording import read_recording


def answers(view: View) -> dict[str, Answer]:
    """What each rival says of the residual, first things first. sindy and knockoffs only where they are installed."""
    data = plain(view)
    found = {
        "correlation": stepwise(data, by_correlation),
        "bic": stepwise(data, by_bic),
        "random_cv": stepwise(data, by_random_cv),
    }
    for name, rival in (("sindy", by_sindy), ("knockoffs", by_knockoffs)):
        with contextlib.suppress(ModuleNotFoundError):
            found[name] = rival(data)
    named = {name: Answer([trial.where for trial in trials]) for name, trials in found.items()}
    parity = by_parity(data, moment_arms(view.data), view.series.step)
    return {**named, "parity": Answer(parity.causes, one_of=True, alarm=bool(parity.fired.any()))}


def beside(case: Case) -> Mapping[str, Answer]:
    """For `tendonfmu campaign --beside`: the rivals on a case, from the signals that `diagnose` chooses."""
    assert case.finger is not None
    finger = read_finger(case.finger)

    def prepared(paths: Sequence[Path]) -> list[FitRecording]:
        return [prepare(finger, read_recording(path), case.kinematics, Held()) for path in paths]

    recordings = prepared(case.recordings)
    chosen = choose(finger, recordings, FitSettings(threads=1))
    found = answers(look(chosen.nominal.data, chosen.recordings, chosen.grid, chosen.least))
    if case.test:
        nominal = chosen.online(chosen.nominal.data)
        found["discrepancy"] = Answer(gain=gain_of_discrepancy(nominal, recordings, prepared(case.test)))
    return found
