"""What a simulated finger records, together with the true signals."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.arrays import Array
from tendonfmu.files import counted
from tendonfmu.simulate.plant import MEASURED, TRUE, refused_by, require_plant
from tendonfmu.simulate.rig import Rig, plant_of

if TYPE_CHECKING:
    from tendonfmu.simulate.plant import Statistics

Table = dict[str, NDArray[np.float64]]

REPORT_FORMAT = "tendonfmu-simulation-1"

# Samples in one call of the plant. Progress and Ctrl-C are handled between calls.
CHUNK = 100
ALWAYS = ("tendon_force", "tendon_position")
ENERGIES = ("kinetic_energy", "potential_energy", "motor_work", "friction_work", "damping_work", "push_work")


@dataclass(frozen=True)
class Simulation:
    """A simulated recording."""

    recording: Table  # columns of docs/reference/recordings.md
    truth: Table | None  # true signals at the same times, or None if they were not asked for
    contact_seconds: float  # time with a force above the rig's `contact_force` (s)
    work: Statistics  # work of the integrator

    def summary(self, rig: Rig) -> list[str]:
        """Describe what was simulated, in lines of text."""
        time = self.recording["time"]
        pushes = len(rig.expanded["pushes"])
        contact = f", {counted(pushes, 'push', 'pushes')}, {self.contact_seconds:.2f} s in contact" if pushes else ""
        length = f"{counted(len(time), 'sample')}, {time[-1]:.3f} s"
        return [f"{length} of {rig.name}{contact}; {counted(self.work.steps, 'step')} of CVODE"]

    def report(self, rig: Rig, written: Mapping[str, Path]) -> dict[str, Any]:
        """Return what `tendonfmu simulate --json` prints. written: name of a table -> its file."""
        time = self.recording["time"]
        return {
            "format": REPORT_FORMAT,
            "rig": str(rig.path),
            "name": rig.name,
            "seed": rig.expanded["seed"],
            "samples": len(time),
            "duration": float(time[-1] - time[0]),
            "columns": list(self.recording),
            "pushes": len(rig.expanded["pushes"]),
            "contact_seconds": float(self.contact_seconds),
            "steps": int(self.work.steps),
            **{name: str(file) for name, file in written.items()},
        }


def simulate(
    rig: Rig, *, truth: bool = False, progress: Callable[[int, int], None] = lambda done, total: None
) -> Simulation:
    """Run a rig from its initialisation to the end of its recording.

    The same rig gives the same numbers.

    Parameters
    ----------
    rig
        An expanded rig with a recording.
    truth
        Whether to return the true signals as well.
    progress
        Called with the number of samples done and of all samples.

    Returns
    -------
    Simulation
        The recording, and the truth if it was asked for.

    Raises
    ------
    InputError
        The rig is refused, or the solver failed, with the cause.
    """
    require_plant()
    time = rig.times()
    plant = plant_of(rig)
    with refused_by(rig.path):
        plant.initialise()
        names = _wanted(rig, truth)
        parts = []
        for start in range(0, len(time), CHUNK):
            progress(start, len(time))
            parts.append(plant.run(time[start : start + CHUNK], names))
        progress(len(time), len(time))
        work = plant.statistics
    signals = {name: np.concatenate([part[name] for part in parts]) for name in names}
    return Simulation(
        recording=_recording(rig, time, signals),
        truth=_truth(time, signals) if truth else None,
        contact_seconds=float(signals["contact"].sum()) / rig.rate,
        work=work,
    )


def _wanted(rig: Rig, truth: bool) -> list[str]:
    measured = [f"measured_{name}" for name in MEASURED if name in ALWAYS or name in rig.columns]
    return [*measured, *(TRUE if truth else ("contact",))]


def _recording(rig: Rig, time: Array, signals: dict[str, Array]) -> Table:
    table: Table = {"time": time}
    for name in MEASURED:
        if name in ALWAYS or name in rig.columns:
            table |= _columns(name, signals[f"measured_{name}"])
    if "contact" in rig.columns:
        table["contact"] = signals["contact"]
    return table


def _truth(time: Array, signals: dict[str, Array]) -> Table:
    table: Table = {"time": time}
    for name in TRUE:
        if name == "energy":
            table |= {key: signals[name][:, k] for k, key in enumerate(ENERGIES)}
        elif signals[name].ndim == 1:
            table[name] = signals[name]
        else:
            table |= _columns(name, signals[name])
    return table


def _columns(name: str, array: Array) -> Table:
    """Return columns name[1], name[2], ... of [N, size]; -0.0 becomes 0.0."""
    clean = array if array.dtype == bool else array + 0.0
    return {f"{name}[{k + 1}]": np.ascontiguousarray(clean[:, k]) for k in range(array.shape[1])}
