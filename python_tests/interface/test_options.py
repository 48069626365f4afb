"""An option of a wrong type or out of range is refused by name, with the types and ranges of the commands."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tendonfmu as tf
from repository_paths import ROOT
from tendonfmu import options
from tendonfmu.estimate.fitting import FrictionFit

DEMO = ROOT / "examples/demo_recording"
FINGER, RECORDING = DEMO / "two_joints.json", DEMO / "two_joints_training.parquet"
FUNCTIONS: list[tuple[Callable[..., Any], type[options.Options]]] = [
    (tf.build, options.BuildOptions),
    (tf.run, options.RunOptions),
    (tf.fit, options.FitArguments),
    (tf.tune, options.TuneOptions),
    (tf.score, options.ScoreOptions),
    (tf.diagnose, options.DiagnoseOptions),
    (tf.calibrate, options.CalibrateOptions),
]


@pytest.mark.parametrize(("function", "of_command"), FUNCTIONS)
def test_a_function_has_the_options_of_its_command(
    function: Callable[..., Any], of_command: type[options.Options]
) -> None:
    """In its signature, and in its docstring with their values and defaults: both are made from the class."""
    signature = {
        name: parameter.default
        for name, parameter in inspect.signature(function).parameters.items()
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY
    }
    assert signature == {name: option.default for name, option in of_command.each().items()}
    listed = (
        inspect.cleandoc(function.__doc__ or "").partition("Parameters\n----------\n")[2].partition("\n\nReturns")[0]
    )
    assert re.findall(r"^\w+$", listed, re.MULTILINE)[2:] == list(signature)
    for name, option in of_command.each().items():
        assert re.search(rf"^{name}\n    [A-Z1].* \({re.escape(option.words)}; default .*\)\.$", listed, re.MULTILINE)


def test_its_sources_are_given_by_name_as_well() -> None:
    given = {"recording": RECORDING, "kinematics": 1, "finger": FINGER}
    assert tf.run(**given).frame.equals(tf.run(FINGER, RECORDING).frame)  # type: ignore[call-arg]


@pytest.mark.parametrize(
    ("function", "options", "words"),
    [
        (tf.fit, {"holdout": "0.2"}, "holdout: '0.2'; expected a number, 0 to 0.9"),
        (tf.fit, {"holdout": math.nan}, "holdout: nan; expected a number, 0 to 0.9"),
        (tf.fit, {"holdout_block": np.zeros(2)}, "holdout_block: array([0., 0.]); expected a number, 1 or more"),
        (tf.fit, {"fix": ["a", 3]}, "fix: ['a', 3]; expected a text or a list of texts"),
        (tf.fit, {"asymmetric": "yes"}, "asymmetric: 'yes'; expected True, False or None"),
        (tf.fit, {"method": 3}, "method: 3; expected batch or ekf"),
        (FrictionFit, {"asymmetric": "both"}, "asymmetric: 'both'; expected True, False or None"),
        (FrictionFit, {"drift": 2.0}, "drift: 2.0; expected a number, 0 to 1"),
        (tf.fit, {"progress": True}, "progress: True; expected a function or None"),
        (tf.tune, {"method": "cusum"}, "method: 'cusum'; expected bands or paper"),
        (tf.diagnose, {"seed": "a"}, "seed: 'a'; expected a whole number, 0 to 9007199254740992"),
        (tf.score, {"labels": 1}, "labels: 1; expected the name of a column or None"),
        (tf.Runner, {"kinematics": 1.0}, "kinematics: 1.0; expected a whole number, 1 to 3"),
        (tf.run, {"kinematics": 1.0}, "kinematics: 1.0; expected a whole number, 1 to 3"),
        (tf.build, {"ssv": 3}, "ssv: 3; expected a path or a list of paths"),
    ],
)
def test_a_value_that_an_option_cannot_have(
    function: Callable[..., Any], options: dict[str, Any], words: str, tmp_path: Path
) -> None:
    sources = {tf.build: [tmp_path / "f.fmu"], FrictionFit: [], tf.Runner: []}.get(function, [RECORDING])
    with pytest.raises(tf.InputError) as refused:
        function(FINGER, *sources, **options)
    assert str(refused.value) == words


def test_a_name_that_is_no_option_is_an_error_of_the_call() -> None:
    with pytest.raises(TypeError, match="hold_out"):
        tf.fit(FINGER, RECORDING, hold_out=0.2)  # type: ignore[call-arg]


def test_numbers_of_numpy_are_numbers() -> None:
    fit = options.FitOptions(holdout=np.float32(0.5), routing=np.True_, only="joints[1].*")  # type: ignore[arg-type]
    diagnose = options.DiagnoseOptions(jobs=np.int64(2))  # type: ignore[arg-type]
    values = fit.holdout, diagnose.jobs, fit.routing, fit.only, options.FitOptions(holdout=0).holdout
    assert values == (0.5, 2, True, ["joints[1].*"], 0.0)
    assert [type(value) for value in values] == [float, int, bool, list, float]
