"""A made-up result of a fit to draw: the index finger's laws as fitted to one of the demo recordings, a start that is
wrong, and a covariance whose entries are known."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from repository_paths import ROOT
from tendonfmu.estimate.estimation import Unknown
from tendonfmu.estimate.fisher_information import unknowns
from tendonfmu.estimate.picture import FitPicture, FitSeries, Role
from tendonfmu.model import Finger, finger_from_data, native
from tendonfmu.recordings.recording import read_recording

EXAMPLES = ROOT / "examples"
FREE, FREE_X4 = (EXAMPLES / "demo_recording" / f"index_finger_{name}.parquet" for name in ("free", "free_x4"))
ROLES = {
    "coulomb": "coulomb",
    "static": "drop",
    "stribeck_velocity": "rate",
    "viscous": "viscous",
    "stiffness": "value",
}

Numbers = NDArray[np.float64]


def finger_of(data: dict[str, Any]) -> Finger:
    return finger_from_data(data)


def index_finger() -> dict[str, Any]:
    found: dict[str, Any] = json.loads((EXAMPLES / "fingers" / "index_finger.json").read_text("utf-8"))
    return found


def wrong_start(data: dict[str, Any], seed: int = 1) -> dict[str, Any]:
    """Every magnitude of every law times 0.5 to 2, static above coulomb."""
    generator = np.random.default_rng(seed)
    start = copy.deepcopy(data)

    def spoil(node: Any) -> None:
        if isinstance(node, dict) and "coulomb" in node:
            drop = node["static"] - node["coulomb"]
            for key in ("coulomb", "stribeck_velocity", "viscous"):
                node[key] *= float(np.exp(generator.uniform(-0.7, 0.7)))
            node["static"] = node["coulomb"] + drop * float(np.exp(generator.uniform(-0.7, 0.7)))
        elif isinstance(node, dict | list):
            for each in node.values() if isinstance(node, dict) else node:
                spoil(each)

    spoil([start["joints"], start["tendons"]])
    return start


def made_up_unknowns(data: dict[str, Any]) -> list[Unknown]:
    """One for every number that a fit of the finger estimates; coulomb moves static along."""
    index = {parameter.path: k for k, parameter in enumerate(native.Instance.from_description(data).parameters())}
    found = []
    for number in unknowns(data):
        role = ROLES[number.key]
        moved = [index[number.path]]
        if role == "coulomb":
            moved.append(index[number.path.replace(".coulomb", ".static")])
        found.append(Unknown(number.path, role, tuple(moved), 0.0, 0.0, 0.0, 0.0))
    return found


def internal_values(data: dict[str, Any], found: list[Unknown]) -> Numbers:
    values = {p.path: p.start for p in native.Instance.from_description(data).parameters()}
    z = []
    for one in found:
        value = values[one.path]
        if one.role == "drop":
            value -= values[one.path.replace(".static", ".coulomb")]
        z.append(1.0 / value if one.role == "rate" else value)
    return np.array(z)


def made_up_covariance(z: Numbers, seed: int = 2) -> Numbers:
    """Relative errors from 1 % to 60 %, neighbours correlated: D·C·D with C = 0.9^|i − j|, alternating in sign."""
    generator = np.random.default_rng(seed)
    size = np.abs(z) * np.exp(generator.uniform(np.log(0.01), np.log(0.6), len(z)))
    k = np.arange(len(z))
    return np.asarray(size[:, None] * size * (-0.9) ** np.abs(k[:, None] - k))


def series_of(data: dict[str, Any], path: Path, label: str, role: Role, held_out: bool = False) -> FitSeries:
    """A run without contact detection. The residual before the bias update is what is left after it over 1 − K."""
    recording = read_recording(path)
    blind = {**data, "contact": {"threshold": [1e9] * len(data["joints"])}}
    found = native.run_recording(blind, recording.arrays())
    time, force = recording.time, recording.groups["tendon_force"]
    bias = data["bias"]
    noise = (bias["noise_std"] + bias["noise_std_per_force"] * np.abs(force).mean(axis=1)) ** 2
    variance, gain = bias["initial_variance"], np.zeros(len(time))
    for k in range(1, len(time)):
        step = time[k] - time[k - 1]
        variance += bias["drift_variance"] * step
        noise_now = noise[k] * bias["noise_time"] / step
        gain[k] = variance / (variance + noise_now)
        variance *= 1.0 - gain[k]
    residual = found["compensated_torque"] / (1.0 - gain[:, None])
    residual[0] = np.nan
    used = np.full(len(time), role == "training")
    out = (time > 40.0) & (time <= 52.0) if held_out else None
    return FitSeries(
        label=label,
        role=role,
        mean_force=float(force.mean()),
        time=time,
        torque=found["joint_torque"],
        residual=residual,
        model_torque=found["friction_torque"] - found["bias_torque"],
        joint_angle=found["joint_angle"],
        joint_speed=found["joint_speed"],
        used=used if out is None else used & ~out,
        held_out=out,
    )


def _rms(values: Numbers) -> list[float]:
    return np.sqrt(np.nanmean(np.square(values), axis=0)).tolist()


def _residual(series: FitSeries, where: NDArray[np.bool_]) -> dict[str, Any]:
    torque, model = series.torque[where], series.model_torque[where]
    alone = torque - model
    return {
        "rms": _rms(series.residual[where]),
        "bias_only_rms": _rms(0.5 * torque),
        "model_only_rms": _rms(alone - alone.mean(axis=0)),
        "torque_rms": _rms(torque),
        "start_rms": _rms(2.0 * series.residual[where]),
    }


def made_up_report(
    data: dict[str, Any], start: dict[str, Any], found: list[Unknown], covariance: Numbers, series: list[FitSeries]
) -> dict[str, Any]:
    """As "tendonfmu-fit-1" says, from the made-up numbers."""
    values, begun = (
        {p.path: (p.start, p.unit) for p in native.Instance.from_description(each).parameters()}
        for each in (data, start)
    )
    z = internal_values(data, found)
    relative = np.sqrt(np.diag(covariance)) / np.abs(z)
    parameters = [
        {
            "path": one.path,
            "unit": values[one.path][1],
            "start": begun[one.path][0],
            "value": values[one.path][0],
            "standard_error": float(share * abs(values[one.path][0])),
            "identified": bool(share < 0.3),
            "at_bound": "lower" if k % 97 == 5 else None,
            "reason": None if share < 0.3 else "combination",
            "advice": None if share < 0.3 else "move the joints at more than one speed",
        }
        for k, (one, share) in enumerate(zip(found, relative, strict=True))
    ]
    free = series[0]
    known = sum(bool(entry["identified"]) for entry in parameters)
    size = np.sqrt(np.diag(covariance))
    return {
        "format": "tendonfmu-fit-1",
        "finger": data["name"],
        "method": "batch",
        "converged": True,
        "finished": True,
        "iterations": 14,
        "passes": 21,
        "seconds": 3.21,
        "options": {"prior_std": 1.0, "symmetric": True},
        "warnings": ["index_finger_free.parquet: 3 samples lie after a gap of 0.2 s; the bias begins anew there"],
        "recordings": [
            {
                "path": f"{each.label}.parquet",
                "samples": len(each.time),
                "used": int(each.used.sum()),
                "held_out": 0 if each.held_out is None else int(each.held_out.sum()),
                "contact_left_out": 0,
                "duration": float(each.time[-1] - each.time[0]),
                "mean_force": each.mean_force,
                "kinematics": 1,
            }
            for each in series
            if each.role == "training"
        ],
        "parameters": parameters,
        "correlation": {"paths": [one.path for one in found], "matrix": (covariance / size / size[:, None]).tolist()},
        "identified": {"count": known, "of": len(parameters)},
        "residual": {
            "train": _residual(free, free.used),
            "held_out": None if free.held_out is None else _residual(free, free.held_out),
        },
        "innovations": {
            "nis": {"mean": 1.31, "interval": [0.98, 1.02], "consistent": False},
            "whiteness": {"lag_one": [0.81, 0.62, 0.7, 0.9], "ljung_box_p": [0.0, 0.0, 0.0, 0.0]},
        },
    }


def made_up_picture() -> FitPicture:
    """Two recordings, the second one at four times the pretension; a part of the first is held out."""
    data = index_finger()
    start, found = wrong_start(data), made_up_unknowns(data)
    z = internal_values(data, found)
    covariance = made_up_covariance(z)
    series = [
        series_of(data, FREE, "index_finger_free", "training", held_out=True),
        series_of(data, FREE_X4, "index_finger_free_x4", "comparison"),
    ]
    report = made_up_report(data, start, found, covariance, series)
    return FitPicture(report, finger_of(start), finger_of(data), found, z, covariance, series)
