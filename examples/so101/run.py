"""SO-101: what `check` says of the three motions of a servo arm, whose "torques" are currents without a sign.

python examples/so101/run.py
"""

from __future__ import annotations

import json
import os
import sys
import warnings
from pathlib import Path

import tendonfmu as tf
from tendonfmu.recordings import describe_recorded_joint

HERE = Path(__file__).resolve().parent
JOINTS = ("rotation", "pitch", "elbow", "wrist_pitch", "wrist_roll", "jaw")


def main() -> int:
    data = Path(os.environ.get("TENDONFMU_DATA") or HERE.parents[2] / "shared" / "data") / "so101"
    if not data.is_dir():
        print(
            f"SKIPPED: {data}: no such folder; expected the recordings of SO-101 (docs/evidence/so101.md)",
            file=sys.stderr,
        )
        return 2
    text = (HERE / "map.json").read_text(encoding="utf-8")
    warnings.simplefilter("ignore")  # check says the same
    for log in sorted(data.glob("*/state_motor.csv")):
        for number, joint in enumerate(JOINTS, start=1):
            recording = tf.convert(log, json.loads(text.replace("[3]", f"[{number}]").replace("elbow", joint)))
            finger = describe_recorded_joint(joint, recording, 1.0)
            found = "; ".join(finding.seen for finding in tf.check(finger, recording).findings)
            print(f"{log.parent.name}, {joint}: {found or 'nothing found'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
