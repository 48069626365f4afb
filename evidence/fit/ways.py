"""One way of fitting in a process of its own, for compare.py: prints a line of JSON with its time and peak memory.

python -m evidence.fit.ways data --folder F --duration 400
python -m evidence.fit.ways batch --folder F --samples 400000
"""

from __future__ import annotations

import json
import resource
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from evidence.fit.made_data import model_torques, noise_scale
from evidence.fit.peers import Task, Watch, least_squares_fit, outer_products, run_filter
from evidence.runner import INDEX_FINGER, parser, plain
from tendonfmu.arrays import Array
from tendonfmu.estimate import Choice, Estimator, FrictionFit, Structure, build_structure
from tendonfmu.estimate.estimation import Learner
from tendonfmu.excite import Plan, plan_excitation, read_subject
from tendonfmu.excite.excitation import START
from tendonfmu.excite.training_motion import as_array, find_ranges
from tendonfmu.files import write_table
from tendonfmu.model import balanced_forces, read_finger

RATE = 1000.0  # Hz
BEGIN = round(START * RATE)  # before it, all joints rest
PRETENSIONS = (15.0, 30.0)  # N, in turn
ALTERNATE = 50.0  # s
SPREAD = 0.3  # of the logarithm of each number of the truth about the description
FILE = "recording"
PRIOR_STD, TOLERANCE = 1.0, 0.1  # as `tendonfmu fit` has them
MOST_CALLS = 40  # of scipy

# --- the data ---------------------------------------------------------------------------------------------------------


def other_numbers(node: Any, draw: Callable[[], float]) -> Any:
    """The same description with the numbers of its laws and covers multiplied by draws."""
    if isinstance(node, list):
        return [other_numbers(inner, draw) for inner in node]
    if not isinstance(node, dict):
        return node
    if "coulomb" in node:
        coulomb = node["coulomb"] * draw()
        drop = (node["static"] - node["coulomb"]) * draw()
        return {
            **node,
            "static": coulomb + drop,
            "coulomb": coulomb,
            "stribeck_velocity": node["stribeck_velocity"] * draw(),
            "viscous": node.get("viscous", 0.0) * draw(),
        }
    return {
        key: {**value, "stiffness": value["stiffness"] * draw()}
        if key == "cover" and value
        else other_numbers(value, draw)
        for key, value in node.items()
    }


def make_data(folder: Path, duration: float) -> dict[str, Any]:
    """Writes recording.parquet and .npz: a motion of `excite`, and y = T + b + e by another finger's numbers.

    The forces carry that finger's friction; what the jumps of fig. 5, a random walk and white noise add to it comes as
    known load, `external_torque` = Rᵀ f0 − y, so that no tendon goes slack however far the bias wanders.
    """
    rng = np.random.default_rng(1)
    subject = read_subject(INDEX_FINGER)
    truth = other_numbers(subject.finger.data, lambda: float(np.exp(SPREAD * rng.standard_normal())))
    ranges = as_array(find_ranges(subject, []))
    alternate = min(ALTERNATE, duration / 2)
    plan = Plan(ranges, duration=duration, pretensions=PRETENSIONS, alternate=alternate, rate=RATE)
    motion = plan_excitation(truth, plan)
    arrays = {"time": motion.time, "joint_position": motion.joint_position, "joint_velocity": motion.joint_velocity}
    arrays["tendon_force"] = balanced_forces(truth, arrays, motion.pretension)
    torque, jumps = model_torques(truth, arrays)
    white, steps = rng.standard_normal((2, *torque.shape))
    walk = np.sqrt(truth["bias"]["drift_variance"] / RATE) * np.cumsum(steps, axis=0)
    noise = noise_scale(truth, motion.time, arrays["tendon_force"]) * white
    arms, stiffness = np.array(subject.finger.moment_arms), [tendon["stiffness"] for tendon in truth["tendons"]]
    arrays["external_torque"] = arrays["tendon_force"] @ arms - (torque + jumps + walk + noise)
    arrays["tendon_position"] = motion.joint_position @ arms.T + arrays["tendon_force"] / stiffness
    columns = {
        f"{name}[{k}]": column
        for name, array in arrays.items()
        if name != "time"
        for k, column in enumerate(array.T, start=1)
    }
    write_table(folder / f"{FILE}.parquet", {"time": motion.time} | columns)
    np.savez(folder / f"{FILE}.npz", **arrays)
    return {"samples": len(motion.time), "least_force": float(arrays["tendon_force"].min())}


def load(folder: Path, samples: int) -> dict[str, Array]:
    """So many samples of what make_data wrote, from the beginning of the motion on."""
    with np.load(folder / f"{FILE}.npz") as file:
        return {name: np.ascontiguousarray(file[name][BEGIN : BEGIN + samples]) for name in file.files}


def structure() -> Structure:
    return build_structure(read_finger(INDEX_FINGER), Choice())


def call_with(arrays: Mapping[str, Array]) -> dict[str, Any]:
    """Arguments of Estimator.add_recording and Learner.run."""
    given = {name: array for name, array in arrays.items() if name != "external_torque"}
    return {"arrays": given, "kinematics_source": 3, "external_torque": arrays["external_torque"]}


