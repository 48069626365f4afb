"""Least-squares fit of jaw.json: three friction numbers and an offset, with the runtime itself as the model.

    python examples/davinci/fit_jaw.py [-o examples/davinci/jaw.json] [--train 00 02 04 06 08]

Everything else in jaw.json (thresholds, filter, stiffness) is chosen by hand, see docs/davinci.md.
"""

from __future__ import annotations

import argparse
import copy
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
from jaw_recordings import SLOW, Array, data_folder, read_run, rms, torque_error
from scipy.optimize import least_squares

from tendonfmu.native import run_recording

HERE = Path(__file__).parent
# joint friction (N·m), part of the cable force lost while closing and while opening (1), bias at the start (N·m)
LOWER, UPPER = np.array([0.0, 0.0, 0.0, -1.0]), np.array([1.0, 1.0, 1.0, 1.0])
DIGITS = 4  # written to jaw.json


def described(finger: dict[str, Any], numbers: Array) -> dict[str, Any]:
    """A copy of the finger with the four numbers in place; no Stribeck effect: static = coulomb."""
    joint, closing, opening, offset = (float(number) for number in numbers)
    finger = copy.deepcopy(finger)
    edge = finger["tendons"][0]["edge_friction"][0]
    finger["joints"][0]["friction"] |= {"static": joint, "coulomb": joint}
    edge["positive"] |= {"static": closing, "coulomb": closing}
    edge["negative"] |= {"static": opening, "coulomb": opening}
    finger["bias"]["initial_torque"] = [offset]
    return finger


def fit(finger: dict[str, Any], recordings: list[dict[str, Array]]) -> Array:
    """The four numbers with the least squared torque error over all samples of all recordings."""

    def errors(numbers: Array) -> Array:
        candidate = described(finger, numbers)
        return np.asarray(np.concatenate([torque_error(run, run_recording(candidate, run)) for run in recordings]))

    # The error is linear in the numbers, so any start will do; the step keeps clear of rounding.
    found = least_squares(errors, x0=[0.05, 0.1, 0.1, 0.0], bounds=(LOWER, UPPER), x_scale=0.1, diff_step=1e-3)
    return np.asarray(found.x).round(DIGITS)


def written(text: str, finger: dict[str, Any]) -> str:
    """The file's text with the finger's new numbers: the layout made by hand stays."""
    joint = finger["joints"][0]["friction"]
    edge = finger["tendons"][0]["edge_friction"][0]
    for law, key in ((joint, "friction"), (edge["positive"], "positive"), (edge["negative"], "negative")):
        pair = f'"static": {law["static"]}, "coulomb": {law["coulomb"]}'
        text = re.sub(rf'("{key}": *{{)"static": [^,]*, "coulomb": [^,]*', rf"\g<1>{pair}", text, count=1)
    text = re.sub(r'("initial_torque": )\[[^]]*\]', rf"\g<1>{finger['bias']['initial_torque']}", text)
    if json.loads(text) != finger:
        raise SystemExit("jaw.json: its layout has changed; expected the keys static, coulomb in this order")
    return text


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, help="description to write; without it, only the figures")
    parser.add_argument("--train", nargs="+", default=SLOW, metavar="RUN", help="runs to fit (default: all of 0.1 Hz)")
    options = parser.parse_args()
    text = (HERE / "jaw.json").read_text(encoding="utf-8")
    folder = data_folder()
    recordings = {name: read_run(folder, name) for name in {*SLOW, *options.train}}
    finger = json.loads(text)
    numbers = fit(finger, [recordings[name] for name in options.train])
    finger = described(finger, numbers)
    print("joint friction {:g} N·m, lost closing {:g}, opening {:g}, initial torque {:g} N·m".format(*numbers))
    for name in sorted(recordings):
        error = torque_error(recordings[name], run_recording(finger, recordings[name]))
        print(f"{name}  rms {1e3 * rms(error):5.1f} mN·m{'' if name in options.train else '  (not in the fit)'}")
    if options.output:
        partial = options.output.with_name(f".{options.output.name}.partial")
        partial.write_text(written(text, finger), encoding="utf-8")
        partial.replace(options.output)


if __name__ == "__main__":
    main()
