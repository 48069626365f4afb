"""Learns the friction of a wire-driven manipulator in free motion, and feels contact at its tip without pictures.

    python examples/wire/run.py [--figure docs/figures/wire.png]

Learns on `no-payload`. The threshold and the scale from torque to force are chosen on eight recordings with contact;
the tables report seven others. Takes a minute.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from wire_recordings import CONDITIONS, FREE, HALVES, SMEAR, Array, WireRecording, read

import tendonfmu as tf
from tendonfmu.drawing.panel import BLUE, GREEN, GREY, VERMILION
from tendonfmu.drawing.png import clean, save
from tendonfmu.errors import InputError

DESCRIPTION = Path(__file__).with_name("wire.json")
THRESHOLDS = (0.015, 0.02, 0.025, 0.03, 0.035, 0.04)  # N·m
Runs = list[WireRecording]


def pooled(runs: Runs, value: Callable[[WireRecording], Array]) -> Array:
    return np.concatenate([value(run) for run in runs])


def with_best_threshold(finger: tf.Finger, runs: Runs) -> tf.Finger:
    """The threshold with the most contacts found less false alarms; of equal ones the lowest."""
    candidates = [finger.replace({"contact.threshold[1]": value}) for value in THRESHOLDS]
    results = [tf.score(candidate, [run.recording for run in runs]) for candidate in candidates]
    return candidates[int(np.argmax([result.found - result.false_alarms for result in results]))]


def print_scores(label: str, finger: tf.Finger, groups: dict[str, Runs]) -> None:
    """One row for each group of recordings."""
    contact = finger.to_dict()["contact"]
    bound = [1e3 * contact[key][0] for key in ("threshold", "threshold_per_force") if key in contact]
    for group, runs in groups.items():
        report = tf.score(finger, [run.recording for run in runs]).report
        low, high = (100 * limit for limit in report["found_share"]["interval"])
        events = [event for recording in report["recordings"] for event in recording["event_list"] if event["found"]]
        early, median, late = np.quantile([event["delay_s"] for event in events], (0.25, 0.5, 0.75)) - SMEAR
        print(
            f"| {label} | {group} | {' + f·'.join(f'{value:.3g}' for value in bound)} | {report['found']} of "
            f"{report['events']} ({low:.0f} to {high:.0f} %) | {report['missed_in_alarm']} | {report['false_alarms']} "
            f"in {report['free_minutes']:.1f} min | {median:+.1f} ({early:+.1f} to {late:+.1f}) |"
        )


def torque_per_force(finger: tf.Finger, runs: Runs) -> float:
    """N·m at the load cells per unit of the sensor's bending force."""
    felt = pooled(runs, lambda run: run.torque(finger))
    return float(np.polyfit(pooled(runs, lambda run: run.bending), felt, 1)[0])


def print_forces(finger: tf.Finger, scale: float, groups: dict[str, Runs]) -> None:
    """Gain and offset from `choosing`, errors on `reporting`. fx and fy: the least force that bends as much."""

    def row(name: str, felt: Callable[[WireRecording], Array], sensed: Callable[[WireRecording], Array]) -> None:
        line = np.polyfit(pooled(groups["choosing"], felt), pooled(groups["choosing"], sensed), 1)
        truth, estimate = pooled(groups["reporting"], sensed), pooled(groups["reporting"], felt)
        errors = (estimate / scale - truth, np.polyval(line, estimate) - truth)
        print(f"| {name} | {truth.std():.0f} |" + "".join(f" {np.sqrt(np.mean(error**2)):.0f} |" for error in errors))

    print("\n| force | std | rmse, torque / scale | rmse, gain and offset |\n| --- | ---: | ---: | ---: |")
    row("bending", lambda run: run.torque(finger), lambda run: run.bending)
    row("fx", lambda run: run.torque(finger) * run.least[:, 0], lambda run: run.force[:, 0])
    row("fy", lambda run: run.torque(finger) * run.least[:, 1], lambda run: run.force[:, 1])


