"""What the friction model leaves of the torque's rms on the free recordings, and how much of that is the bias's doing.

Usage: ../../.venv/bin/python share_left.py
"""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonfmu.model.native import Instance
from tendonfmu.recordings.recording import read_recording

HERE = Path(__file__).parent
RECORDINGS = ("index_finger_free.parquet", "index_finger_free_x4.parquet")


def shares(left: NDArray[Any], torque: NDArray[Any]) -> str:
    """rms over rms: all joints together, then each."""
    each = np.sqrt(np.square(left).mean(axis=0) / np.square(torque).mean(axis=0))
    return f"{np.sqrt(np.square(left).mean() / np.square(torque).mean()):.2f}  {each.round(2)}"


def main() -> None:
    finger = json.loads((HERE.parent / "fingers" / "index_finger.json").read_text(encoding="utf-8"))
    finger["contact"] = {"threshold": [1e6] * len(finger["joints"])}  # the bias is never frozen
    bare = copy.deepcopy(finger)
    for part in (*bare["joints"], *bare["tendons"]):
        for key in ("friction", "load_friction", "cover", "pulley_friction", "edge_friction"):
            part.pop(key, None)
    for name in RECORDINGS:
        samples = read_recording(HERE.parent / "demo_recording" / name).arrays()
        model, bias_only = (Instance.from_description(each).run(samples) for each in (finger, bare))
        torque = model["joint_torque"]
        print(name)
        print("  model                 ", shares(model["compensated_torque"], torque))
        print("  model without its bias", shares(torque - model["friction_torque"] + model["bias_torque"], torque))
        print("  bias without a model  ", shares(bias_only["compensated_torque"], torque))


if __name__ == "__main__":
    main()
