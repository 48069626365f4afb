"""What is off between angles and tendons: an encoder, a zero, an arm or a spring of a finger in numpy.

Two tendons a joint with friction of their own; encoders with 0.05 to 0.5 mrad of noise, positions in steps of 1 µm
that come 1 ms late. One place of each finger is off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from encoder_finger import EncoderFinger, encoder_finger
from evidence.cases import run_cases
from evidence.part import Figures, Part
from evidence.table import NOTHING, Row, count, table, values_of, where
from tendonfmu.diagnosis.cause import Cause
from tendonfmu.diagnosis.inputs import read_input
from tendonfmu.diagnosis.kinematic_causes import find_kinematic_causes

KINDS = {  # what is off: its effect, and its smallest and largest size
    "nothing": ("", 0.0, 0.0),
    "encoder, 1°": ("encoder_offset", np.radians(1.0), np.radians(1.0)),
    "encoder, 3°": ("encoder_offset", np.radians(3.0), np.radians(3.0)),
    "zero, 0.1 to 0.3 mm": ("zero", 1e-4, 3e-4),
    "moment arm, 3.5 %": ("moment_arm", 0.035, 0.035),
    "stiffness, 10 %": ("tendon_nonlinearity", 0.1, 0.1),
}
KEYS = {"encoder_offset": "encoder", "zero": "zero", "moment_arm": "arm", "tendon_nonlinearity": "stiffness"}
SEEDS = range(14, 26, 2)  # of fingers; constants were chosen on 1 to 11
OTHER_LOAD = 1.25  # times the pretension of the reference, in every third finger
HARDENING = 0.004  # per N, in every second finger with a reference: a twentieth of the stretch
LEAST = 0.03  # gain of a cause


@dataclass(frozen=True)
class Case:
    """A finger as it was, or is described, and as it is now."""

    effect: str
    joint: int | None  # from 1
    tendon: int | None
    size: float  # of the number, in its unit; of arm and stiffness a share
    before: EncoderFinger
    now: EncoderFinger
    seed: int

    def causes(self, with_reference: bool) -> tuple[Cause, ...]:
        now = [self.now.recording(10 * self.seed + k) for k in (1, 2)]
        then = [self.before.recording(10 * self.seed + 3)] if with_reference else None
        given = read_input(self.before.description, now[:1], now[1:], then, 1, LEAST, True)
        return find_kinematic_causes(given, LEAST, 0).causes

    def is_true(self, cause: Cause) -> bool:
        return (cause.effect, cause.joint, cause.tendon) == (self.effect, self.joint, self.tendon)

    def has_size(self, cause: Cause) -> bool:
        """Whether the size is within a tenth, or half of the interval if that is larger."""
        changed = cause.changed
        if changed is None:
            return True
        share = changed.reference.value if self.effect in ("moment_arm", "tendon_nonlinearity") else 1.0
        off = abs(changed.change.value / share - self.size)
        return off < max(0.1 * abs(self.size), 0.5 * abs((changed.change.high - changed.change.low) / share))


def make(kind: str, seed: int, hardening: float) -> Case:
    random = np.random.default_rng(1000 + seed)
    before = encoder_finger(seed, hardening)
    effect, low, high = KINDS[kind]
    tendon = int(random.integers(len(before.arms)))
    joint = int(random.choice(np.flatnonzero(before.arms[tendon])))
    size = float(random.choice([-1.0, 1.0]) * random.uniform(low, high))
    now = before.but(KEYS.get(effect, "nothing"), size, tendon, joint)
    if seed % 3 == 2:
        now = replace(now, pretension=OTHER_LOAD * now.pretension)
    at_joint = joint + 1 if effect in ("encoder_offset", "moment_arm") else None
    at_tendon = tendon + 1 if effect not in ("encoder_offset", "") else None
    return Case(effect, at_joint, at_tendon, size, before, now, seed)


def run_case(kind: str, seed: int, with_reference: bool) -> Row:
    case = make(kind, seed, HARDENING if with_reference and seed % 4 < 2 else 0.0)
    causes = case.causes(with_reference)
    true = [cause for cause in causes if case.is_true(cause)]
    return {
        "kind": kind,
        "seed": seed,
        "with_reference": with_reference,
        "right": any(map(case.has_size, true)) if case.effect else None,
        "wrong": len(true) < len(causes),
    }


def measure(folder: Path, workers: int) -> Figures:
    cases = [(kind, seed, asked) for kind in KINDS for seed in SEEDS for asked in (False, True)]
    named = {f"{k:03d}": case for k, case in enumerate(cases)}
    rows = run_cases(run_case, named, folder, workers)
    kinds = {kind: of_kind(where(rows, kind=kind)) for kind in values_of(rows, "kind")}
    asked = [row for row in rows if row["right"] is not None]
    shares = {"right": np.mean([row["right"] for row in asked]), "wrong": np.mean([row["wrong"] for row in rows])}
    return {"kinds": kinds, **shares}


def of_kind(rows: Sequence[Row]) -> dict[str, Any]:
    """Counts without and with a reference."""
    counts = {}
    for name, asked in (("alone", False), ("with_reference", True)):
        members = where(rows, with_reference=asked)
        answers = [row["right"] for row in members if row["right"] is not None]
        counts[name] = {"right": count(answers), "wrong": count(row["wrong"] for row in members)}
    return counts


def counts_table(figures: Figures) -> str:
    columns = [(asked, key) for asked in ("alone", "with_reference") for key in ("right", "wrong")]
    lines = [[kind, *(counts[a][key] or NOTHING for a, key in columns)] for kind, counts in figures["kinds"].items()]
    head = ["off", "right, without reference", "another name", "right, with reference", "another name"]
    return table(head, lines)


PART = Part(
    run=measure,
    minutes=1.0,
    headlines={"right": (0.95, 1.0), "wrong": (0.0, 0.05)},
    tables={"counts": counts_table},
)
