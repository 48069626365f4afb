"""The example of the public contract works, and docs/reference/python.md has every public name."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import pandas as pd
import pytest
from test_code_blocks import FINGER, TRAINING, UNSEEN, Page, run

import tendonfmu as tf

BEFORE = """
import pandas as pd
df = pd.read_parquet("monday.parquet")
free, other = "monday.parquet", "other.parquet"
pushes = pd.read_parquet("other.parquet").assign(contact=0)
"""
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


@pytest.mark.long
def test_the_example_of_the_contract(tmp_path: Path) -> None:
    shutil.copy(FINGER, tmp_path / "finger.json")
    pd.read_parquet(TRAINING).iloc[:5500].to_parquet(tmp_path / "monday.parquet")
    pd.read_parquet(UNSEEN).iloc[:2000].to_parquet(tmp_path / "other.parquet")
    run([sys.executable, "-W", "ignore", "-c", BEFORE + CONTRACT], tmp_path)
    assert {"finger.fmu", "again.json", "folder"} <= {file.name for file in tmp_path.iterdir()}


def test_the_page_has_every_public_name() -> None:
    page = Page("reference/python").text.partition("## Beyond the public interface")[0]
    described = {name.rpartition(".")[2] for name in re.findall(r"^::: (\S+)", page, re.MULTILINE)}
    assert described - {"Cause"} == set(tf.__all__) - {"__version__"}
