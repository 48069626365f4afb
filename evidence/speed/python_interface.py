"""What a sample costs in Python: python -m evidence.speed.python_interface

`run` takes a recording in one call, `Runner.step` one sample after the other; beside them the C library behind the same
binding, which is the part that is not Python. CPU time of this process, least of several repetitions: other jobs on the
machine make it longer. Prints a table as Markdown.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import tendonfmu as tf
from evidence import tables
from evidence.runner import EXAMPLES, parser
from tendonfmu.model import native

DEMO = EXAMPLES / "demo_recording"
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
    times = []
    for _ in range(repetitions):
        begin = time.process_time()
        call()
        times.append(time.process_time() - begin)
    return min(times)


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
    options = parser(__doc__, output=None)
    options.add_argument("--repetitions", type=int, default=15)
    repetitions = options.parse_args().repetitions
    lines = []
    for name, description, recording, changes in CASES:
        finger = tf.read_finger(DEMO / description).replace(changes)
        library, run, step = costs(finger, tf.read_recording(DEMO / recording), repetitions)
        lines.append([name, *(f"{value:.2f} µs" for value in (library, run, step, step - library))])
    head = ["finger", "C library, one call", "`tf.run`", "`Runner.step`", "of it Python"]
    print(tables.table(head, lines))


if __name__ == "__main__":
    main()
