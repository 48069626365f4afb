"""How well a fit finds numbers that are known, and which numbers another motion and noise would tell.

    python -m evidence.fit.recovery -o FOLDER --seeds 20
    python -m evidence.fit.recovery -o FOLDER --levers

Seeds and levers that are there already are not run again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from evidence import tables
from evidence.fit import recovery_case as case
from evidence.fit.recovery_case import DURATION, RATE, Case, Scale, identifiable, image, make_case
from evidence.runner import parser, publish, run_cases
from evidence.tables import Row
from tendonfmu.arrays import Flags, Numbers
from tendonfmu.estimate import Estimator
from tendonfmu.estimate.estimation import Learner

KINDS = ("static", "coulomb", "stribeck_velocity", "viscous", "stiffness", "initial_torque")
FAR = 3.0  # standard errors
PRIOR = 0.3  # of a number's size: about as far as the starts are off
EKF_PASSES = 3  # each but the first linearised where the one before arrived; the first is the paper's filter


def run_seed(seed: int, duration: float = DURATION, rate: float = RATE, prior: float = PRIOR) -> Row:
    """One case: made, judged, fitted both ways."""
    made = make_case(seed, duration, rate)
    scale = Scale(made.truth)
    known = identifiable(made, scale)
    row: Row = {
        "seed": seed,
        "samples": len(made.recording["time"]),
        "numbers": len(known),
        "identifiable": int(known.sum()),
    }
    estimator = Estimator(image(made.start))
    estimator.add_recording(made.recording, external_torque=made.recording["external_torque"])
    fit = estimator.fit(prior_std=prior)
    z, errors = fit.z, scale.standard_errors(fit.covariance)
    row["converged"] = int(fit.converged)
    row |= {f"batch_{key}": value for key, value in judge(scale, known, z, fit.covariance).items()}
    for kind in KINDS:
        distance = (scale.difference(z, scale.unknowns) / errors)[known & (scale.kinds == kind)]
        row |= {f"identifiable_{kind}": len(distance), f"squares_{kind}": float(np.sum(distance**2))}
    passes = list(_ekf(made, prior))
    row |= {f"ekf_first_{key}": value for key, value in judge(scale, known, *passes[0]).items()}
    row |= {f"ekf_{key}": value for key, value in judge(scale, known, *passes[-1]).items()}
    apart = (scale.difference(passes[-1][0], z) / errors)[known]
    return row | {"apart_rms": float(np.sqrt(np.mean(apart**2))), "apart_most": float(np.abs(apart).max())}


def _ekf(made: Case, prior: float) -> Iterator[tuple[Numbers, Numbers]]:
    """What each pass finds."""
    learner = Learner(image(made.start), prior_std=prior)
    for number in range(EKF_PASSES):
        if number > 0:
            learner.begin_pass()
        learner.run(made.recording, external_torque=made.recording["external_torque"])
        yield learner.z, learner.covariance


def judge(scale: Scale, known: Flags, z: Numbers, covariance: Numbers) -> Row:
    """Of the identifiable numbers: how many lie beyond 3 standard errors of the fit, and the mean square."""
    distance = (scale.difference(z, scale.unknowns) / scale.standard_errors(covariance))[known]
    return {"far": int(np.sum(np.abs(distance) > FAR)), "variance": float(np.mean(distance**2))}


def summary(rows: Sequence[Row]) -> dict[str, float]:
    """All seeds together; variances are means of squares over all identifiable numbers of all seeds."""

    def of(key: str) -> Numbers:
        return np.asarray(tables.column(rows, key))

    known = of("identifiable")
    values: dict[str, float] = {
        "seeds": len(rows),
        "identifiable": float(np.mean(known / of("numbers"))),
        "least identifiable": float(np.min(known / of("numbers"))),
        "not converged": int(np.sum(of("converged") == 0)),
    }
    for method in ("batch", "ekf", "ekf_first"):
        values[f"{method}: within 3 standard errors"] = float(1 - of(f"{method}_far").sum() / known.sum())
        values[f"{method}: variance"] = float(np.sum(of(f"{method}_variance") * known) / known.sum())
    for kind in KINDS:
        count = of(f"identifiable_{kind}").sum()
        if count:
            values[f"batch: variance, {kind} ({count / len(rows):.0f})"] = of(f"squares_{kind}").sum() / count
    values["ekf − batch, rms in standard errors"] = float(np.sqrt(np.mean(of("apart_rms") ** 2)))
    values["ekf − batch, largest"] = float(of("apart_most").max())
    return values


# --- levers -----------------------------------------------------------------------------------------------------------

LEVER_RATE = 100.0
FINGERS_NOISE = {"noise_std": 0.004, "noise_std_per_force": 0.0006, "noise_time": 0.002, "drift_variance": 1e-6}
SLOW = {"max_speed": 1.0, "max_acceleration": 10.0}
EVEN = {"vary": None, "pretensions": (35.0,)}
LIGHT = {"vary": None, "pretensions": (10.0,)}
LEVERS: dict[str, tuple[dict[str, float], dict[str, Any]]] = {
    "the campaign's case": ({}, {}),
    "noise 0.25 mN·m instead of 0.5": ({"noise_std": 2.5e-4}, {}),
    "noise 1 mN·m": ({"noise_std": 1e-3}, {}),
    "drift of 0.3 mN·m in 1 s instead of 0.1": ({"drift_variance": 1e-7}, {}),
    "--max-speed 2, --max-acceleration 10": ({}, {"max_speed": 2.0, "max_acceleration": 10.0}),
    "--max-speed 1, --max-acceleration 10": ({}, SLOW),
    "--pretension 35 instead of --vary-tension": ({}, EVEN),
    "--pretension 10": ({}, LIGHT),
    "--pretension 10 and slow: excite's default": ({}, LIGHT | SLOW),
    "the finger's own noise (with errors of the model)": (FINGERS_NOISE, {}),
    "the finger's own noise, excite's default": (FINGERS_NOISE, LIGHT | SLOW),
    "100 s": ({}, {"duration": 100.0}),
}


def lever(name: str) -> Row:
    """The case with one thing changed, 400 s at 100 Hz, as much noise per second as at 1 kHz; nothing is fitted."""
    bias, motion = LEVERS[name]
    truth = case.true_finger()
    truth["bias"] = truth["bias"] | bias
    made = case.training_motion(truth, 0, DURATION, LEVER_RATE, **motion)
    recording = case.carried(truth, made)
    recording["external_torque"] = np.zeros_like(made.joint_position)  # what is measured does not matter here
    known = identifiable(Case(truth, truth, recording), Scale(truth))
    return {"numbers": len(known), "identifiable": int(known.sum())}


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--seeds", type=int, default=20, help="0 to SEEDS − 1")
    options.add_argument("--rate", type=float, default=RATE, help="samples per second")
    options.add_argument("--prior", type=float, default=PRIOR, help="standard deviation of a number about its start")
    options.add_argument("--levers", action="store_true", help="what makes numbers identifiable")
    given = options.parse_args()
    place = given.output, given.workers, given.scheduler
    if given.levers:
        rows = run_cases(lever, {f"lever_{k:02d}": (name,) for k, name in enumerate(LEVERS)}, *place)
        counts = zip(LEVERS, tables.column(rows, "identifiable"), tables.column(rows, "numbers"), strict=True)
        lines = [[name, f"{count:.0f} of {numbers:.0f}", f"{count / numbers:.0%}"] for name, count, numbers in counts]
        publish(given.output / "levers.md", tables.table(["", "numbers identifiable", "share"], lines) + "\n")
        return
    settings = DURATION, given.rate, given.prior
    version = "_".join(f"{value:g}" for value in settings)
    rows = run_cases(run_seed, {f"{version}_seed_{seed}": (seed, *settings) for seed in range(given.seeds)}, *place)
    lines = [[name, f"{value:.4g}"] for name, value in summary(rows).items()]
    head = [f"{rows[0]['samples']} samples, {rows[0]['numbers']} numbers", ""]
    publish(given.output / "recovery.md", tables.table(head, lines) + "\n")


if __name__ == "__main__":
    main()
