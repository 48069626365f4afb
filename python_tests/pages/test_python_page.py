"""docs/reference/python.md, and the example of the public contract: what they show works."""

from __future__ import annotations

import os
import re
import shutil
import warnings
from pathlib import Path

import pandas as pd
import pytest

import tendonfmu as tf
from command import run_script
from repository_paths import ROOT

PAGE = (ROOT / "docs/reference/python.md").read_text(encoding="utf-8")
DEMO = ROOT / "examples/demo_recording"
# the contract's example, word by word but for the names that a reader has before
CONTRACT = """
import tendonfmu as tf

finger = tf.read_finger("finger.json")
rec = tf.read_recording("monday.parquet")
rec = tf.Recording.from_frame(df)
out = tf.run(finger, rec)
fit = tf.fit(finger, [rec], holdout=0.2)
tuned = tf.tune(fit.finger, [free])
score = tf.score(tuned.finger, [pushes])
found = tf.diagnose(finger, [rec], test=[other], reference=None)
tf.build(found.extended, "finger.fmu")

rec.frame, rec.plot(), out.frame, out.plot(), out.summary
fit.finger, fit.parameters, fit.residual_rms, fit.report, tuned.finger, tuned.attained_rate
score.found, score.events, score.false_alarms, score.median_delay
found.verdict, found.causes, found.gain, found.write("folder")
finger.to_dict(), finger.replace({"tendons[1].stiffness": 1e4}), finger.write("again.json"), finger._repr_html_()
force, position = rec.groups["tendon_force"], rec.groups["tendon_position"]
tf.Recording.from_arrays(rec.time, tendon_force=force, tendon_position=position)
"""


def run(code: str, folder: Path) -> str:
    script, before = folder / "example.py", Path.cwd()
    script.write_text(code, encoding="utf-8")
    os.chdir(folder)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            answer = run_script(script)
    finally:
        os.chdir(before)
    assert answer.status == 0, answer.err
    return answer.out


@pytest.mark.long
def test_the_example_of_the_contract(tmp_path: Path) -> None:
    shutil.copy(DEMO / "two_joints.json", tmp_path / "finger.json")
    pd.read_parquet(DEMO / "two_joints_training.parquet").iloc[:5500].to_parquet(tmp_path / "monday.parquet")
    pd.read_parquet(DEMO / "two_joints_unseen.parquet").iloc[:2000].to_parquet(tmp_path / "other.parquet")
    before = """
import pandas as pd
df = pd.read_parquet("monday.parquet")
free, other = "monday.parquet", "other.parquet"
pushes = pd.read_parquet("other.parquet").assign(contact=0)
"""
    run(before + CONTRACT, tmp_path)
    assert {"finger.fmu", "again.json", "folder"} <= {file.name for file in tmp_path.iterdir()}


@pytest.mark.slow
def test_the_first_example_works(tmp_path: Path) -> None:
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    code = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert code is not None
    printed = run(code[1], tmp_path)
    assert "joints[1].friction.coulomb" in printed and (tmp_path / "two_joints.fmu").is_file()


def test_the_page_lists_the_public_names() -> None:
    own = re.search(r"(.*?)## Beyond the public interface", PAGE, re.DOTALL)
    assert own is not None
    described = {name.rpartition(".")[2] for name in re.findall(r"^::: (\S+)", own[1], re.MULTILINE)}
    assert described - {"Cause"} == set(tf.__all__) - {"__version__"}
    functions = set(re.findall(r"^\| `(\w+)\(", own[1], re.MULTILINE))
    assert functions == {name for name in tf.__all__ if name[0].islower()} | {"Runner"}
