"""What the sentences, tiles and rows of a calibration say."""

from __future__ import annotations

import math
from typing import Any

from tendonfmu.calibration.text import size_rows, tiles, verdict
from tendonfmu.report.kit import together


def report(given: float, calibrated: float, causes: int, alarms: int = 0) -> dict[str, Any]:
    pretension = {"mean_force": 10.0, "as_given": [given, given], "calibrated": [0.5 * calibrated, calibrated]}
    return {
        "joints": ["mcp", "pip"],
        "error": {
            "as_given": [given, given],
            "calibrated": [calibrated, calibrated],
            "pretensions": [
                pretension,
                pretension | {"mean_force": 20.0, "calibrated": [calibrated, 1.5 * calibrated]},
            ],
        },
        "structure": {"causes": [{}] * causes},
        "alarms": {"alarms": alarms, "minutes": 27.0, "interval": [2.0 * alarms, 9.0]},
        "detection": {"false_alarms_per_hour": 6.0, "pushes": {"within_s": 0.06, "torque": [0.02, 0.01]}},
        "pushes": None,
    }


def test_the_verdict_is_one_sentence_with_the_figures() -> None:
    tone, sentence = verdict(report(0.0142, 0.00614, 3))
    assert tone == "good" and "from 14.2 to 6.14 mN·m" in sentence and "3 causes" in sentence
    assert sentence.endswith("No false alarm in 27 min of that motion; at most 6 an hour were asked for.")
    sentence = verdict(report(0.0142, 0.00614, 3, 4))[1]
    assert sentence.endswith("and there are more: with 95 % confidence 8.00 to 9.00 an hour.")
    tone, sentence = verdict(report(0.005, 0.006, 0))
    assert tone == "bad" and "no better" in sentence
    tone, sentence = verdict(report(0.0065, 0.006, 0))
    assert tone == "" and "larger at pip at 20 N: 6.50 before, 9.00 now" in sentence


def test_the_tiles_show_the_worst_joint() -> None:
    shown = list(tiles(report(0.0142, 0.00614, 3, 4)))
    assert shown[2][:2] == ("4", "in 27 min") and "at most 6 an hour were asked for" in shown[2][2]
    assert shown[3][0] == "20.0" and "found within 60 ms, nine of ten, at mcp" in shown[3][2]


def test_pushes_are_told_by_size() -> None:
    rows = [
        {"from": 0.0, "below": 1.5, "events": 4, "found": 1, "interval": [0.1, 0.8]},
        {"from": 1.5, "below": 3.0, "events": 4, "found": 2, "interval": [0.1, 0.8]},
        {"from": 6.0, "below": None, "events": 4, "found": 4, "interval": [0.4, 1.0]},
    ]
    found = size_rows({"pushes": {"sizes": rows}})
    assert [row[0] for row in found] == ["below 1.5 times", "1.5 to 3 times", "6 times and more"]
    assert found[2][1:] == ("4 of 4", "40 to 100 %")
    assert size_rows({"pushes": None}) == [] and math.isclose(together([3.0, 4.0]), math.sqrt(12.5))