def print_changes(finger: tf.Finger) -> None:
    """What `diagnose --reference` says of a preloaded tip against a free one, and of halves of one recording."""
    for name in CONDITIONS:
        untight, tight = (read(f"{name}_{kind}", np.inf).recording for kind in ("un-tight", "tight"))
        middle = untight.time[len(untight) // 2]
        for words, then, now in (("tight", untight, tight), ("second half", untight[:middle], untight[middle:])):
            try:
                found = tf.diagnose(finger, now, reference=then)
                said = "; ".join(f"{cause.effect} ({cause.size})" for cause in found.causes) or found.verdict
            except InputError as refused:
                said = f"refused: {str(refused).rsplit('.parquet: ')[-1][:90]}"
            print(f"| {name} un-tight, then {words} | {said} |")


def draw(finger: tf.Finger, scale: float, runs: Runs, file: Path) -> None:
    figure = Figure(figsize=(14.0, 7.5), layout="constrained")
    panels = figure.subplots(2, 2).ravel()
    table = tf.run(finger, runs[0].recording).frame
    panels[0].plot(runs[0].bend, 1e3 * table["joint_torque[1]"], color=GREY, linewidth=1.6, label="load cells")
    panels[0].plot(runs[0].bend, 1e3 * table["friction_torque[1]"], color=BLUE, linewidth=0.9, label="model")
    panels[0].set(title="free motion", xlabel="bend (rad)", ylabel="torque (mN·m)")
    for panel, run in zip(panels[1:], runs[1:], strict=True):
        table, time = tf.run(finger, run.recording).frame, run.recording.time
        level = np.where(table["contact"] > 0.5, -500.0, np.nan)
        panel.plot(time, run.bending, color=GREEN, linewidth=2.0, label="sensor at the tip")
        panel.plot(time, table["compensated_torque[1]"] / scale, color=BLUE, linewidth=1.0, label="from load cells")
        panel.plot(time, level, color=VERMILION, linewidth=5.0, label="contact reported")
        panel.set(title=run.name, xlabel="time (s)", ylabel="bending force (sensor's units)", ylim=(-550, 600))
    for panel in panels:
        clean(panel)
        panel.legend(frameon=False, loc="upper center", ncols=3)
    save(figure, file, 100)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--figure", type=Path, help="picture to write")
    parser.add_argument("--touch", type=float, default=100.0, help="least bending force of a contact, sensor's units")
    parser.add_argument("--changes", action="store_true", help="compare recordings with diagnose --reference, no more")
    options = parser.parse_args()
    warnings.simplefilter("ignore")  # they are printed with the results
    free = read(FREE, options.touch)
    groups = {group: [read(name, options.touch) for name in names] for group, names in HALVES.items()}

    print(tf.check(DESCRIPTION, free.recording))
    # the samples count as 25: with the uncertainty of the fit in the bounds few contacts would be found
    fit = tf.fit(DESCRIPTION, free.recording, uncertainty=False)
    print(fit.parameters[["value", "standard_error", "identified"]].to_string(), *fit.warnings, sep="\n")
    found = tf.diagnose(DESCRIPTION, free.recording)
    print(*(f"{cause.effect}: {cause.size}; gain {cause.gain.value:.2f}" for cause in found.causes), sep="\n")
    if options.changes:
        print_changes(found.extended)
        return
    errors = [1e3 * found.report[model]["test_rms"][0] for model in ("nominal", "extended")]
    print("unseen free motion: {:.2f} mN·m as described and fitted, {:.2f} extended".format(*errors))

    print("\n| model | recordings | bound, mN·m | found | on before | false alarms | delay, s |\n|" + 7 * " --- |")
    extended = with_best_threshold(found.extended, groups["choosing"])
    print_scores("fitted", with_best_threshold(fit.finger, groups["choosing"]), groups)
    print_scores("extended", extended, groups)
    print_scores("extended, `tune`", tf.tune(extended, free.recording, bias_time=600).finger, groups)
    scale = torque_per_force(extended, groups["choosing"])
    print_forces(extended, scale, groups)

    print(f"\n{1e3 * scale:.3f} mN·m per unit of force. By recording:")
    print({run.name: round(1e3 * torque_per_force(extended, [run]), 2) for runs in groups.values() for run in runs})
    if options.figure:  # zero_un-tight, right_60_un-tight, testset
        draw(extended, scale, [free, *groups["reporting"][2::2]], options.figure)


if __name__ == "__main__":
    try:
        main()
    except InputError as refused:
        print(refused, file=sys.stderr)
        sys.exit(2)
