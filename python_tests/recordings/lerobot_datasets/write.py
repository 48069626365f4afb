"""Writes a small LeRobot dataset with the package lerobot: `python write.py FOLDER`.

v2.1 was written by lerobot 0.3.3 (datasets 3.6.0), v3.0 by lerobot 0.4.4 (datasets 4.5.0), both with torch 2.7.1 for
Python 3.11. These take 6 GB, so the tests read what they wrote. The folder `images` was left out.
"""

import sys
from pathlib import Path

import numpy as np
from lerobot.datasets.lerobot_dataset import CODEBASE_VERSION, LeRobotDataset

NUMBER = {"dtype": "float32", "names": None}
FEATURES = {
    "observation.state": {
        "dtype": "float32",
        "shape": (4,),
        "names": ["shoulder.pos", "elbow.pos", "shoulder.torque", "elbow.torque"],
    },
    "observation.velocity": {**NUMBER, "shape": (2,)},
    "action": {"dtype": "float32", "shape": (2,), "names": {"motors": ["shoulder.pos", "elbow.pos"]}},
    "next.reward": {**NUMBER, "shape": (1,)},
    "observation.matrix": {**NUMBER, "shape": (2, 2)},
    "observation.images.wrist": {"dtype": "image", "shape": (4, 4, 3), "names": ["height", "width", "channels"]},
}

root = Path(sys.argv[1])
dataset = LeRobotDataset.create("me/arm", fps=50, features=FEATURES, root=root, robot_type="arm", use_videos=False)
for episode, length in enumerate((60, 40, 50)):
    for k in range(length):
        t = k / 50
        angle = 0.6 * np.sin(3 * t + episode)
        state = [angle, 2 * angle, 0.8 * np.sign(np.cos(3 * t + episode)), 0.1 * np.cos(t)]
        frame = {
            "observation.state": np.array(state, dtype=np.float32),
            "observation.velocity": np.array([2 * angle, 4 * angle], dtype=np.float32),
            "action": np.array(state[:2], dtype=np.float32),
            "next.reward": np.array([k / 10], dtype=np.float32),
            "observation.matrix": np.eye(2, dtype=np.float32),
            "observation.images.wrist": np.zeros((4, 4, 3), dtype=np.uint8),
        }
        if CODEBASE_VERSION == "v2.1":
            dataset.add_frame(frame, task="move")
        else:
            dataset.add_frame({**frame, "task": "move"})
    dataset.save_episode()
if hasattr(dataset, "finalize"):
    dataset.finalize()
