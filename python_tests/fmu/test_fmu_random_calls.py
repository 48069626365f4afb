"""Random sequences of FMU calls, good and bad, against a twin that gets the good ones only.

The model below knows the standard's life cycle; the binary must accept and refuse as it says, a refused call must leave
no trace in the saved state, and whatever happens the outputs are finite and no call crashes.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from ctypes import c_double, c_uint

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

from fmu_binary import ARM, COULOMB, ERROR, OK, STATIC, Instance, UnpackedFmu

INPUTS = ("tendon_force[1]", "tendon_force[3]", "tendon_position[2]", "joint_position[1]", "joint_velocity[2]")
TUNABLE = ("contact.threshold[1]", "velocity_threshold.tendon", "bias.noise_std", "velocity_filter_cutoff")
VALUES = st.floats(-20, 20) | st.sampled_from([0.0, -0.0, 1e12, -1e12, 1e-300])
BAD_VALUES = st.sampled_from([math.nan, math.inf, -math.inf, 1.1e12, 1e308])
STEPS = st.floats(1e-6, 1.0) | st.sampled_from([1 / 60, 1e-12, 1e6])
BAD_STEPS = st.sampled_from([0.0, -0.0, -1e-3, math.nan, math.inf, -math.inf])


class Calls(RuleBasedStateMachine):
    fmu: UnpackedFmu

    @initialize()
    def instantiate(self) -> None:
        self.tried, self.twin = Instance(self.fmu), Instance(self.fmu, logger=False)
        self.phase, self.failed = "instantiated", False
        self.now = 0.0
        self.pending = {STATIC: 0.03, COULOMB: 0.02}
        self.saved: tuple[bytes, str, float, dict[str, float]] | None = None

    def teardown(self) -> None:
        if hasattr(self, "tried"):
            for instance in (self.tried, self.twin):
                instance.call("Reset")
                instance.__exit__(None, None, None)

    # --- what ought to happen

    def good(self, call: Callable[[Instance], int], *phases: str) -> bool:
        """Makes a call that the standard allows in some phases; true when it was to be carried out."""
        if self.failed or self.phase not in phases:
            self.refused(call)
            return False
        assert call(self.tried) == OK, self.tried.messages[-1:]
        assert call(self.twin) == OK
        return True

    def refused(self, call: Callable[[Instance], int]) -> None:
        assert call(self.tried) == ERROR
        assert self.tried.messages[-1][:2] == (ERROR, "logStatusError")
        self.failed = True

    # --- life cycle

    @rule(start=st.floats(-1e3, 1e3))
    def setup(self, start: float) -> None:
        if self.good(lambda i: i.setup(start), "instantiated"):
            self.now = start

    @rule()
    def enter(self) -> None:
        if self.good(lambda i: i.call("EnterInitializationMode"), "instantiated"):
            self.phase = "initialization"

    def sample(self, call: Callable[[Instance], int], phase: str) -> bool:
        """A call that takes a sample: refused when the parameters written so far do not go together."""
        if self.pending[STATIC] < self.pending[COULOMB]:
            self.refused(call)
            return False
        return self.good(call, phase)

    @rule()
    def leave(self) -> None:
        if self.sample(lambda i: i.call("ExitInitializationMode"), "initialization"):
            self.phase = "step"

    @rule(step=STEPS)
    def do_step(self, step: float) -> None:
        taken_already = self.now + step == self.now  # by rounding
        if (self.good if taken_already else self.sample)(lambda i: i.step(self.now + step, step), "step"):
            self.now += step

    @rule(step=STEPS)
    def step_at_the_same_time(self, step: float) -> None:
        self.good(lambda i: i.step(self.now, step), "step")  # takes no sample, so parameters are not looked at

    @precondition(lambda self: self.phase == "step")
    @rule()
    def terminate(self) -> None:
        if self.good(lambda i: i.call("Terminate"), "step"):
            self.phase = "terminated"

    @precondition(lambda self: self.failed or self.phase == "terminated")
    @rule()
    def reset(self) -> None:
        assert self.tried.call("Reset") == OK and self.twin.call("Reset") == OK
        self.phase, self.failed, self.now = "instantiated", False, 0.0
        self.pending = {STATIC: 0.03, COULOMB: 0.02}

    # --- variables

    @rule(name=st.sampled_from(INPUTS), value=VALUES)
    def set_input(self, name: str, value: float) -> None:
        self.good(lambda i: i.set_real({name: value}), "instantiated", "initialization", "step")

    @rule(name=st.sampled_from(TUNABLE), value=st.floats(0, 1e3))
    def set_parameter(self, name: str, value: float) -> None:
        self.good(lambda i: i.set_real({name: value}), "instantiated", "initialization", "step")

    @rule(name=st.sampled_from([STATIC, COULOMB]), value=st.floats(0, 0.5))
    def set_related_parameter(self, name: str, value: float) -> None:
        if self.good(lambda i: i.set_real({name: value}), "instantiated", "initialization", "step"):
            self.pending[name] = value

    @rule(value=st.floats(0.001, 0.1))
    def set_fixed_parameter(self, value: float) -> None:
        self.good(lambda i: i.set_real({ARM: value}), "instantiated", "initialization")

    @rule(source=st.integers(1, 3))
    def set_source(self, source: int) -> None:
        self.good(lambda i: i.set_integer("kinematics_source", source), "instantiated", "initialization")

    @rule(name=st.sampled_from(INPUTS + TUNABLE + (STATIC, ARM)), value=BAD_VALUES)
    def set_bad_value(self, name: str, value: float) -> None:
        self.refused(lambda i: i.set_real({"tendon_force[2]": 7.0, name: value}))

    @rule(step=BAD_STEPS)
    def bad_step(self, step: float) -> None:
        self.refused(lambda i: i.step(self.now, step))

    @rule(back=st.floats(1e-3, 1e9))
    def step_back(self, back: float) -> None:
        self.refused(lambda i: i.step(self.now - back, 0.1))

    @rule(reference=st.integers(0, 2**32 - 1), kind=st.sampled_from(["Real", "Integer", "Boolean", "String"]))
    def any_reference(self, reference: int, kind: str) -> None:
        """Reading any value reference as any type: right or refused, never a crash."""
        room = (c_double * 1)()
        status = self.tried.call("Get" + kind, ctypes.byref(c_uint(reference)), 1, room)
        self.failed = self.failed or status != OK

    @rule(kind=st.integers(-2, 6), name=st.sampled_from(["", "Real", "Integer", "Boolean", "String"]))
    def any_status(self, kind: int, name: str) -> None:
        room = (ctypes.c_int64 * 1)()
        status = self.tried.call(f"Get{name}Status", kind, room)
        assert (status == ERROR) == (self.failed or self.phase not in ("step", "terminated"))
        self.failed = self.failed or status == ERROR

    @rule(seed=st.floats(-1, 1))
    def derivative(self, seed: float) -> None:
        impossible = self.pending[STATIC] < self.pending[COULOMB]
        if self.failed or self.phase == "instantiated" or (self.phase == "initialization" and impossible):
            return
        known, unknown = self.tried.vrs(INPUTS), self.tried.vrs(["joint_torque[1]", "friction_torque[2]"])
        seeds, found = (c_double * len(INPUTS))(*[seed] * len(INPUTS)), (c_double * 2)(math.nan, math.nan)
        arguments = (unknown, 2, known, len(INPUTS), seeds, found)
        assert self.tried.call("GetDirectionalDerivative", *arguments) == OK
        assert all(math.isfinite(value) for value in found)

    # --- states

    @rule()
    def save(self) -> None:
        if not self.failed:
            self.saved = (self.tried.save(), self.phase, self.now, dict(self.pending))

    @precondition(lambda self: self.saved is not None)
    @rule()
    def restore(self) -> None:
        assert self.saved
        data, self.phase, self.now, pending = self.saved
        self.pending = dict(pending)
        assert self.tried.restore(data) == OK and self.twin.restore(data) == OK
        self.failed = False

    @precondition(lambda self: self.saved is not None)
    @rule(at=st.integers(0, 10**6), flip=st.integers(1, 255))
    def restore_damaged(self, at: int, flip: int) -> None:
        assert self.saved
        bad = bytearray(self.saved[0])
        bad[at % len(bad)] ^= flip
        self.refused(lambda i: i.restore(bytes(bad)))

    # --- what always holds

    @invariant()
    def same_as_the_twin(self) -> None:
        if hasattr(self, "tried"):
            assert self.tried.save() == self.twin.save()

    @invariant()
    def outputs_are_numbers(self) -> None:
        readable = hasattr(self, "tried") and self.phase != "instantiated"
        impossible = readable and self.phase == "initialization" and self.pending[STATIC] < self.pending[COULOMB]
        if readable and not self.failed and not impossible:
            assert all(math.isfinite(value) for value in self.tried.outputs())
            flags = self.tried.get_integers(self.fmu.names("output", "Boolean"), "Boolean")
            assert set(flags) <= {0, 1}


@pytest.mark.parametrize("examples", [pytest.param(60), pytest.param(300, marks=pytest.mark.long)])
def test_random_calls(small_fmu: UnpackedFmu, examples: int) -> None:
    machine = type("CallsOfTheSmallFmu", (Calls,), {"fmu": small_fmu})
    run_state_machine_as_test(  # type: ignore[no-untyped-call]
        machine,
        settings=settings(
            max_examples=examples, stateful_step_count=60, deadline=None, suppress_health_check=list(HealthCheck)
        ),
    )
