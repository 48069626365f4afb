"""What a sample costs in Python: python bench/python_interface.py

`run` takes a recording in one call, `Runner.step` one sample after the other; beside them the C library behind the same
binding, which is the part that is not Python. CPU time of this process, least of several repetitions: other jobs on the
machine make it longer. Prints a table as Markdown.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import tendonfmu as tf
from tendonfmu.model import native

DEMO = Path(__file__).parents[1] / "examples" / "demo_recording"
TWO, INDEX = "two_joints_unseen.parquet", "index_finger_pushes.parquet"
# what it is, description, recording, changes
CASES: tuple[tuple[str, str, str, dict[str, object]], ...] = (
    ("2 joints, 4 tendons, without presliding", "two_joints.json", TWO, {"extensions": None}),
    ("2 joints, 4 tendons, presliding at 4 places", "two_joints.json", TWO, {}),
    ("4 joints, 8 tendons, the paper's rule", "../fingers/index_finger.json", INDEX, {}),
    ("4 joints, 8 tendons, all that `calibrate` writes", "index_finger_calibrated.json", INDEX, {}),
)


def least(call: Callable[[], object], repetitions: int) -> float:
    """Least CPU time of a call, s."""
    found = []
    for _ in range(repetitions):
        begin = time.process_time()
        call()
        found.append(time.process_time() - begin)
    return min(found)


def costs(finger: tf.Finger, recording: tf.Recording, repetitions: int) -> tuple[float, float, float]:
    """C library, `run` and `step`, µs per sample."""
    instance, runner = native.Instance(finger.image), tf.Runner(finger)
    arrays = recording.arrays()
    columns = (recording.time.tolist(), list(arrays["tendon_force"]), list(arrays["tendon_position"]))

    def library() -> None:
        instance.reset()
        instance.run(arrays)

    def steps() -> None:
        runner.reset()
        for time_, force, position in zip(*columns, strict=True):
            runner.step(time_, force, position)

    calls = (library, lambda: tf.run(finger, recording), steps)
    first, second, third = (1e6 * least(call, repetitions) / len(recording) for call in calls)
    return first, second, third


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repetitions", type=int, default=15)
    repetitions = parser.parse_args().repetitions
    print("| finger | C library, one call | `tf.run` | `Runner.step` | of it Python |")
    print("| --- | --- | --- | --- | --- |")
    for name, description, recording, changes in CASES:
        finger = tf.read_finger(DEMO / description).replace(changes)
        found = costs(finger, tf.read_recording(DEMO / recording), repetitions)
        library, run, step = found
        print(f"| {name} | {library:.2f} µs | {run:.2f} µs | {step:.2f} µs | {step - library:.2f} µs |")


if __name__ == "__main__":
    main()
