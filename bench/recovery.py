"""How well a fit finds numbers that are known: the recovery campaign.

A finger makes recordings of its own (recovery_case.py): 472 numbers, 400 s at 1 kHz, noise and a wandering bias. Which
numbers can be told is decided from the Fisher information at the truth before anything is fitted. Every number then
starts 25 % off, and the batch method and the extended Kalman filter fit all of them.

    python bench/recovery.py --seeds 20 -o recovery.csv

One row per seed goes to the file as it ends; seeds that are there already are not run again.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from recovery_case import DURATION, RATE, Case, Scale, identifiable, image, make_case
from tendonfmu.estimate.estimation import Estimator, Learner
from tendonfmu.files.writing import whole_file

Numbers = NDArray[np.float64]
Row = dict[str, float]
KINDS = ("static", "coulomb", "stribeck_velocity", "viscous", "stiffness", "initial_torque")
FAR = 3.0  # standard errors
PRIOR = 0.3  # of a number's size: about as far as the starts are off
EKF_PASSES = 3  # each but the first linearised where the one before arrived; the first is the paper's filter


def run_seed(seed: int, duration: float = DURATION, rate: float = RATE, ekf: bool = True, prior: float = PRIOR) -> Row:
    """One case: made, judged, fitted both ways."""
    begun = time.perf_counter()
    case = make_case(seed, duration, rate)
    made = time.perf_counter()
    scale = Scale(case.truth)
    known = identifiable(case, scale)
    row: Row = {
        "seed": seed,
        "samples": len(case.recording["time"]),
        "least_force": case.least_force,
        "numbers": len(known),
        "identifiable": int(known.sum()),
        "make_s": made - begun,
    }
    z, covariance, row_of_batch = _batch(case, prior)
    errors = scale.standard_errors(covariance)
    row |= row_of_batch | {f"batch_{key}": value for key, value in judge(scale, known, z, covariance).items()}
    row |= {
        f"{name}_{kind}": value
        for kind in KINDS
        for name, value in _of_kind(scale, known & (scale.kinds == kind), z, errors).items()
    }
    if ekf:
        begun = time.perf_counter()
        passes = list(_ekf(case, prior))
        row["ekf_s"] = time.perf_counter() - begun
        row |= {f"ekf_first_{key}": value for key, value in judge(scale, known, *passes[0]).items()}
        row |= {f"ekf_{key}": value for key, value in judge(scale, known, *passes[-1]).items()}
        apart = (scale.difference(passes[-1][0], z) / errors)[known]
        row |= {"apart_rms": float(np.sqrt(np.mean(apart**2))), "apart_most": float(np.abs(apart).max())}
    return row


def _batch(case: Case, prior: float) -> tuple[Numbers, Numbers, Row]:
    estimator = Estimator(image(case.start))
    estimator.add_recording(case.recording, external_torque=case.recording["external_torque"])
    found = estimator.fit(prior_std=prior)
    row: Row = {
        "batch_s": found.seconds,
        "passes": found.passes,
        "converged": int(found.converged),
        "cost_share": 2 * (found.cost - found.prior_cost) / (len(case.recording["time"]) * estimator.joints),
    }
    return found.z, found.covariance, row


def _ekf(case: Case, prior: float) -> Iterator[tuple[Numbers, Numbers]]:
    """What each pass finds."""
    learner = Learner(image(case.start), prior_std=prior)
    for number in range(EKF_PASSES):
        if number > 0:
            learner.begin_pass()
        learner.run(case.recording, external_torque=case.recording["external_torque"])
        yield learner.z, learner.covariance


def judge(scale: Scale, known: NDArray[np.bool_], z: Numbers, covariance: Numbers) -> Row:
    """Of the identifiable numbers: how many lie beyond 3 of the fit's own standard errors from the truth, and the mean
    square of errors in standard errors.
    """
    distance = (scale.difference(z, scale.unknowns) / scale.standard_errors(covariance))[known]
    return {"far": int(np.sum(np.abs(distance) > FAR)), "variance": float(np.mean(distance**2))}


def _of_kind(scale: Scale, chosen: NDArray[np.bool_], z: Numbers, errors: Numbers) -> Row:
    distance = (scale.difference(z, scale.unknowns) / errors)[chosen]
    return {"identifiable": int(chosen.sum()), "squares": float(np.sum(distance**2))}


# --- the campaign -----------------------------------------------------------------------------------------------------


def campaign(
    seeds: int, file: Path, duration: float = DURATION, rate: float = RATE, ekf: bool = True, prior: float = PRIOR
) -> list[Row]:
    """Rows of all seeds, from the file where they are there."""
    console = Console()
    rows = read_rows(file)
    for seed in range(seeds):
        if any(row["seed"] == seed for row in rows):
            continue
        row = run_seed(seed, duration, rate, ekf, prior)
        rows = [*rows, row]
        _write_rows(file, rows)
        line = ", ".join(f"{key} {value:.4g}" for key, value in row.items() if not key.endswith(KINDS))
        console.print(line, highlight=False, soft_wrap=True)
    return rows


def read_rows(file: Path) -> list[Row]:
    """None where the file does not exist yet."""
    if not file.exists():
        return []
    with file.open(newline="", encoding="utf-8") as stream:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(stream)]


def _write_rows(file: Path, rows: list[Row]) -> None:
    with whole_file(file) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def summary(rows: list[Row]) -> dict[str, Any]:
    """All seeds together; variances are means of squares over all identifiable numbers of all seeds."""
    columns: Mapping[str, Numbers] = {key: np.array([row[key] for row in rows]) for key in rows[0]}
    known = columns["identifiable"]
    found: dict[str, Any] = {
        "seeds": len(rows),
        "identifiable": float(np.mean(known / columns["numbers"])),
        "least identifiable": float(np.min(known / columns["numbers"])),
        "not converged": int(np.sum(columns["converged"] == 0)),
        "batch, s": float(np.median(columns["batch_s"])),
    }
    for method in ("batch", "ekf", "ekf_first") if "ekf_far" in rows[0] else ("batch",):
        found[f"{method}: within 3 standard errors"] = float(1 - columns[f"{method}_far"].sum() / known.sum())
        found[f"{method}: variance"] = float(np.sum(columns[f"{method}_variance"] * known) / known.sum())
    for kind in KINDS:
        count = columns[f"identifiable_{kind}"].sum()
        if count:
            found[f"batch: variance, {kind} ({count / len(rows):.0f})"] = columns[f"squares_{kind}"].sum() / count
    if "ekf_far" in rows[0]:
        found["ekf, s"] = float(np.median(columns["ekf_s"]))
        found["ekf − batch, rms in standard errors"] = float(np.sqrt(np.mean(columns["apart_rms"] ** 2)))
        found["ekf − batch, largest"] = float(columns["apart_most"].max())
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20, help="0 to SEEDS − 1")
    parser.add_argument("--duration", type=float, default=DURATION, help="s")
    parser.add_argument("--rate", type=float, default=RATE, help="samples per second")
    parser.add_argument("--prior", type=float, default=PRIOR, help="standard deviation of a number about its start")
    parser.add_argument("--no-ekf", action="store_true", help="batch only")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="RECOVERY.csv")
    given = parser.parse_args()
    rows = campaign(given.seeds, given.output, given.duration, given.rate, not given.no_ekf, given.prior)
    table = Table(title=f"recovery, {rows[0]['samples']:.0f} samples, {rows[0]['numbers']:.0f} numbers")
    table.add_column("")
    table.add_column("", justify="right")
    for name, value in summary(rows).items():
        table.add_row(name, f"{value:.4g}")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
