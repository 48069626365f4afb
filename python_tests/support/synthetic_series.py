"""Block series of a hand that strokes at random, with coloured noise and a wandering bias: no model, no recording."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.signal import lfilter

from tendonfmu.diagnosis.samples import Series
from tendonfmu.statistics.blocks import BlockSeries, basis, spline_basis, without

Numbers = NDArray[np.float64]

STEP = 0.01  # s
NOISE = 0.01  # N·m
ARMS = np.array([[0.008, 0.006], [-0.009, 0.007], [0.007, -0.01], [-0.01, -0.008]])  # m
STIFFNESS = 6000.0  # N/m


def bias_splines(series: BlockSeries, knots: float = 2.0) -> Any:
    """[B, s] sparse: splines of a slow bias, apart for each stretch without a gap."""
    blocks = []
    for number in np.unique(series.segment):
        time = series.time[series.segment == number]
        blocks.append(spline_basis(time, max(float(time[-1] - time[0]), series.step), knots))
    return sparse.csr_array(sparse.block_diag(blocks, format="csr"))


def strokes(rng: np.random.Generator, blocks: int) -> tuple[Numbers, Numbers, Numbers]:
    """Angle, velocity and acceleration [B] of smooth strokes between random angles, with rests."""
    angle, velocity, acceleration = np.zeros((3, blocks))
    k, here = 0, 0.0
    while k < blocks:
        duration, there = rng.uniform(0.3, 1.3), rng.uniform(-0.8, 0.8)
        s = np.linspace(0.0, 1.0, min(round(duration / STEP), blocks - k))
        rows = slice(k, k + len(s))
        angle[rows] = here + (there - here) * (10 * s**3 - 15 * s**4 + 6 * s**5)
        velocity[rows] = (there - here) * (30 * s**2 - 60 * s**3 + 30 * s**4) / duration
        acceleration[rows] = (there - here) * (60 * s - 180 * s**2 + 120 * s**3) / duration**2
        k, here = k + len(s), float(angle[k + len(s) - 1])
        rest = min(round(rng.uniform(0.1, 0.6) / STEP), blocks - k) if rng.random() < 0.6 else 0
        angle[k : k + rest] = here
        k += rest
    return angle, velocity, acceleration


def low_passed(signal: Numbers, time_constant: float) -> Numbers:
    share = 1.0 - np.exp(-STEP / time_constant)
    return np.asarray(lfilter([share], [1.0, share - 1.0], signal, axis=0))


def make_series(seed: int, seconds: float = 60.0) -> Series:
    """2 joints, 4 tendons; target: noise of NOISE N·m with a memory of 20-80 ms and a bias of 5 mN·m/√s."""
    rng = np.random.default_rng(seed)
    blocks = round(seconds / STEP)
    motion = [strokes(rng, blocks) for _ in range(2)]
    angle, velocity, acceleration = (np.stack([each[k] for each in motion], axis=1) for k in range(3))
    slow = low_passed(low_passed(rng.standard_normal((blocks, 4)), 0.5), 0.2)
    force = 10.0 + 36.0 * np.abs(slow)
    tendon = np.cumsum((velocity[:, None, :] * ARMS)[:, :, ::-1], axis=2)[:, :, ::-1]
    drive = rng.standard_normal((blocks, 2))
    colour = np.stack([lfilter([1.0], [1.0, -rng.uniform(0.6, 0.88)], drive[:, j]) for j in range(2)], axis=1)
    noise = NOISE * (0.8 * colour / colour.std(axis=0) + 0.6 * rng.standard_normal((blocks, 2)))
    bias = 0.005 * np.sqrt(STEP) * np.cumsum(rng.standard_normal((blocks, 2)), axis=0)
    return Series(
        time=(np.arange(blocks) + 0.5) * STEP,
        recording=np.zeros(blocks, dtype=np.int64),
        segment=np.zeros(blocks, dtype=np.int64),
        target=noise + bias,
        used=np.ones(blocks, dtype=bool),
        step=STEP,
        angle=angle,
        velocity=velocity,
        acceleration=acceleration,
        force=force,
        tendon_velocity=tendon,
        travel=np.stack([travelled(angle[:, j], velocity[:, j]) for j in range(2)], axis=1),
        position=angle @ ARMS.T + force / STIFFNESS,
    )


def travelled(angle: Numbers, velocity: Numbers) -> Numbers:
    """[B] rad since the joint last turned round."""
    found, side, start = np.zeros(len(angle)), 0.0, float(angle[0])
    for k in range(len(angle)):
        if abs(velocity[k]) > 0.01 and np.sign(velocity[k]) != side:
            side, start = np.sign(velocity[k]), float(angle[k])
        found[k] = abs(angle[k] - start)
    return found


def nuisance_of(series: Series) -> list[Numbers]:
    """Bias splines and the columns of an ordinary nominal model, of each joint."""
    splines = bias_splines(series).toarray()
    found = []
    for joint in range(2):
        side = np.tanh(series.velocity[:, joint] / 0.02)
        edges = series.force * np.tanh(series.tendon_velocity[:, :, joint] / 1e-4)
        plain = np.stack([side, series.velocity[:, joint], series.angle[:, joint]], axis=1)
        found.append(np.concatenate([splines, plain, edges], axis=1))
    return found


def residual_of(series: Series, nuisance: list[Numbers]) -> Numbers:
    """[B, n] the target off the nuisance columns."""
    return np.stack([without(series.target[:, j], basis(each)) for j, each in enumerate(nuisance)], axis=1)


def with_effect(series: Series, nuisance: list[Numbers], signal: Numbers, joint: int, strength: float) -> Series:
    """signal [B] added to a joint (from 0): its part off the nuisance columns has strength × noise variance."""
    span = basis(nuisance[joint])
    noise, visible = without(series.target[:, joint], span).std(), without(signal, span).std()
    target = series.target.copy()
    target[:, joint] += signal * np.sqrt(strength) * noise / visible
    return replace(series, target=target)
