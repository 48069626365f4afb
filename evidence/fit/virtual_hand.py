"""What a fit makes of the simulated finger: fitted to excite's motion, judged on motions that it has not seen."""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from evidence.cases import EXAMPLES, INDEX_FINGER, INDEX_RIG, tendonfmu, write
from evidence.part import Figures
from tendonfmu.estimate import FrictionFit

# paper, sect. VII: variance of the changes 1e-9 at a variance of the noise of 1e-4, taken as per sample of 1 ms; the
# paper increases the noise for higher pretension without saying by how much, here it stays
PAPER_BIAS = {"drift_variance": 1e-6, "noise_std": 0.01, "noise_time": 0.001}

VARIED = ["--vary-tension", "4:16"]  # about 10 N on average
FRESH = {"excite, 10 N": ["--seed", "7"], "excite, 40 N": ["--seed", "7", "--pretension", "40"]}
STROKES = {"strokes, 10 N": "index_finger_free", "strokes, 40 N": "index_finger_free_x4"}
JUDGED = (*FRESH, *STROKES)


def record(folder: Path, name: str, duration: float, options: Sequence[str]) -> Path:
    """A recording of the rig moved as `tendonfmu excite` says."""
    motion, rig, recording = (folder / f"{name}.{kind}" for kind in ("csv", "json", "parquet"))
    write(
        rig,
        {
            "format": "tendonfmu-rig-1",
            "name": name,
            "base": str(INDEX_RIG),
            "motion": {"kind": "file", "file": motion.name},
            "recording": {"duration": duration},
        },
    )
    tendonfmu("excite", INDEX_RIG, "-o", motion, "--duration", str(duration), *options)
    tendonfmu("simulate", rig, "-o", recording)
    return recording


def measure(folder: Path, workers: int) -> Figures:
    """Cells of the table in %: rms of the residual as a share of the torque's, all joints together."""
    training = record(folder, "varied", 400.0, VARIED)
    judged = [record(folder, f"fresh_{k}", 100.0, options) for k, options in enumerate(FRESH.values())]
    judged += [EXAMPLES / "demo_recording" / f"{name}.parquet" for name in STROKES.values()]
    given = json.loads(INDEX_FINGER.read_text(encoding="utf-8"))
    papers = copy.deepcopy(given)
    papers["bias"] = PAPER_BIAS | {"forget_rate": given["bias"]["forget_rate"]}
    figures: Figures = {"lines": []}
    for bias, finger in (("of the paper", papers), ("of the finger", given)):
        fit = FrictionFit(finger, asymmetric=False).fit(training, compare=judged)
        bare, start, fitted, constant = (
            [100.0 * share(part, key) for part in fit.report_["residual"]["comparisons"]]
            for key in ("bias_only_rms", "start_rms", "rms", "model_only_rms")
        )
        found = [f"**{left:.1f} %** ({alone:.0f} %)" for left, alone in zip(fitted, constant, strict=True)]
        figures["lines"] += [
            [bias, "bias alone", *(f"{value:.1f} %" for value in bare)],
            [bias, "the rig's own static numbers", *(f"{value:.1f} %" for value in start)],
            [bias, "varied", *found],
        ]
        figures.setdefault("left", [round(value, 1) for value in fitted])  # with the bias of the paper
    return figures


def share(part: Mapping[str, Any], name: str) -> float:
    """Of all joints together, as a share of the torque."""
    return float(np.linalg.norm(part[name]) / np.linalg.norm(part["torque_rms"]))
