"""Small MuJoCo models for tests, as MJCF texts."""

from __future__ import annotations

from typing import Any

# Two hinges, four fixed tendons with known arms, and everything that an import has to name.
FIXED = """<mujoco model="pair">
  <compiler angle="{angle}" autolimits="true"/>
  <option timestep="0.0005" gravity="0 0 {gravity}" integrator="implicitfast"/>
  <default>
    <joint axis="0 -1 0" armature="3e-5" solreffriction="0.002 1" solimpfriction="0.9999 0.9999 0.001"/>
    <tendon solreffriction="0.002 1" solimpfriction="0.9999 0.9999 0.001"/>
    <default class="rubbing"><joint damping="0.002" frictionloss="0.006"/></default>
  </default>
  <worldbody>
    <body name="first" pos="0.1 0.02 0">
      <joint name="mcp" class="rubbing" range="{low} {high}" stiffness="0.02" springref="{rest}"/>
      <inertial pos="0.02 0 0" mass="0.02" diaginertia="1e-6 4e-6 4e-6"/>
      <body name="second" pos="0.04 0 0">
        <joint name="pip" class="rubbing" frictionloss="0.004" range="{low} {high}"/>
        <inertial pos="0.015 0 0" mass="0.01" diaginertia="1e-6 2e-6 2e-6"/>
        <site name="tip" pos="0.03 0 0.001"/>
      </body>
    </body>
    <body name="aside" pos="0 0.5 0">
      <joint name="thumb" type="hinge" axis="0 1 0"/>
      <joint name="slider" type="slide" axis="1 0 0"/>
      <geom size="0.01"/>
    </body>
    <body name="loose" pos="0 1 0"><freejoint name="thrown"/><geom size="0.01"/></body>
    <body name="round" pos="0 2 0"><joint name="shoulder" type="ball"/><geom size="0.01"/></body>
  </worldbody>
  <tendon>
    <fixed name="deep"><joint joint="mcp" coef="-0.009"/><joint joint="pip" coef="-0.006"/></fixed>
    <fixed name="long" frictionloss="0.4">
      <joint joint="mcp" coef="0.007"/><joint joint="pip" coef="0.005"/>
    </fixed>
    <fixed name="short"><joint joint="mcp" coef="-0.008"/></fixed>
    <fixed name="back" damping="3" armature="0.01"><joint joint="mcp" coef="0.0075"/></fixed>
    <fixed name="spring" stiffness="50"><joint joint="pip" coef="0.004"/></fixed>
    <fixed name="elsewhere"><joint joint="thumb" coef="0.01"/></fixed>
  </tendon>
  <actuator>
    <position name="pull_deep" tendon="deep" kp="4000" forcerange="-100 0"/>
    <position name="pull_long" tendon="long" kp="4000" forcerange="-100 0"/>
    <position name="pull_short" tendon="short" kp="4000" forcerange="-100 0"/>
    <position name="pull_back" tendon="back" kp="4000" forcerange="-100 0"/>
    <motor name="pull_elsewhere" tendon="elsewhere"/>
    <motor name="direct" joint="pip"/>
  </actuator>
  <equality><joint name="coupled" joint1="pip" joint2="mcp"/></equality>
</mujoco>
"""
ARMS = [[0.009, 0.006], [-0.007, -0.005], [0.008, 0.0], [-0.0075, 0.0]]  # of the driven tendons, m

# One hinge; `bow` runs straight past it between two sites at `reach` from the axis, `pulley` around a cylinder.
BOWSTRING = """<mujoco model="bow">
  <compiler angle="radian"/>
  <worldbody>
    <site name="before" pos="-0.02 0 0.01"/>
    <site name="low_before" pos="-0.02 0 0"/>
    <body name="link">
      <joint name="hinge" axis="0 -1 0" range="-0.5 0.5" limited="true"/>
      <inertial pos="0.02 0 0" mass="0.02" diaginertia="1e-6 4e-6 4e-6"/>
      <geom name="wheel" type="cylinder" zaxis="0 1 0" size="0.008 0.002"/>
      <site name="under" pos="0 0 -0.012"/>
      <site name="after" pos="0.01 0 0.01"/>
      <site name="low_after" pos="0.02 0 0"/>
      <site name="tip" pos="0.04 0 0"/>
    </body>
  </worldbody>
  <tendon>
    <spatial name="bow"><site site="before"/><site site="after"/></spatial>
    <spatial name="pulley">
      <site site="low_before"/><geom geom="wheel" sidesite="under"/><site site="low_after"/>
    </spatial>
  </tendon>
  <actuator><motor name="a" tendon="bow" gear="-2"/><motor name="b" tendon="pulley"/></actuator>
</mujoco>
"""


def fixed_model(**changes: Any) -> str:
    """The model FIXED, in radians and without weight unless `changes` say otherwise."""
    numbers = {"angle": "radian", "low": -0.5, "high": 1.2, "rest": 0.1, "gravity": 0.0}
    return FIXED.format(**(numbers | changes))
