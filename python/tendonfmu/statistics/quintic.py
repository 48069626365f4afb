"""How piecewise quintic curves run between knots, twice continuously differentiable.

Each piece is the polynomial of degree 5 with position, velocity and acceleration of both its knots (quintic Hermite).
Outside the knots the position is constant.
"""

from __future__ import annotations

import numpy as np

from tendonfmu.arrays import Numbers


def evaluate(knots: Numbers, time: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Evaluate a curve and its derivatives. knots: [k, 4] (rad); time: [N] (s); returns [N]."""
    if len(knots) == 1:
        return np.full(len(time), knots[0, 1]), np.zeros(len(time)), np.zeros(len(time))
    piece = np.clip(np.searchsorted(knots[:, 0], time, side="right") - 1, 0, len(knots) - 2)
    begin, end = knots[:-1][piece].T, knots[1:][piece].T
    h = end[0] - begin[0]
    u = np.clip((time - begin[0]) / h, 0.0, 1.0)
    v0, v1 = begin[2] * h, end[2] * h
    a0, a1 = begin[3] * h * h / 2, end[3] * h * h / 2
    rise = end[1] - begin[1] - v0 - a0  # the cubic and higher terms add up to this at u = 1
    slope, bend = v1 - v0 - 2 * a0, a1 - a0
    c3, c4, c5 = 10 * rise - 4 * slope + bend, -15 * rise + 7 * slope - 2 * bend, 6 * rise - 3 * slope + bend
    position = begin[1] + u * (v0 + u * (a0 + u * (c3 + u * (c4 + u * c5))))
    velocity = (v0 + u * (2 * a0 + u * (3 * c3 + u * (4 * c4 + u * 5 * c5)))) / h
    acceleration = (2 * a0 + u * (6 * c3 + u * (12 * c4 + u * 20 * c5))) / (h * h)
    # exactly the last knot, without rounding errors
    position, velocity, acceleration = (
        np.where(u < 1, inside, last) for inside, last in zip((position, velocity, acceleration), end[1:], strict=True)
    )
    outside = (time < knots[0, 0]) | (time > knots[-1, 0])
    return position, np.where(outside, 0.0, velocity), np.where(outside, 0.0, acceleration)
