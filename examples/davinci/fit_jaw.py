"""Fits jaw.json: three friction numbers and an offset, by `tendonfmu fit` from jaw_start.json.

    python examples/davinci/fit_jaw.py [-o examples/davinci/jaw.json] [--train 00 02 04 06 08]

Everything else in jaw.json (thresholds, filter, stiffness) is chosen by hand, see docs/evidence/davinci.md.
"""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from jaw_recordings import FAST, SLOW, data_folder, read_run, rms, torque_error

from tendonfmu.estimate.fitting import FrictionFit
from tendonfmu.model.native import run_recording
from tendonfmu.recordings.recording import Recording

START = Path(__file__).with_name("jaw_start.json")
DIGITS = 4  # written to jaw.json


def fit(recordings: list[Recording]) -> dict[str, Any]:
    """The description with the least squared torque error over all samples of all recordings, numbers rounded.

    What the fit warns of (residuals that are not white) is shown on standard error.
    """
    finger: dict[str, Any] = json.loads(FrictionFit(START, uncertainty=False).fit(recordings).description_text())
    edge = finger["tendons"][0]["edge_friction"][0]
    for law in (finger["joints"][0]["friction"], edge["positive"], edge["negative"]):
        law |= {"static": round(law["static"], DIGITS), "coulomb": round(law["coulomb"], DIGITS)}
    finger["bias"]["initial_torque"] = [round(torque, DIGITS) for torque in finger["bias"]["initial_torque"]]
    return finger


def numbers(finger: dict[str, Any]) -> tuple[float, float, float, float]:
    """Joint friction in N·m, part of the cable force lost while closing and while opening, bias at the start in N·m."""
    joint, edge = finger["joints"][0]["friction"], finger["tendons"][0]["edge_friction"][0]
    offset = finger["bias"]["initial_torque"][0]
    return joint["coulomb"], edge["positive"]["coulomb"], edge["negative"]["coulomb"], offset


def written(text: str, finger: dict[str, Any]) -> str:
    """The start's text with the fitted numbers: the layout made by hand stays."""
    joint, closing, opening, offset = numbers(finger)
    for key, value in (("friction", joint), ("positive", closing), ("negative", opening)):
        pair = f'"static": {value}, "coulomb": {value}'
        text = re.sub(rf'("{key}": *{{)"static": [^,]*, "coulomb": [^,]*', rf"\g<1>{pair}", text, count=1)
    text = re.sub(r'("initial_torque": )\[[^]]*\]', rf"\g<1>[{offset}]", text)
    if json.loads(text) != finger:
        raise SystemExit("jaw_start.json: its layout has changed; expected the keys static, coulomb in this order")
    return text


def pooled(finger: dict[str, Any], recordings: Iterable[Recording]) -> float:
    """rms of the torque error over the samples of all recordings, mN·m."""
    return 1e3 * rms(np.concatenate([torque_error(run, run_recording(finger, run.arrays())) for run in recordings]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, help="description to write; without it, only the figures")
    parser.add_argument("--train", nargs="+", default=SLOW, metavar="RUN", help="runs to fit (default: all of 0.1 Hz)")
    options = parser.parse_args()
    folder = data_folder()
    runs = {name: read_run(folder, name) for name in (*SLOW, *FAST)}
    finger = fit([runs[name] for name in options.train])
    print("joint friction {:g} N·m, lost closing {:g}, opening {:g}, initial torque {:g} N·m".format(*numbers(finger)))
    for name, run in runs.items():
        print(f"{name}  rms {pooled(finger, [run]):5.1f} mN·m{'' if name in options.train else '  (not in the fit)'}")
    for label, names in (("0.1 Hz, not in the fit", SLOW), ("0.5 Hz", FAST)):
        rest = [runs[name] for name in names if name not in options.train]
        if rest:
            print(f"pooled, {label}: {pooled(finger, rest):.1f} mN·m")
    if options.output:
        partial = options.output.with_name(f".{options.output.name}.partial")
        partial.write_text(written(START.read_text(encoding="utf-8"), finger), encoding="utf-8")
        partial.replace(options.output)


if __name__ == "__main__":
    main()
