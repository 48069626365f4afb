"""Columns of candidates without recordings: a series of noise and waves, and proposals for made columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from synthetic_series import bias_splines
from tendonfmu.diagnosis.candidate_columns import CandidateColumns, Proposal
from tendonfmu.diagnosis.effects import Column, Place, Variant, by_name
from tendonfmu.diagnosis.effects.mechanism import SECANT
from tendonfmu.diagnosis.samples import Series
from tendonfmu.diagnosis.selection import LeastSizes
from tendonfmu.statistics.block_grams import Grams, Products
from tendonfmu.statistics.blocks import make_folds

Numbers = NDArray[np.float64]
Array = NDArray[Any]

STEP = 0.01  # s
BLOCKS = 3200
JOINTS = 2
# of sensors that resolve everything but a delay
UNSEEN = LeastSizes(np.zeros(JOINTS), np.zeros(4), STEP, np.full(JOINTS, np.inf))


def waves(rng: np.random.Generator, count: int, slowest: float = 0.1, fastest: float = 3.0) -> Numbers:
    """[B, n, c] sums of sines, some of them as slow as the bias. slowest, fastest: Hz."""
    time = STEP * np.arange(BLOCKS)[:, None, None, None]
    frequency = np.exp(rng.uniform(np.log(slowest), np.log(fastest), (JOINTS, count, 4)))
    phase = rng.uniform(0, 2 * np.pi, (JOINTS, count, 4))
    return np.asarray(np.sin(2 * np.pi * frequency * time + phase).sum(axis=3))


def coloured(rng: np.random.Generator, wander: float = 0.02, memory: float = np.exp(-STEP / 0.02)) -> Numbers:
    """[B, n] noise of variance 1 with a lag-one correlation `memory`, and a random walk."""
    gain = np.sqrt(1 - memory**2)
    start = memory * rng.standard_normal((1, JOINTS))
    noise = lfilter([gain], [1, -memory], rng.standard_normal((BLOCKS, JOINTS)), axis=0, zi=start)[0]
    return np.asarray(noise + np.cumsum(wander * rng.standard_normal((BLOCKS, JOINTS)), axis=0))


def series_with(target: Numbers) -> Series:
    """Of a target [B, n]; nothing moves."""
    blocks = len(target)
    one, many = np.zeros((blocks, JOINTS)), np.zeros((blocks, 4))
    return Series(
        time=STEP * (np.arange(blocks) + 0.5),
        recording=np.zeros(blocks, dtype=np.int64),
        segment=np.zeros(blocks, dtype=np.int64),
        target=target,
        used=np.ones(blocks, dtype=bool),
        step=STEP,
        angle=one,
        velocity=one,
        acceleration=one,
        force=many,
        tendon_velocity=np.zeros((blocks, 4, JOINTS)),
        travel=one,
        position=many,
    )


def grams_of(target: Numbers, nominal: Array, values: Array, scale: Numbers | None = None) -> Grams:
    """With splines of a slow bias; scale: of the nominal numbers, nothing known of them where it is None."""
    series = series_with(target)
    known = np.full(nominal.shape[2], np.nan) if scale is None else scale
    return Grams(Products(make_folds(series), nominal, values, bias_splines(series)), target, known)


@dataclass(frozen=True)
class Made:
    """An effect at a place, with `size` columns for each of its shapes."""

    effect: str
    joint: int | None = None
    tendon: int | None = None
    shapes: Sequence[Mapping[str, float]] = ({},)
    size: int = 1
    sign: int = 0
    expected: Sequence[float] = field(default=(1.0,))
    secant: bool = False


def candidate_columns(values: Array, made: Sequence[Made]) -> CandidateColumns:
    """values: [B, n, c], column after column of what is made."""
    first, proposals = 0, []
    for each in made:
        for shape in each.shapes:
            expected = tuple(each.expected) * (each.size if len(each.expected) == 1 else 1)
            columns = tuple(Column({"": 1.0}, each.sign, size) for size in expected)
            variant = Variant({}, shape, SECANT, full=lambda factor: {}) if each.secant else Variant({}, shape, columns)
            place = Place(each.joint, each.tendon)
            proposals.append(Proposal(by_name(each.effect), place, variant, slice(first, first + each.size)))
            first += each.size
    assert first == values.shape[2]
    return CandidateColumns(values.astype(np.float32), tuple(proposals))
