"""A structural-residual test as fault diagnosis has it (Gertler 1998; Blanke et al. 2016): detect, then isolate.

Residuals are parity relations of the torque balance. One for each joint is the balance of that joint. One for each
tendon is the part of the balance that no force of this tendon can enter: its component across the tendon's moment arms.

- Detection: a generalised likelihood ratio test for a mean that is not 0, in windows of three lengths. Noise is
  independent and normal; its variance is that of the first half of the recording (training), the second half is tested.
  The threshold is the chi-square quantile at 1 % over all windows and residuals (Bonferroni).
- Isolation: the fault signature matrix says which residuals an effect enters, which is where its columns have at least
  5 % of their power. The effects whose signature is the pattern of residuals that fired are named, all of them.

It can name the joint, and with two joints or more some tendons. It cannot name a law: all effects that enter the same
residuals have the same signature (a spring and a weight at the same joint, say), so what it names is a set without an
order. A pattern that is nobody's signature is an alarm without a name. Without a recording from before the fault, the
variance of the training half has the fault in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from rival_columns import Numbers, Plain, least_power
from tendonfmu.diagnosis.result import Where

Flags = NDArray[np.bool_]

SIGNIFICANCE = 0.01
ENTERS = 0.05  # of a column's power; less would not fire while the rest of it does
WINDOWS = (0.1, 0.3, 1.0)  # s


@dataclass(frozen=True)
class Parity:
    """fired: [k] residuals, joints first, then tendons. causes: all effects with that signature."""

    fired: Flags
    causes: list[Where]


def by_parity(data: Plain, arms: Numbers, step: float) -> Parity:
    """arms: [m, n] m. step: s, of a block."""
    relations = parity_relations(arms)
    fired = detected(data.target.reshape(-1, arms.shape[1]), relations, step)
    signatures = signature_matrix(data, relations)
    named = [where for where, signature in signatures.items() if fired.any() and np.array_equal(signature, fired)]
    return Parity(fired, named)


def parity_relations(arms: Numbers) -> list[Numbers]:
    """[n, d] orthonormal directions of each residual: the n joints, then what is left of each tendon, where n > 1."""
    joints = arms.shape[1]
    found = [np.eye(joints)[:, [j]] for j in range(joints)]
    if joints > 1:
        found += [np.linalg.svd(own[None], full_matrices=True)[2][1:].T for own in arms]
    return found


def detected(residual: Numbers, relations: list[Numbers], step: float) -> Flags:
    """[k] whether each residual fires. residual: [B, n] N·m."""
    half = len(residual) // 2
    training, test = residual[:half], residual[half:]
    lengths = [min(max(1, round(window / step)), max(len(test), 1)) for window in WINDOWS]
    looks = len(relations) * sum(len(test) // length for length in lengths)
    fired = []
    for directions in relations:
        spread = np.sqrt(np.mean((training @ directions) ** 2, axis=0))
        seen = (test @ directions) / np.maximum(spread, 1e-300)
        threshold = float(chi2.isf(SIGNIFICANCE / max(looks, 1), directions.shape[1]))
        fired.append(any(_largest_ratio(seen, length) > threshold for length in lengths))
    return np.array(fired)


def _largest_ratio(values: Numbers, length: int) -> float:
    """Twice the logarithm of the likelihood ratio of the window that shows most; values: [B, d] of variance 1."""
    count = len(values) // length
    means = values[: count * length].reshape(count, length, -1).mean(axis=1)
    return float((length * np.sum(means**2, axis=1)).max(initial=0.0))


def signature_matrix(data: Plain, relations: list[Numbers]) -> dict[Where, Flags]:
    """[k] for each effect at a place: which residuals it enters."""
    power = np.einsum("rc,rc->c", data.columns, data.columns)
    joints = len(relations[0])
    found: dict[Where, Flags] = {}
    for where in dict.fromkeys(trial.where for trial in data.trials):
        numbers = [n for trial in data.trials if trial.where == where for n in trial.numbers]
        numbers = [n for n in numbers if power[n] > least_power(power)]
        if not numbers:
            continue
        columns = data.columns[:, numbers] / np.sqrt(power[numbers])
        wide = columns.reshape(-1, joints, len(numbers))
        share = [np.einsum("bjc,jd->bdc", wide, directions) for directions in relations]
        found[where] = np.array([float(np.mean(np.sum(each**2, axis=(0, 1)))) >= ENTERS for each in share])
    return found
