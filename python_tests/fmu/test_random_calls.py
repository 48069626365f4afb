"""Random sequences of calls, good and bad, against a twin that gets the good ones only.

The machine below knows the standard's life cycle: the binary must accept and refuse as it says, a refused call and a
discarded step must leave no trace in the saved state, and outputs are finite. The twin of an FMU of FMI 3.0 is that of
FMI 2.0, and the other way round: outputs and saved states of both have the same bits, whatever is called.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from ctypes import c_double, c_uint
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from fmu_binary import ARM, COULOMB, DISCARD, ERROR, OK, STATIC, WARNING, Instance, UnpackedFmu, motion
from fmu_kinds import good_arguments
from plant_rigs import needs_plant

SHARES = st.floats(0.0, 1.0)
NO_NUMBERS = [math.nan, math.inf, -math.inf]


def in_phase(*phases: str) -> Any:
    """Where a rule applies: the standard allows its call there."""
    return precondition(lambda self: not self.failed and self.phase in phases)


class Calls(RuleBasedStateMachine):
    """Of the friction FMU; the simulated finger's differs in the constants."""

    fmu: UnpackedFmu
    other: UnpackedFmu  # of the twin

    inputs = dict.fromkeys(
        ("tendon_force[1]", "tendon_force[3]", "tendon_position[2]", "joint_position[1]", "joint_velocity[2]"),
        (-20.0, 20.0),
    )
    extremes = (0.0, -0.0, 1e12, -1e12, 1e-300)
    tunable = ("contact.threshold[1]", "velocity_threshold.tendon", "bias.noise_std", "velocity_filter_cutoff")
    related = (STATIC, COULOMB)  # the first is not below the second where a sample is taken
    fixed = (ARM, 0.001, 0.1)
    setting = ("kinematics_source", 3)
    bad = (*NO_NUMBERS, 1.1e12, 1e308)
    steps = (1e-12, 1e-6, 1e-3, 1 / 60, 0.1, 1.0, 1e6)
    samples_at_the_start_of_a_step = True
    needs_inputs = True  # for the first sample

    @initialize(start=st.floats(-1e3, 1e3), begun=st.booleans())
    def instantiate(self, start: float, begun: bool) -> None:
        self.tried, self.twin = Instance(self.fmu), Instance(self.other, logger=False)
        self.begin()
        if begun:
            self.enter(start)
            self.leave()
        self.save()

    def begin(self) -> None:
        self.phase, self.failed, self.now = "instantiated", False, 0.0
        self.waiting, self.given, self.unsound = True, False, False  # first sample, inputs written, the first one bad
        self.pending = dict(zip(self.related, (0.03, 0.02), strict=False))

    def teardown(self) -> None:
        if hasattr(self, "tried"):
            for instance in (self.tried, self.twin):
                instance.__exit__()

    # --- what ought to happen

    def good(self, call: Callable[[Instance], int], status: int = OK) -> None:
        """Make a call that the standard allows here."""
        assert call(self.tried) == status, self.tried.messages[-1:]
        assert call(self.twin) == status

    def sample(self, call: Callable[[Instance], int]) -> bool:
        """Make a step that takes a sample; true if it was to be carried out."""
        if self.impossible:
            self.refused(call)
        elif self.unsound:
            assert call(self.tried) == DISCARD  # not the twin's
            assert self.tried.messages[-1][:2] == (DISCARD, "logStatusDiscard")
            assert next(iter(self.inputs)) in self.tried.last_message
        else:
            self.good(call)
            self.waiting = False
            return True
        return False

    def refused(self, call: Callable[[Instance], int]) -> None:
        assert call(self.tried) == ERROR
        assert self.tried.messages[-1][:2] == (ERROR, "logStatusError")
        self.failed = True

    @property
    def impossible(self) -> bool:
        """Whether parameters written so far do not go together."""
        return list(self.pending.values()) != sorted(self.pending.values(), reverse=True)

    # --- life cycle

    @in_phase("instantiated")
    @rule(start=st.floats(-1e3, 1e3))
    def enter(self, start: float) -> None:
        self.good(lambda i: i.enter_initialisation(start))
        self.phase, self.now = "initialization", start

    @in_phase("initialization")
    @rule()
    def leave(self) -> None:
        def call(instance: Instance) -> int:
            return instance.call("ExitInitializationMode")

        if self.impossible:
            self.refused(call)
            return
        self.good(call, WARNING if self.unsound else OK)
        self.phase, self.waiting = "step", self.unsound or (self.needs_inputs and not self.given)

    @in_phase("step")
    @rule(data=st.data(), moving=st.booleans())
    def do_steps(self, data: st.DataObject, moving: bool) -> None:
        for step in data.draw(st.lists(st.sampled_from(self.steps), min_size=1, max_size=10)):
            if moving and self.related and not self.failed:
                self.good(lambda i: i.write(motion(i.fmu, self.now)))
                self.given, self.unsound = True, False
            self.do_step(step)

    def do_step(self, step: float) -> None:
        point = self.now + step if self.samples_at_the_start_of_a_step else self.now
        if self.failed:
            return
        if self.samples_at_the_start_of_a_step and point == self.now and not self.waiting:  # by rounding: no sample
            self.good(lambda i: i.step(point, step))
        elif self.sample(lambda i: i.step(point, step)):
            self.now += step

    @precondition(lambda self: self.samples_at_the_start_of_a_step and not self.waiting)
    @in_phase("step")
    @rule()
    def step_at_the_same_time(self) -> None:
        self.good(lambda i: i.step(self.now, 0.1))  # takes no sample, so parameters are not looked at

    @in_phase("step")
    @rule(sure=st.integers(0, 4))
    def terminate(self, sure: int) -> None:
        if sure == 0:
            self.good(lambda i: i.call("Terminate"))
            self.phase = "terminated"

    @precondition(lambda self: self.failed or self.phase == "terminated")
    @rule()
    def reset(self) -> None:
        self.good(lambda i: i.call("Reset"))
        self.begin()

    # --- variables

    @in_phase("instantiated", "initialization", "step")
    @rule(data=st.data(), share=SHARES)
    def set_input(self, data: st.DataObject, share: float) -> None:
        name = data.draw(st.sampled_from(sorted(self.inputs)))
        low, high = self.inputs[name]
        value = data.draw(st.sampled_from([*self.extremes, low + share * (high - low)]))
        self.good(lambda i: i.write({name: value}))
        self.given, self.unsound = True, self.unsound and name != next(iter(self.inputs))

    @in_phase("instantiated", "initialization", "step")
    @rule(data=st.data(), sure=st.integers(0, 2))
    def set_bad_input(self, data: st.DataObject, sure: int) -> None:
        if sure == 0:
            value = data.draw(st.sampled_from(self.bad))
            self.good(lambda i: i.write({next(iter(self.inputs)): value}))
            self.given = self.unsound = True

    @precondition(lambda self: self.tunable)
    @in_phase("instantiated", "initialization", "step")
    @rule(data=st.data(), share=SHARES)
    def set_tunable_parameter(self, data: st.DataObject, share: float) -> None:
        name = data.draw(st.sampled_from((*self.tunable, *self.related)))
        value = share * (0.5 if name in self.related else 1e3)
        self.good(lambda i: i.write({name: value}))
        self.pending |= {name: value} if name in self.related else {}

    @in_phase("instantiated", "initialization")
    @rule(share=SHARES)
    def set_fixed_parameters(self, share: float) -> None:
        (name, low, high), (setting, most) = self.fixed, self.setting
        values = {name: low + share * (high - low), setting: 1 + round(share * (most - 1))}
        self.good(lambda i: i.write(values))

    @in_phase("instantiated", "initialization", "step", "terminated")
    @rule(reference=st.integers(0, 2**32 - 1), kind=st.sampled_from(["Float64", "Int32", "Boolean", "String"]))
    def read_any_reference(self, reference: int, kind: str) -> None:
        """As any type: right or refused, never a crash."""
        status = self.tried.transfer("Get", kind, (c_uint * 1)(reference), (c_double * 3)(), 1)
        self.failed = status != OK

    @precondition(lambda self: self.related and not (self.waiting and self.impossible))
    @in_phase("initialization", "step", "terminated")
    @rule()
    def derivative(self) -> None:
        arguments = good_arguments(self.tried, "GetDirectionalDerivative")
        expected = WARNING if self.waiting and self.unsound else OK
        assert self.tried.call("GetDirectionalDerivative", *arguments) == expected

    # --- states

    @in_phase("instantiated", "initialization", "step", "terminated")
    @rule()
    def save(self) -> None:
        inputs = self.waiting, self.given, self.unsound
        self.saved = self.tried.save(), self.phase, self.now, dict(self.pending), inputs

    @rule()
    def restore(self) -> None:
        data, self.phase, self.now, pending, (self.waiting, self.given, self.unsound) = self.saved
        self.pending, self.failed = dict(pending), False
        self.good(lambda i: i.restore(data))

    # --- calls that are refused

    @rule(data=st.data())
    def bad_call(self, data: st.DataObject) -> None:
        first = next(iter(self.inputs))
        name = data.draw(st.sampled_from([*self.tunable, *self.related, self.fixed[0]]))
        value, back = data.draw(st.sampled_from(self.bad)), data.draw(st.floats(1e-3, 1e9))
        step = data.draw(st.sampled_from([0.0, -0.0, -1e-3, *NO_NUMBERS]))
        damaged = bytearray(self.saved[0])
        damaged[data.draw(st.integers(0, len(damaged) - 1))] ^= data.draw(st.integers(1, 255))
        calls: dict[str, Callable[[Instance], int]] = {
            "value": lambda i: i.write({first: 0.7, name: value}),
            "step": lambda i: i.step(self.now, step),
            "step back": lambda i: i.step(self.now - back, 0.1),
            "state": lambda i: i.restore(bytes(damaged)),
        }
        if self.failed or self.phase != "instantiated":
            calls["enter"] = lambda i: i.enter_initialisation()
        if self.failed or self.phase != "initialization":
            calls["leave"] = lambda i: i.call("ExitInitializationMode")
        if self.failed or self.phase != "step":
            calls |= {"terminate": lambda i: i.call("Terminate"), "too early": lambda i: i.step(self.now)}
        if self.failed or self.phase in ("step", "terminated"):
            calls["fixed"] = lambda i: i.write({self.fixed[0]: self.fixed[1]})
            calls["setting"] = lambda i: i.write({self.setting[0]: 1})
        self.refused(calls[data.draw(st.sampled_from(sorted(calls)))])

    # --- what always holds

    @invariant()
    def same_as_the_twin(self) -> None:
        if hasattr(self, "tried"):
            assert self.tried.save() == self.twin.save()

    @invariant()
    def outputs_are_the_numbers_of_the_twin(self) -> None:
        readable = hasattr(self, "tried") and self.phase != "instantiated" and not self.failed
        if readable and not (self.waiting and (self.impossible or self.unsound)):
            shown = self.tried.outputs()
            assert all(map(math.isfinite, shown))
            assert bytes((ctypes.c_double * len(shown))(*shown)) == bytes(
                (ctypes.c_double * len(shown))(*self.twin.outputs())
            )


