"""CPU seconds of `tendonfmu diagnose` as a whole process on fingers in MuJoCo: python -m evidence.speed.diagnosing

A finger of 2 joints (4 tendons, 60 s and 30 s of test) hides a weight, one of 3 joints (6 tendons, 80 s and 40 s) whose
friction grows; both at 1 kHz. Nothing else may run: neighbours make CPU time up to twice as long. Prints a table as
Markdown.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from evidence import tables
from evidence.fingers.mujoco_cases import Plan, of_plan
from evidence.runner import parser

CASES = (
    (Plan("gravity", 2, joint=1, rate=1000.0, add=lambda p: {"heavy": (1,), "load": 0.25}), 60.0, 30.0),
    (Plan("friction_drift", 3, spatial=True, rate=1000.0, add=lambda p: {"drift": (0.4, 25.0)}), 80.0, 40.0),
)


def row(folder: Path, number: int) -> list[str]:
    """Joints, seconds, causes, CPU time and memory of one case."""
    plan, seconds, test_seconds = CASES[number]
    case = of_plan(plan, number + 90, 9001 + 2 * number, seconds, test_seconds)
    finger, train, test, found = (folder / name for name in ("finger.json", "train.parquet", "test.parquet", "found"))
    finger.write_text(json.dumps(case.nominal), encoding="utf-8")
    case.train.to_parquet(train)
    case.test.to_parquet(test)
    command = [sys.executable, "-m", "tendonfmu", "diagnose", str(finger), str(train), "--test", str(test)]
    process = subprocess.Popen([*command, "--kinematics", "2", "-q", "-o", str(found)])
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    causes = [cause["effect"] for cause in json.loads((found / "diagnosis.json").read_text(encoding="utf-8"))["causes"]]
    cpu, memory = used.ru_utime + used.ru_stime, used.ru_maxrss / 1024
    return [f"{plan.joints}", f"{seconds:g} + {test_seconds:g}", ", ".join(causes), f"{cpu:.0f} s", f"{memory:.0f} MB"]


def main() -> None:
    parser(__doc__, output=None).parse_args()
    rows = []
    for number in range(len(CASES)):
        with tempfile.TemporaryDirectory() as folder:
            rows.append(row(Path(folder), number))
    print(tables.table(["joints", "s at 1 kHz", "causes", "CPU time", "peak memory"], rows))


if __name__ == "__main__":
    main()
