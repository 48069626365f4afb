"""VDMCheck2 reads the model descriptions: a formal model of FMI 2.0's text in VDM, by INTO-CPS.

It is inside Maestro's program, which `tools/nightly` fetches: its converter from XML, the model, and the interpreter.
"""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

import pytest

from optional_parts import MAESTRO, needs
from plant_rigs import needs_plant

NAME = "described"

pytestmark = [
    pytest.mark.long,
    needs("java", "maestro"),
]


@pytest.fixture(scope="module")
def rules(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The formal model, and the schema that the converter goes by."""
    folder = tmp_path_factory.mktemp("vdm")
    with zipfile.ZipFile(MAESTRO) as archive:
        for name in archive.namelist():
            if name.endswith(".vdmsl") and "/" not in name:
                archive.extract(name, folder)
            elif name.startswith("vdmcheck/schema/") or name == "schema/xsd2vdm.properties":
                (folder / "schema").mkdir(exist_ok=True)
                if not name.endswith("/"):
                    (folder / "schema" / Path(name).name).write_bytes(archive.read(name))
    return folder


def verdict(xml: bytes, rules: Path, folder: Path) -> str:
    """`true`, or what is wrong and `false`."""
    (folder / "modelDescription.xml").write_bytes(xml)
    java = ["java", "-Xmx1g", "-XX:ActiveProcessorCount=1", "-cp", str(MAESTRO)]
    value = folder / "value.vdmsl"
    schema = str(rules / "schema" / "fmi2ModelDescription.xsd")
    convert = ["xsd2vdm.Xsd2VDM", "-xsd", schema, "-xml", "modelDescription.xml", "-name", NAME, "-vdm", str(value)]
    subprocess.run([*java, *convert, "-nowarn"], cwd=folder, check=True, capture_output=True)
    model = [*map(str, sorted(rules.glob("*.vdmsl"))), str(value)]
    check = ["com.fujitsu.vdmj.VDMJ", "-vdmsl", "-q", "-e", f"isValidFMIModelDescription({NAME})", *model]
    done = subprocess.run([*java, *check], cwd=folder, capture_output=True, text=True, check=False)
    return done.stdout.strip()


def description_of(fmu: Path) -> bytes:
    with zipfile.ZipFile(fmu) as archive:
        return archive.read("modelDescription.xml")


@pytest.mark.parametrize("name", ["small_fmu_path", pytest.param("plant_fmu_path", marks=needs_plant)])
def test_vdmcheck_finds_nothing(name: str, rules: Path, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    assert verdict(description_of(request.getfixturevalue(name)), rules, tmp_path) == "true"


def test_vdmcheck_would_find_a_start_value_out_of_range(small_fmu_path: Path, rules: Path, tmp_path: Path) -> None:
    wrong = description_of(small_fmu_path).replace(b'start="0.0"', b'start="99999.0"', 1)
    assert verdict(wrong, rules, tmp_path).endswith("false")
