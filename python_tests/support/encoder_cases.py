"""How often what is off between angles and tendons is named: the table of docs/evidence/change.md.

.venv/bin/python python_tests/support/encoder_cases.py --half even
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from encoder_finger import EncoderFinger, encoder_finger
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
SEEDS = {"odd": range(1, 12, 2), "even": range(14, 26, 2)}  # of fingers: to choose constants with, to report
OTHER_LOAD = 1.25  # times the pretension of the reference, in every third finger
HARDENING = 0.004  # per N, in every second finger with a reference: a twentieth of the stretch


@dataclass(frozen=True)
class Case:
    """A finger as it was, or is described, and as it is now."""

    kind: str
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
        given = read_input(self.before.description, now[:1], now[1:], then, 1, 0.03, True)
        return find_kinematic_causes(given, 0.03, 0).causes

    def is_right(self, causes: Sequence[Cause]) -> bool:
        return any(self.is_true(cause) and self._is_sized(cause) for cause in causes)

    def is_true(self, cause: Cause) -> bool:
        return (cause.effect, cause.joint, cause.tendon) == (self.effect, self.joint, self.tendon)

    def _is_sized(self, cause: Cause) -> bool:
        """Whether the size is within a tenth, or half of the interval if that is larger."""
        changed = cause.changed
        if changed is None:
            return True
        share = changed.reference.value if self.effect in ("moment_arm", "tendon_nonlinearity") else 1.0
        off = abs(changed.change.value / share - self.size)
        return off < max(0.1 * abs(self.size), 0.5 * abs((changed.change.high - changed.change.low) / share))


def made_up(kind: str, seed: int, hardening: float = 0.0) -> Case:
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
    return Case(kind, effect, at_joint, at_tendon, size, before, now, seed)


def rows(half: str) -> Iterator[str]:
    for kind in KINDS:
        cells = []
        for with_reference in (False, True):
            right = false = 0
            for seed in SEEDS[half]:
                case = made_up(kind, seed, HARDENING if with_reference and seed % 4 < 2 else 0.0)
                causes = case.causes(with_reference)
                right += case.is_right(causes)
                false += any(not case.is_true(cause) for cause in causes)
                if (not case.is_right(causes) and case.effect) or any(not case.is_true(cause) for cause in causes):
                    print(
                        f"  {kind}, seed {seed}, reference {with_reference}: {list(causes)} for {case.effect}"
                        f" {case.joint} {case.tendon} {case.size}"
                    )
            cells += [f"{right}/{len(SEEDS[half])}" if KINDS[kind][0] else "", f"{false}/{len(SEEDS[half])}"]
        yield f"| {kind} | {' | '.join(cells)} |"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--half", choices=("odd", "even"), default="even")
    for row in rows(parser.parse_args().half):
        print(row, flush=True)
