"""An option of a wrong type or out of range is refused by name, with the types and ranges of the commands."""

from __future__ import annotations

import inspect
import math
import types
import typing
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from repository_paths import ROOT

pytest.importorskip("tendonfmu._native", reason="SKIPPED: tendonfmu is not installed")

import tendonfmu as tf
from tendonfmu.cli import build, detect, diagnose, fit, run
from tendonfmu.interface.options import OPTIONS, Kind, Number, Paths, Texts, read_option

DEMO = ROOT / "examples/demo_recording"
FINGER, RECORDING = DEMO / "two_joints.json", DEMO / "two_joints_training.parquet"
COMMANDS: list[tuple[Callable[..., Any], Callable[..., Any]]] = [
    (build.build, tf.build),
    (run.run, tf.run),
    (fit.fit, tf.fit),
    (detect.tune, tf.tune),
    (detect.score, tf.score),
    (diagnose.diagnose, tf.diagnose),
]
SOURCES = {"test", "reference", "compare"}


@pytest.mark.parametrize(
    ("function", "options", "words"),
    [
        (tf.fit, {"holdout": "0.2"}, "holdout: '0.2'; expected a number, 0 to 0.9"),
        (tf.fit, {"holdout": math.nan}, "holdout: nan; expected a number, 0 to 0.9"),
        (tf.fit, {"holdout": True}, "holdout: True; expected a number, 0 to 0.9"),
        (tf.fit, {"holdout_block": np.zeros(2)}, "holdout_block: array([0., 0.]); expected a number, 1 or more"),
        (tf.fit, {"passes": "a"}, "passes: 'a'; expected a whole number, 1 or more, or None"),
        (tf.fit, {"only": 3}, "only: 3; expected a text or a list of texts"),
        (tf.fit, {"fix": ["a", 3]}, "fix: ['a', 3]; expected a text or a list of texts"),
        (tf.fit, {"previous": 3}, "previous: 3; expected a path or None"),
        (tf.fit, {"asymmetric": "yes"}, "asymmetric: 'yes'; expected True, False or None"),
        (tf.fit, {"method": 3}, "method: 3; expected a text"),
        (tf.fit, {"progress": True}, "progress: True; expected a function or None"),
        (tf.tune, {"confidence": "a"}, "confidence: 'a'; expected a number, 0.5 to 0.9999"),
        (tf.tune, {"strict": 1}, "strict: 1; expected True or False"),
        (tf.diagnose, {"least_gain": "a"}, "least_gain: 'a'; expected a number, 0 to 0.5"),
        (tf.diagnose, {"jobs": "a"}, "jobs: 'a'; expected a whole number, 1 to 1024"),
        (tf.diagnose, {"seed": "a"}, "seed: 'a'; expected a whole number, 0 to 9007199254740992"),
        (tf.score, {"labels": 1}, "labels: 1; expected the name of a column or None"),
        (tf.run, {"kinematics": 1.0}, "kinematics: 1.0; expected a whole number, 1 to 3"),
        (tf.build, {"binaries": 3}, "binaries: 3; expected a path or None"),
        (tf.build, {"ssv": 3}, "ssv: 3; expected a path or a list of paths"),
    ],
)
def test_a_value_that_an_option_cannot_have(
    function: Callable[..., Any], options: dict[str, Any], words: str, tmp_path: Path
) -> None:
    with pytest.raises(tf.InputError) as refused:
        function(FINGER, tmp_path / "f.fmu" if function is tf.build else RECORDING, **options)
    assert str(refused.value) == words


def test_the_runner_refuses_kinematics_that_are_no_whole_number() -> None:
    with pytest.raises(tf.InputError, match=r"^kinematics: 1\.0; expected a whole number, 1 to 3$"):
        tf.Runner(FINGER, kinematics=1.0)  # type: ignore[arg-type]


def test_a_name_that_is_no_option_is_an_error_of_the_call() -> None:
    with pytest.raises(TypeError, match="hold_out"):
        tf.fit(FINGER, RECORDING, hold_out=0.2)  # type: ignore[call-arg]


def test_numbers_of_numpy_are_numbers() -> None:
    found = read_option("holdout", np.float32(0.5)), read_option("jobs", np.int64(2)), read_option("strict", np.True_)
    assert found == (0.5, 2, True) and [type(each) for each in found] == [float, int, bool]
    assert read_option("holdout", 0) == 0.0
    assert read_option("only", "joints[1].*") == ["joints[1].*"]


@pytest.mark.parametrize(("command", "function"), COMMANDS)
def test_types_and_ranges_are_those_of_the_command(command: Callable[..., Any], function: Callable[..., Any]) -> None:
    hints = typing.get_type_hints(command, include_extras=True)
    checked = set()
    for name, parameter in inspect.signature(function).parameters.items():
        if parameter.kind is not inspect.Parameter.KEYWORD_ONLY or name in SOURCES | {"progress"}:
            continue
        option, (hint, typed) = OPTIONS[name], typing.get_args(hints[name])[:2]
        inner = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
        kind = next(each for each in inner if each is not type(None))
        if isinstance(option, Number):
            assert (kind is int) == option.whole and kind in (int, float)
            assert (option.least, option.most) == (typed.min, math.inf if typed.max is None else typed.max)
            assert option.optional == (type(None) in inner)
        elif isinstance(option, Texts):
            assert kind == list[str]
        elif isinstance(option, Paths):
            assert kind == list[Path]
        else:
            assert isinstance(option, Kind) and kind in (*option.types, Path)
        checked.add(name)
    assert checked
