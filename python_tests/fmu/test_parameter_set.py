"""Fitted numbers as a parameter set of SSP: what other readers make of it, and the FMU that takes it or carries it."""

from __future__ import annotations

import re
import warnings
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssv

import tendonfmu as tf
from optional_parts import require
from repository_paths import ROOT
from tendonfmu.estimate import FitWarning

DEMO = ROOT / "examples" / "demo_recording"
FINGER, RECORDING, UNSEEN = (
    DEMO / name for name in ("two_joints.json", "two_joints_training.parquet", "two_joints_unseen.parquet")
)
SSV = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"
SSC = "{http://ssp-standard.org/SSP1/SystemStructureCommon}"


@pytest.fixture(scope="module")
def fitted() -> Any:
    samples = tf.read_recording(RECORDING).frame[:6000]
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", FitWarning
        )  # few samples and passes: what is known badly is of interest as well
        return tf.fit(FINGER, samples, passes=2, uncertainty=False)


@pytest.fixture(scope="module")
def ssv(fitted: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("ssv") / "fitted.ssv"
    fitted.write(path)
    return path


def test_fmpy_reads_it_and_its_schema_accepts_it(fitted: Any, ssv: Path) -> None:
    found = {each.name: float(each.value) for each in read_ssv(str(ssv), validate=True).parameters}
    for path, row in fitted.parameters.iterrows():
        assert found[path] == pytest.approx(row.value, rel=1e-9)
    tied = set(found) - set(fitted.parameters.index)  # static friction that is equal to the Coulomb friction
    assert tied and all(found[path] == found[path.replace(".static", ".coulomb")] for path in tied)


def test_standard_errors_and_warnings_are_annotations(fitted: Any, ssv: Path) -> None:
    root = ElementTree.parse(ssv).getroot()
    for path, row in fitted.parameters.iterrows():
        place = f"{SSV}Parameters/{SSV}Parameter[@name='{path}']/{SSV}Annotations/{SSC}Annotation"
        (annotation,) = root.iterfind(place)
        assert annotation.get("type") == "tendonfmu.uncertainty"
        assert float(annotation[0].attrib["standardError"]) == row.standard_error
        assert annotation[0].attrib["identified"] == str(bool(row.identified)).lower()
    (annotation,) = root.iterfind(f"{SSV}Annotations/{SSC}Annotation")
    assert annotation.get("type") == "tendonfmu.fit"
    assert [each.text for each in annotation[0].findall("warning")] == fitted.warnings and fitted.warnings


def test_the_fmu_of_the_start_with_the_set_is_that_of_the_fitted_finger(fitted: Any, ssv: Path, tmp_path: Path) -> None:
    """By fmpy, which sets one value after the other in the order of the FMU."""
    signals = tf.read_recording(UNSEEN).frame[:400]
    start = tf.build(FINGER, tmp_path / "start.fmu")
    values = {each.name: each.value for each in read_ssv(str(ssv)).parameters}
    step = float(np.median(np.diff(signals["time"])))
    names = [name for name in signals.columns if name.startswith(("time", "tendon"))]
    outputs = ["friction_torque[1]", "compensated_torque[2]"]

    def run(start_values: dict[str, Any]) -> Any:
        return fmpy.simulate_fmu(
            str(start),
            validate=False,
            start_time=float(signals["time"].iloc[0]),
            stop_time=float(signals["time"].iloc[-1]),
            output_interval=step,
            input=signals[names].to_records(index=False),
            start_values=start_values,
            output=outputs,
        )

    with_set, without = run(values), run({})
    expected = tf.run(fitted.finger, signals).frame
    for name in outputs:
        scale = np.abs(expected[name]).max()
        assert np.abs(with_set[name][1:] - expected[name].to_numpy()[:-1]).max() < 1e-9 * scale
        assert np.abs(without[name][1:] - expected[name].to_numpy()[:-1]).max() > 1e-3 * scale


def test_the_fmu_carries_it(ssv: Path, tmp_path: Path) -> None:
    folder = "extra/org.fmi-standard.fmi-ls-ref"
    with zipfile.ZipFile(tf.build(FINGER, tmp_path / "with.fmu", ssv=ssv)) as archive:
        (related,) = ElementTree.fromstring(archive.read(f"{folder}/fmi-ls-manifest.xml"))
        assert archive.read(f"{folder}/fitted.ssv") == ssv.read_bytes()
    assert related.attrib["role"] == "parameter" and related.attrib["type"] == "application/x-ssp-parameter-set"
    assert related.attrib["source"] == "fitted.ssv"


SYSTEM = """<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription version="1.0" name="finger"
    xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon">
  <ssd:System name="finger"><ssd:Elements>
    <ssd:Component name="friction" type="application/x-fmu-sharedlibrary" source="resources/friction.fmu">
      <ssd:ParameterBindings><ssd:ParameterBinding source="resources/fitted.ssv"/></ssd:ParameterBindings>
    </ssd:Component>
  </ssd:Elements></ssd:System>
</ssd:SystemStructureDescription>
"""


def test_a_master_applies_it(ssv: Path, tmp_path: Path) -> None:
    """ecos, from an SSP package."""
    require("ecos")
    from ecospy import EcosSimulation

    with zipfile.ZipFile(tmp_path / "finger.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", SYSTEM)
        archive.write(tf.build(FINGER, tmp_path / "friction.fmu"), "resources/friction.fmu")
        archive.write(ssv, "resources/fitted.ssv")
    expected = {each.name: float(each.value) for each in read_ssv(str(ssv)).parameters}
    with EcosSimulation(ssp_path=str(tmp_path / "finger.ssp"), step_size=0.001) as simulation:
        simulation.init(parameter_set="two_joints: fitted")
        simulation.step()
        assert {name: simulation.get_real(f"friction::{name}") for name in expected} == expected


# --- sets that are refused --------------------------------------------------------------------------------------------

REFUSED = {
    "of another finger": (r"joints\[1\]", "joints[7]", r"joints\[7\]\S*: not a parameter of two_joints\.json"),
    "no number": (r'Real value="[^"]*"', 'Real value="much"', "no Real with a number"),
    "out of range": (r'Real value="[^"]*"', 'Real value="-5"', "-5"),
    "another unit": (r'value="([^"]*)" unit="[^"]*"', r'value="\1" unit="kg"', "unit kg; expected"),
    "another root": ("ParameterSet ", "ParameterMapping ", "expected a parameter set of SSP"),
    "no XML": ("<", "", "expected a parameter set of SSP"),
}


@pytest.mark.parametrize("refused", REFUSED)
def test_a_set_that_the_fmu_does_not_take_is_refused(ssv: Path, tmp_path: Path, refused: str) -> None:
    pattern, replacement, message = REFUSED[refused]
    text = re.sub(pattern, replacement, ssv.read_text(encoding="utf-8"), count=1)
    (tmp_path / "bad.ssv").write_text(
        text.replace("</ssv:ParameterSet>", "</ssv:ParameterMapping>") if "Mapping" in text else text
    )
    with pytest.raises(tf.InputError, match=r"bad\.ssv: .*" + message):
        tf.build(FINGER, tmp_path / "a.fmu", ssv=[tmp_path / "bad.ssv"])
