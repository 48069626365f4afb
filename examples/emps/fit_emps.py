"""Friction, offset and mass of EMPS by `tendonfmu fit`: the tables of docs/evidence/fit.md.

    python examples/emps/fit_emps.py [--phases]

The mass is no number of a finger: the fit's cost is minimised over it, each time with the inertial force M·a as known
load (`tendonfmu convert emps --mass M`).
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from emps_recordings import (
    KINEMATICS,
    PUBLISHED,
    PUBLISHED_ASYMMETRIC,
    PULSES,
    TRAINING,
    data_folder,
    force_and_error,
    read_emps,
    relative,
    relative_as_published,
)
from scipy import io, optimize

from tendonfmu.estimate.fitting import FitWarning, FrictionFit
from tendonfmu.recordings.converters.emps import DECIMATION, MASS

HERE = Path(__file__).parent
MASSES = (50.0, 150.0)  # kg; searched between


@dataclass(frozen=True)
class Model:
    """A fitted carriage. mass in kg, finger: its description, cost: of the fit, free of unit."""

    mass: float
    finger: Mapping[str, Any]
    cost: float

    def numbers(self) -> dict[str, float]:
        """By the names of the published ones; no offset beside two sides."""
        law = self.finger["joints"][0]["friction"]
        if "positive" in law:
            sides = {"+": law["positive"], "−": law["negative"]}
            return {"M": self.mass} | {
                f"{name}{sign}": side[key]
                for sign, side in sides.items()
                for name, key in (("Fv", "viscous"), ("Fc", "coulomb"))
            }
        offset = self.finger["bias"]["initial_torque"][0]
        return {"M": self.mass, "Fv": law["viscous"], "Fc": law["coulomb"], "offset": offset}


def fit(start: Path, file: Path, mass: float = MASS, decimation: int = DECIMATION) -> Model:
    """One description fitted to one file. With two sides of a law the offset is fixed: they cannot be distinguished."""
    fix = ["bias.initial_torque"] if start.stem.endswith("asymmetric") else []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FitWarning)  # residuals are not white: the same in every one of these fits
        # costs of several masses are compared: each sample counts in all of them
        choice = FrictionFit(start, kinematics=KINEMATICS, fix=fix, effective_samples=False)
        done = choice.fit([read_emps(file, mass, decimation)])
    return Model(mass, done.description_.data, done.cost_)


def fit_with_mass(start: Path, file: Path, decimation: int = DECIMATION) -> Model:
    """The same with the mass of the least cost, to 1 g."""
    found = optimize.minimize_scalar(
        lambda mass: fit(start, file, mass, decimation).cost, bounds=MASSES, method="bounded", options={"xatol": 1e-3}
    )
    return fit(start, file, float(found.x), decimation)


def error(model: Model, file: Path, decimation: int = DECIMATION) -> float:
    """% of the force that the model misses."""
    force, missed = force_and_error(model.finger, read_emps(file, model.mass, decimation))
    return relative(missed, force)


def error_as_published(model: Model, file: Path) -> float:
    """%; the published way, of the model at the file's full rate."""
    return relative_as_published(model.finger, read_emps(file, model.mass, decimation=1))


def print_table(published: dict[str, float], rows: dict[str, tuple[Model, float, float]]) -> None:
    """Numbers with their distance from the published ones; errors on the file of the fit and on the one with pulses."""
    print("| | " + " | ".join(published) + " | error | PULSES |")
    print("| --- |" + " ---: |" * (len(published) + 2))
    print("| published | " + " | ".join(f"{value:.2f}" for value in published.values()) + " | | |")
    for name, (model, training, pulses) in rows.items():
        found = model.numbers()
        cells = [f"{found[key]:.2f} ({100 * (found[key] / value - 1):+.2f} %)" for key, value in published.items()]
        print(f"| {name} | " + " | ".join(cells) + f" | {training:.3f} % | {pulses:.3f} % |")
    print()


def compare(start: Path, folder: Path) -> dict[str, tuple[Model, float, float]]:
    """By name: a model and its errors on both files, %."""
    files = [folder / f"{name}.mat" for name in (TRAINING, PULSES)]
    fixed, free, fast = (
        fit(start, files[0]),
        fit_with_mass(start, files[0]),
        fit_with_mass(start, files[0], decimation=1),
    )
    return {
        "published M": (fixed, *(error(fixed, file) for file in files)),
        "all fitted": (free, *(error(free, file) for file in files)),
        "at 1 kHz": (fast, *(error(fast, file, decimation=1) for file in files)),
        "at 1 kHz, the error decimated": (fast, *(error_as_published(fast, file) for file in files)),
    }


def phases(file: Path) -> Iterator[tuple[int, float]]:
    """(ms, %) the symmetric model's error if the grid of 10 ms lies so much later."""
    content = {name: value for name, value in io.loadmat(file).items() if not name.startswith("__")}
    with tempfile.TemporaryDirectory() as scratch:
        for shift in range(DECIMATION):
            later = Path(scratch) / f"{shift}.mat"
            io.savemat(later, content | {name: content[name][shift:] for name in ("t", "qm", "vir")})
            yield shift, error(fit_with_mass(HERE / "emps.json", later), later)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--phases", action="store_true", help="the error by the place of the 10 ms grid as well")
    options = parser.parse_args()
    folder = data_folder()
    print_table(PUBLISHED, compare(HERE / "emps.json", folder))
    print_table(PUBLISHED_ASYMMETRIC, compare(HERE / "emps_asymmetric.json", folder))
    if options.phases:
        for shift, share in phases(folder / f"{TRAINING}.mat"):
            print(f"grid {shift} ms later: {share:.2f} %")


if __name__ == "__main__":
    main()