# --- the ways ---------------------------------------------------------------------------------------------------------


def command(folder: Path) -> dict[str, Any]:
    """`tendonfmu fit` of the whole file: reading, judging and the report included."""
    with Watch() as watch:
        fit = FrictionFit(INDEX_FINGER, kinematics=3).fit([folder / f"{FILE}.parquet"])
    samples = sum(recording["used"] for recording in fit.report_["recordings"])
    return watch.times() | {"passes": fit.report_["passes"], "converged": fit.converged_, "samples": samples}


def batch(arrays: Mapping[str, Array], tolerance: float = TOLERANCE) -> dict[str, Any]:
    chosen = structure()
    estimator = Estimator(chosen.start.image, chosen.group, chosen.scale)
    estimator.add_recording(**call_with(arrays))
    with Watch() as watch:
        fit = estimator.fit(prior_std=PRIOR_STD, tolerance=tolerance)
    figures = {name: getattr(fit, name) for name in ("z", "cost", "passes", "converged")}
    return watch.times() | figures | {"std": np.sqrt(np.diag(fit.covariance)), "iterations": fit.steps}


def batch_to_the_end(arrays: Mapping[str, Array]) -> dict[str, Any]:
    return batch(arrays, 1e-3)


def ekf(arrays: Mapping[str, Array], passes: int = 2, block: int = 8) -> dict[str, Any]:
    chosen = structure()
    learner = Learner(chosen.start.image, chosen.group, chosen.scale, prior_std=PRIOR_STD, block=block)
    with Watch() as watch:
        for number in range(passes):
            if number > 0:
                learner.begin_pass()
            learner.run(**call_with(arrays))
    return {"passes": passes} | watch.times() | {"z": learner.z, "std": np.sqrt(np.diag(learner.covariance))}


def ekf_sample_by_sample(arrays: Mapping[str, Array]) -> dict[str, Any]:
    return ekf(arrays, passes=1, block=1)


def task_of(arrays: Mapping[str, Array]) -> Any:
    """What the peers are given."""
    chosen = structure()
    bias = chosen.start.data["bias"]
    estimator = Estimator(chosen.start.image, chosen.group, chosen.scale)
    estimator.add_recording(**call_with(arrays))
    columns = {
        name: np.array([getattr(unknown, name) for unknown in estimator.unknowns])
        for name in ("start", "lower", "upper", "scale")
    }
    force = arrays["tendon_force"]
    return Task(
        estimator=estimator,
        time=arrays["time"],
        measured=force @ np.array(chosen.start.moment_arms) - arrays["external_torque"],
        noise=noise_scale(chosen.start.data, arrays["time"], force)[:, 0] ** 2,
        drift=bias["drift_variance"],
        initial=bias["initial_variance"],
        **columns,
    )


def scipy_least_squares(arrays: Mapping[str, Array]) -> dict[str, Any]:
    return least_squares_fit(task_of(arrays), PRIOR_STD, MOST_CALLS)


def peer_filter(kind: str) -> Callable[[Mapping[str, Array]], dict[str, Any]]:
    def run(arrays: Mapping[str, Array]) -> dict[str, Any]:
        return run_filter(task_of(arrays), kind, PRIOR_STD, len(arrays["time"]))

    return run


def one_product(arrays: Mapping[str, Array]) -> dict[str, Any]:
    """Jᵀ J of a dense Jacobian that is there: a lower bound of any pass that does not use its zeros."""
    rows, columns = arrays["joint_position"].size, len(Estimator(structure().start.image, structure().group).unknowns)
    return outer_products(rows, columns)


WAYS: dict[str, Callable[[Mapping[str, Array]], dict[str, Any]]] = {
    "batch": batch,
    "batch_to_the_end": batch_to_the_end,
    "ekf": ekf,
    "ekf_sample_by_sample": ekf_sample_by_sample,
    "product": one_product,
    "least_squares": scipy_least_squares,
    "symmetric": peer_filter("symmetric"),
    "joseph": peer_filter("joseph"),
    "filterpy": peer_filter("filterpy"),
}


def main() -> None:
    options = parser(__doc__, output=None)
    options.add_argument("way", choices=["data", "command", *WAYS])
    options.add_argument("--folder", type=Path, required=True)
    options.add_argument("--samples", type=int, default=400_000)
    options.add_argument("--duration", type=float, default=400.0, help="s, of the data")
    given = options.parse_args()
    if given.way == "data":
        figures: dict[str, Any] = make_data(given.folder, given.duration)
    elif given.way == "command":
        figures = command(given.folder)
    else:
        arrays = load(given.folder, given.samples)
        try:
            figures = WAYS[given.way](arrays) | {"samples": len(arrays["time"])}
        except ImportError as missing:
            figures = {"missing": str(missing)}
    # kilobytes on Linux, bytes on macOS
    unit = 1 if sys.platform == "darwin" else 1024
    figures["peak_memory"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
    print(json.dumps(plain(figures)))


if __name__ == "__main__":
    main()
