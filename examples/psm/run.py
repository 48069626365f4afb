"""PSM: what a model of each joint by itself explains of its effort, beside a rigid body; what is named, and how surely.

    python examples/psm/run.py [-o DIR] [--figure FILE.png]

Learned on two excitations, judged on others, on ramps until it breaks away, and at constant speeds. Error: root of the
mean square, in % of that of the effort. Causes are looked for twice, on disjoint recordings.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from psm_recordings import FIRST, JOINTS, OTHERS, RAMPS, SECOND, coupled_finger, coupled_recording, log_of, recording_of
from rigid_body import RigidBody

import tendonfmu as tf
from tendonfmu.drawing.panel import BLUE, GREY
from tendonfmu.drawing.png import clean, save
from tendonfmu.errors import InputError
from tendonfmu.recordings import describe_recorded_joint

KINEMATICS = 3  # angle and velocity are measured
JUDGED = {"other excitations": SECOND, "another identification": OTHERS, "ramps, breaking away": RAMPS[:1],
          "constant speeds": RAMPS[1:]}  # fmt: skip
PAIR = (1, 2)  # whose axes are perpendicular
SHOWN = 10.0  # s of the figure


def errors(finger: Any, recording: tf.Recording) -> Any:
    """Errors of a finger on a recording, as parts of the effort's root mean square, by joint."""
    left = tf.run(finger, recording, kinematics=KINEMATICS).outputs["compensated_torque"]
    return np.sqrt(np.mean(left**2, axis=0) / np.mean(recording.groups["tendon_force"] ** 2, axis=0))


def mean_of(errors: Sequence[float]) -> str:
    return f"{100 * float(np.mean(errors)):.0f}"


def named(found: tf.Diagnosis) -> dict[str, str]:
    """The causes that a description can be extended with, and their sizes."""
    return {cause.effect: cause.size for cause in found.causes if cause.effect not in ("contact", "unknown")}


def judge(joint: int, together: Any, rows: list[str]) -> tuple[Any, list[tf.Diagnosis]]:
    """Fit, diagnose twice, and add the joint's rows to the table."""
    start = describe_recorded_joint(f"joint_{joint}", recording_of(FIRST[0], joint), 1.0)
    parts = [[recording_of(name, joint) for name in names] for names in (FIRST, SECOND)]
    fitted = tf.fit(start, parts[0], kinematics=KINEMATICS).finger
    found = [tf.diagnose(start, parts[k], test=parts[1 - k], kinematics=KINEMATICS) for k in (0, 1)]
    fields = [RigidBody(joint, FIRST, stribeck) for stribeck in (False, True)]
    for words, names in JUDGED.items():
        own = [
            [errors(finger, recording_of(name, joint))[0] for name in names] for finger in (fitted, found[0].extended)
        ]
        theirs = [[field.error(name) for name in names] for field in fields]
        if joint in PAIR:
            place = PAIR.index(joint)
            own.append([errors(together, coupled_recording(name, PAIR))[place] for name in names])
        row = [*map(mean_of, [*theirs, *own]), *([] if joint in PAIR else ["–"])]
        rows.append(f"| {joint} | {words} | " + " | ".join(row) + " |")
    return found[0].extended, found


def couple(joints: Sequence[int]) -> list[tf.Diagnosis]:
    """Say what several joints together show that each alone does not, on either half."""
    starts = [describe_recorded_joint(f"joint_{joint}", recording_of(FIRST[0], joint), 1.0) for joint in joints]
    parts = [[coupled_recording(name, joints) for name in names] for names in (FIRST, SECOND)]
    found = [tf.diagnose(coupled_finger(starts), parts[k], test=parts[1 - k], kinematics=KINEMATICS) for k in (0, 1)]
    for diagnosis in found:
        report = diagnosis.report
        print(f"\njoints {joints} together: {named(diagnosis) or 'nothing'}; {report['unexplained']['description']}")
        for cause in report["causes"]:
            for place in cause.get("places", ()):
                print(f"  {cause['effect']} at joint {place['joint']}: {place['parameters']}")
        for name, values in (
            ("left", report["extended"]["test_rms"]),
            ("follow no signal of any joint", report["noise_floor"]),
        ):
            print(f"  {', '.join(f'{1e3 * value:.0f}' for value in values)} mN·m {name}")
    return found


def draw(file: Path, fingers: dict[int, Any], together: Any) -> None:
    """Effort of each joint and what the extended models say, on an excitation that nothing was learned on."""
    both = tf.run(together, coupled_recording(SECOND[0], PAIR), kinematics=KINEMATICS).outputs
    figure = Figure(figsize=(12.0, 7.5), layout="constrained")
    panels = figure.subplots(len(fingers), 1, sharex=True)
    for panel, (joint, finger) in zip(panels, fingers.items(), strict=True):
        recording = recording_of(SECOND[0], joint)
        effort = recording.groups["tendon_force"][:, 0]
        left = tf.run(finger, recording, kinematics=KINEMATICS).outputs["compensated_torque"][:, 0]
        shown = recording.time < recording.time[0] + SHOWN
        panel.plot(recording.time[shown], effort[shown], color=GREY, linewidth=1.8, label="measured")
        alone = (
            effort - left
            if joint not in PAIR
            else np.interp(
                recording.time, both["time"], (both["joint_torque"] - both["compensated_torque"])[:, PAIR.index(joint)]
            )
        )
        panel.plot(recording.time[shown], alone[shown], color=BLUE, linewidth=1.2, label="extended model")
        panel.set_ylabel(f"joint {joint}: effort ({'N' if joint == 3 else 'N·m'})")
        clean(panel)
    panels[0].legend(ncols=2, frameon=False)
    panels[-1].set_xlabel("time (s)")
    save(figure, file, 100)


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("-o", "--output", type=Path, help="folder for the diagnoses and extended descriptions")
    options.add_argument("--figure", type=Path, help="picture of measured and modelled efforts")
    given = options.parse_args()
    try:
        log_of(FIRST[0])
    except InputError as absent:
        print(f"SKIPPED: {absent}", file=sys.stderr)
        return 2
    rows, fingers = [], {}
    together = couple(PAIR)[0].extended
    couple(JOINTS)
    for joint in JOINTS:
        fingers[joint], found = judge(joint, together, rows)
        for names, diagnosis in zip((FIRST, SECOND), found, strict=True):
            causes = "; ".join(f"{effect} ({size})" for effect, size in named(diagnosis).items()) or "nothing"
            report = diagnosis.report
            left, floor = 1e3 * report["extended"]["test_rms"][0], 1e3 * report["noise_floor"][0]
            print(f"joint {joint}, learned on {names[0]} and {names[1]}: {causes}")
            unit = "mN" if joint == 3 else "mN·m"
            print(f"  {left:.0f} {unit} are left, {floor:.0f} of it follow no signal of the joint")
        if given.output is not None:
            found[0].write(given.output / f"joint_{joint}")
    print("\n| joint | judged on | rigid body | with Stribeck | one joint | extended | joints 1 and 2 extended |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: |\n" + "\n".join(rows))
    if given.figure is not None:
        draw(given.figure, fingers, together)
    return 0


if __name__ == "__main__":
    sys.exit(main())
