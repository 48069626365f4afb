"""Where the demo finger's tendons rub: wrap angles and bearing ratios, with their origin.

Pure data of the *true* finger. `finger_plant.py` turns it into friction; the index finger's
description (`../fingers/index_finger.json`) holds the same contacts as a fit would see them:
sampled at working points and rounded.
"""

from __future__ import annotations

# friction coefficient of a braided polyethylene fibre on a smooth metal edge
EDGE_COEFFICIENT = 0.10

# half of each joint's range and its middle, rad: abduction, flexion of mcp, pip, dip
JOINT_MIDDLE = (0.0, 0.55, 0.8, 0.65)
JOINT_HALF_RANGE = (0.35, 0.85, 0.8, 0.65)

# The angle by which a tendon is diverted by the edge in front of joint j:
#     wrap = rest + growth * ((q_{j-1} - centre) / half_range)**2        [rad]
# (rest, growth, centre) per tendon, base joint first; None: the tendon does not pass there.
# In front of joint 1 nothing bends (q_0 = 0), growth is 0.
EDGE_WRAP: tuple[tuple[tuple[float, float, float] | None, ...], ...] = (
    ((0.18, 0.0, 0.0), (0.12, 0.22, -0.05), None, None),
    ((0.20, 0.0, 0.0), (0.12, 0.22, 0.05), None, None),
    ((0.15, 0.0, 0.0), (0.10, 0.18, -0.04), None, None),
    ((0.16, 0.0, 0.0), (0.10, 0.18, 0.04), None, None),
    ((0.14, 0.0, 0.0), (0.11, 0.20, -0.03), (0.14, 0.26, 0.35), None),
    ((0.14, 0.0, 0.0), (0.11, 0.20, 0.03), (0.12, 0.22, 0.70), None),
    ((0.12, 0.0, 0.0), (0.10, 0.24, 0.02), (0.13, 0.28, 0.40), (0.15, 0.26, 0.60)),
    ((0.12, 0.0, 0.0), (0.10, 0.24, -0.02), (0.11, 0.24, 0.75), (0.12, 0.22, 0.95)),
)

# Coulomb friction of a pulley on its ball bearing, as a fraction of the tension: bearing
# coefficient x (bearing radius / pulley radius) x 2 sin(wrap/2); pulleys of joints 1 to 3.
PULLEY_RATIO: tuple[tuple[float | None, ...], ...] = (
    (0.009, None, None),
    (0.009, None, None),
    (0.008, None, None),
    (0.008, None, None),
    (0.010, 0.009, None),
    (0.009, 0.008, None),
    (0.010, 0.011, 0.013),
    (0.009, 0.010, 0.012),
)

# rise of the friction from sliding to breakaway, and the velocity (m/s) at which it has gone
EDGE_STATIC_RATIO, EDGE_STRIBECK_VELOCITY = 1.25, 0.004
PULLEY_STATIC_RATIO, PULLEY_STRIBECK_VELOCITY = 1.15, 0.006
# grease: growth with the velocity, fraction of the tension per m/s
EDGE_VISCOUS, PULLEY_VISCOUS = 0.10, 0.15

# distance over which a contact's bristles give way before it slides, m; of a joint, rad
EDGE_BRISTLE, PULLEY_BRISTLE, JOINT_BRISTLE = 40e-6, 25e-6, 0.004

# per joint: sliding friction (N.m) and its share of the load (m: bearing coefficient x pin radius),
# breakaway over sliding, the velocity (rad/s) at which that has gone, viscous part (N.m.s)
JOINT_FRICTION = (0.0050, 0.0040, 0.0030, 0.0022)
LOAD_FRICTION = (3.0e-5, 2.5e-5, 2.0e-5, 1.6e-5)
JOINT_STATIC_RATIO, JOINT_STRIBECK_VELOCITY, JOINT_VISCOUS = 1.25, 0.10, 0.0012

# plastic cover: spring (N.m/rad) about a built-in angle (rad)
COVER_STIFFNESS = (0.020, 0.015, 0.012, 0.008)
COVER_REST_ANGLE = (0.0, 0.35, 0.45, 0.35)

# moment of inertia of what moves with the joint, kg.m2, and the links' lengths, m
INERTIA = (1.2e-4, 1.2e-4, 4.0e-5, 1.0e-5)
LINK_LENGTH = (0.045, 0.028, 0.022)
