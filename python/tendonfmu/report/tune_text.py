"""How a tuning reads in the terminal: tables by joint and by pretension, and lines that `cli/detect.py` prints."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tendonfmu.detect import ContactTuning, rate_limit
from tendonfmu.files import are, counted
from tendonfmu.report.numbers import Row, Table


def tables(tuning: ContactTuning) -> Iterator[Table]:
    """List the tables to print: bounds by joint, then results by pretension."""
    yield _bounds(tuning)
    yield _pretensions(tuning)


def _bounds(tuning: ContactTuning) -> Table:
    headings, columns = ["joint"], []
    for name, bound in reversed(tuning.bounds_.items()):
        headings += [f"{name}\nmN·m", "+ per N\nmN·m/N"]
        columns += [bound.base, bound.per_force]
    headings += ["deviation\nmN·m", "+ per N\nmN·m/N"]
    columns += [tuning.deviation_.base, tuning.deviation_.per_force]
    main = list(tuning.bounds_.values())[-1]
    also = f" + {main.stuck_share:g} of what sticks + {main.jump_share:g} of what jumped" if main.stuck_share else ""
    if main.jump_share and not main.stuck_share:
        also = f" + {main.jump_share:g} of what jumped"
    rows = [
        (joint, *(f"{1e3 * column[j]:.3g}" for column in columns))
        for j, joint in enumerate(tuning.description_.joint_names)
    ]
    return f"{tuning.description_.name}: {tuning.method}, bounds{also}", tuple(headings), rows


def _pretensions(tuning: ContactTuning) -> Table:
    headings: Row = ("mean force, N", "minutes", "residual rms\nmN·m", "false alarms", "at most,\nper hour", "(r/std)²")
    rows: list[Row] = [
        (
            f"{each.force:.3g}",
            f"{60 * each.hours:.1f}",
            ", ".join(f"{1e3 * value:.2g}" for value in each.rms),
            str(each.alarms),
            f"{each.limit:.3g}",
            ", ".join(f"{value:.2g}" for value in square),
        )
        for each, square in zip(tuning.pretensions_, tuning.deviation_.square, strict=True)
    ]
    return "free motion", headings, rows


def lines(tuning: ContactTuning) -> Iterator[str]:
    """List the lines to print: the rate of false alarms, and the data it was measured on."""
    alarms = sum(each.alarms for each in tuning.loop_)
    percent = 100 * tuning.confidence
    held, limit = tuning.held_out_
    yield (
        f"as it runs: {counted(alarms, 'false alarm')} in {60 * tuning.hours_:.1f} min, at most "
        f"{rate_limit(alarms, tuning.hours_, tuning.confidence):.3g} per hour ({percent:g} %)"
    )
    if alarms:
        longest = max(each.longest for each in tuning.loop_)
        share = sum(each.alarm_seconds for each in tuning.loop_) / sum(each.seconds for each in tuning.loop_)
        yield f"longest alarm {longest:.3g} s; {100 * share:.2g} % of the time in alarm"
    yield (
        f"held out: {held} in blocks that the bounds were not chosen on, at most {limit:.3g} per hour; "
        f"{tuning.allowed_} {are(tuning.allowed_)} allowed for {tuning.rate_:.3g}"
    )
    low, high = tuning.forces_
    yield f"chosen at mean tendon forces of {low:.3g} to {high:.3g} N; beyond them thresholds are extrapolated"
    bias = tuning.bias_
    yield (
        f"bias: noise {1e3 * bias.noise_std:.3g} mN·m + {1e3 * bias.noise_std_per_force:.3g} mN·m per N, "
        f"time constant {bias.time_constant:.3g} s at {bias.force:.3g} N"
    )
    sensors = tuning.sensors_
    if sensors.keys is None:
        yield f"sensor faults are not watched: {sensors.why}"
    else:
        yield (
            f"sensor faults: forces differ from their springs by up to {sensors.largest:.2g} N in free motion, "
            f"{sensors.keys['jump_margin']:.3g} N are allowed"
        )
    levels = np.array([level.held_out / level.in_sample for level in tuning.levels_.values()])
    if levels.max() > 1:
        yield f"held-out halves need bounds {levels.max():.2f} times those that the data themselves need"