class PlantCalls(Calls):
    """Restoring starts CVODE anew, so both instances restore at the same times."""

    inputs = {  # noqa: RUF012  (as of the base)
        "pretension": (-2.0, 8.0),
        "tendon_position_command[2]": (-1e-3, 1e-3),
        "push_force[1]": (-1.0, 1.0),
        "push_force[3]": (-1.0, 1.0),
    }
    extremes = (0.0, -0.0)
    tunable = ()
    related = ()
    fixed = ("relative_tolerance", 1e-6, 1e-4)
    setting = ("push_link", 2)
    bad = (*NO_NUMBERS, 1e5)
    steps = (1e-9, 1e-5, 1e-3, 1 / 60, 0.02)
    samples_at_the_start_of_a_step = False
    needs_inputs = False


def run(machine: type[Calls], fmu: UnpackedFmu, other: UnpackedFmu, examples: int) -> None:
    options = settings(
        max_examples=examples, stateful_step_count=60, deadline=None, suppress_health_check=list(HealthCheck)
    )
    of_these = type(machine.__name__, (machine,), {"fmu": fmu, "other": other})
    run_state_machine_as_test(of_these, settings=options)  # type: ignore[no-untyped-call]


@pytest.mark.parametrize("examples", [25, pytest.param(300, marks=pytest.mark.long)])
@pytest.mark.parametrize("version", [2, 3])
def test_random_calls(small_fmu: UnpackedFmu, small_fmu3: UnpackedFmu, version: int, examples: int) -> None:
    pair = (small_fmu, small_fmu3) if version == 2 else (small_fmu3, small_fmu)
    run(Calls, *pair, examples)


@needs_plant
@pytest.mark.parametrize("examples", [10, pytest.param(100, marks=pytest.mark.long)])
def test_random_calls_of_the_simulated_finger(plant_fmu: UnpackedFmu, examples: int) -> None:
    run(PlantCalls, plant_fmu, plant_fmu, examples)
