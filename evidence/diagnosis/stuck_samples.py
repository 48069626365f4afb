"""What stuck samples do to a diagnosis: python -m evidence.diagnosis.stuck_samples -o FOLDER [--seeds 10] [--mujoco]

A simulated finger that sticks and slips (fingers/sticking_finger.py) is diagnosed with nothing hidden and with a hidden
weight, by a search that may leave out stuck samples and by one that may not. With --mujoco the fingers are those of
mujoco_cases.py (1, 2 and 20, of one and two joints), with nothing hidden. Writes FOLDER/stuck.md or stuck_mujoco.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any
from unittest import mock

import numpy as np

from evidence.fingers import sticking_finger
from evidence.runner import parser, publish, run_cases
from evidence.tables import Row, by, count, table
from tendonfmu.diagnosis import diagnose, search

SECONDS, WEIGHT, PULL = 30.0, 0.05, 20.0  # s, N·m, N
MUJOCO_SECONDS, MOST_RATE = 45.0, 500.0  # s, Hz
PHYSICS = {"presliding", "inertia"}  # of the simulated finger
WAYS = ("always count", "may be left out")


@contextmanager
def searching(way: str) -> Iterator[None]:
    """A search for which stuck samples count in this way."""
    alone = vars(search)["sliding_alone"] if way == WAYS[1] else lambda *given: None
    with mock.patch.object(search, "sliding_alone", alone):
        yield


def of_sticking_finger(hidden: str, way: str, seed: int) -> dict[str, Any]:
    """Names, and errors of the friction as shares."""
    recording = sticking_finger.simulate(SECONDS, seed, WEIGHT if hidden == "gravity" else 0.0)
    with searching(way):
        diagnosis = diagnose(sticking_finger.description(), recording, kinematics=2)
    true = sticking_finger.friction_at(PULL)
    nominal, extended = (
        sticking_finger.described_friction_at(data, PULL) / true - 1.0
        for data in (diagnosis.nominal_data, diagnosis.extended_data)
    )
    names = {cause.effect for cause in diagnosis.causes} - PHYSICS
    return {
        "hidden": hidden,
        "way": way,
        "named": hidden in names,
        "false": bool(names - {hidden}),
        "nominal": nominal,
        "extended": extended,
        "gain": diagnosis.gain.value,
    }


def of_mujoco(way: str, number: int, seed: int, joints: int) -> dict[str, Any]:
    from evidence.fingers import mujoco_cases  # mujoco need not be there for the other fingers

    plan = mujoco_cases.PLANS[number - 1]
    plan = replace(plan, joints=joints, rate=min(plan.rate, MOST_RATE))
    made = mujoco_cases.of_plan(plan, number, seed, MUJOCO_SECONDS, 1.0)
    with searching(way):
        diagnosis = diagnose(made.nominal, made.train, kinematics=2, seed=seed)
    return {"way": way, "false": bool({cause.effect for cause in diagnosis.causes} - PHYSICS)}


def spread(values: Sequence[float]) -> str:
    return f"{100 * np.median(values):+.0f} ({100 * min(values):+.0f} to {100 * max(values):+.0f}) %"


def cells(rows: Sequence[Row]) -> list[str]:
    return [
        count(row["named"] for row in rows if row["hidden"] != "nothing"),
        count(row["false"] for row in rows),
        *(spread([row[model] for row in rows]) for model in ("nominal", "extended")),
        f"{100 * np.median([row['gain'] for row in rows]):.0f} %",
    ]


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--seeds", type=int, default=10)
    options.add_argument("--mujoco", action="store_true")
    given = options.parse_args()
    if given.mujoco:
        cases = {
            f"mujoco_{number}_{k}_{way.replace(' ', '_')}": (way, number, 970000 + 100 * number + k, 1 + k % 2)
            for way in WAYS
            for number in (1, 2, 20)
            for k in range(given.seeds)
        }
        rows = run_cases(of_mujoco, cases, given.output, given.workers, given.scheduler)
        lines = by(rows, ["way"], lambda some: [count(row["false"] for row in some)])
        publish(given.output / "stuck_mujoco.md", table(("stuck samples", "a false name"), lines) + "\n")
        return
    by_hidden = {
        f"{hidden}_{seed}_{way.replace(' ', '_')}": (hidden, way, 100 + seed)
        for hidden in ("nothing", "gravity")
        for way in WAYS
        for seed in range(given.seeds)
    }
    rows = run_cases(of_sticking_finger, by_hidden, given.output, given.workers, given.scheduler)
    head = ("hidden", "stuck samples", "named", "a false name", "friction, nominal", "friction, extended", "gain")
    publish(given.output / "stuck.md", table(head, by(rows, ["hidden", "way"], cells), 2) + "\n")


if __name__ == "__main__":
    main()
