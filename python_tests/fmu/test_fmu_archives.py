"""Archives that are no FMU are refused in one line before anything of them lies on the disk, or can be run.

Each is made from a sound one: other bytes, names, headers and members.
"""

from __future__ import annotations

import struct
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fmu_binary import FINGER
from tendonfmu.errors import InputError
from tendonfmu.fmu import fmpy_client
from tendonfmu.recordings import Recording

Maker = Callable[[Path, Path], None]  # a sound FMU, the file to write


def members(fmu: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(fmu) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def written(parts: dict[str, bytes] | list[tuple[str | zipfile.ZipInfo, bytes]], file: Path) -> None:
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in parts.items() if isinstance(parts, dict) else parts:
            archive.writestr(name, content)


def with_member(name: str, content: bytes) -> Maker:
    return lambda fmu, file: written([*members(fmu).items(), (name, content)], file)


def replaced(name: str, change: Callable[[bytes], bytes]) -> Maker:
    """name: the end of the member's name."""
    return lambda fmu, file: written({k: change(v) if k.endswith(name) else v for k, v in members(fmu).items()}, file)


def without(part: str) -> Maker:
    return lambda fmu, file: written({k: v for k, v in members(fmu).items() if part not in k}, file)


def linked(target: str) -> Maker:
    def make(fmu: Path, file: Path) -> None:
        link = zipfile.ZipInfo("resources/link")
        link.create_system, link.external_attr = 3, 0o120777 << 16
        written([*members(fmu).items(), (link, target.encode()), ("resources/link/evil", b"evil")], file)

    return make


def in_headers(field: int, size: int, value: int) -> Maker:
    """A field of the central directory's first entries, set to a value."""

    def make(fmu: Path, file: Path) -> None:
        content = bytearray(fmu.read_bytes())
        at = content.find(b"PK\x01\x02")
        while at >= 0:
            content[at + field : at + field + size] = value.to_bytes(size, "little")
            at = content.find(b"PK\x01\x02", at + 46)
        file.write_bytes(bytes(content))

    return make


def bytes_of(change: Callable[[bytes], bytes]) -> Maker:
    return lambda fmu, file: file.write_bytes(change(fmu.read_bytes())) and None


LAUGHS = (
    b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "ha">'
    + b"".join(b'<!ENTITY %c "%s">' % (98 + k, b"&%c;" % (97 + k) * 10) for k in range(12))
    + b"]><fmiModelDescription fmiVersion='2.0' modelName='&l;'/>"
)
ENTITY = (
    b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]>'
    b'<fmiModelDescription fmiVersion="2.0" modelName="&e;" guid="x"/>'
)
XML = "modelDescription.xml"


ARCHIVES: dict[str, Maker] = {
    "empty": bytes_of(lambda b: b""),
    "half": bytes_of(lambda b: b[: len(b) // 2]),
    "without its end": bytes_of(lambda b: b[:-1]),
    "path up": with_member("../../../../../../../../tmp/reliability_evil", b"evil"),
    "absolute path": with_member("/tmp/reliability_evil", b"evil"),
    "backslashes": with_member("..\\..\\reliability_evil", b"evil"),
    "drive": with_member("C:\\reliability_evil", b"evil"),
    "link to a file": linked("/etc/passwd"),
    "long name": with_member("resources/" + "x" * 5000, b""),
    "name with NUL": with_member("resources/a\0b", b""),
    "name of a folder and of a file": with_member("resources", b"a file"),
    "twice the same name": with_member(XML, b"<x/>"),
    "10 GB in the headers": in_headers(24, 4, 0xFFFFFFF0),
    "unknown compression": in_headers(10, 2, 99),
    "encrypted": in_headers(8, 2, 1),
    "wrong checksum": in_headers(16, 4, 12345),
    "headers elsewhere": in_headers(42, 4, 0x7FFFFFFF),
    "no description": without(XML),
    "no binary": without("binaries/"),
    "no image": without("model.image"),
    "description is no XML": replaced(XML, lambda b: b"<fmiModelDescription"),
    "entities of 10^12 characters": replaced(XML, lambda b: LAUGHS),
    "entity of a file": replaced(XML, lambda b: ENTITY),
    "FMI 1.0": replaced(XML, lambda b: b.replace(b'fmiVersion="2.0"', b'fmiVersion="1.0"')),
    "another GUID": replaced(XML, lambda b: b.replace(b'guid="{', b'guid="{0')),
    "identifier with a path": replaced(XML, lambda b: b.replace(b'modelIdentifier="', b'modelIdentifier="../../../')),
    "references that are no numbers": replaced(XML, lambda b: b.replace(b'valueReference="1', b'valueReference="x1')),
    "binary is a text": replaced(".so", lambda b: b"no library\n"),
    "binary ends early": replaced(".so", lambda b: b[: len(b) // 2]),
    "binary of another machine": replaced(".so", lambda b: b[:18] + struct.pack("<H", 183) + b[20:]),
    "image of zeros": replaced("model.image", lambda b: bytes(len(b))),
}


# What reading the FMU does not need: such an FMU may be run without it.
HARMLESS = {"long name", "name with NUL", "twice the same name"}


@pytest.fixture(scope="module")
def recording() -> Recording:
    tendons = len(FINGER["tendons"])
    time = 0.01 * np.arange(5)
    groups = {"tendon_force": np.full((5, tendons), 5.0), "tendon_position": np.zeros((5, tendons))}
    return Recording(Path("made"), time, groups)


def outcome(file: Path, recording: Recording) -> str:
    """What the refusal says, or "run". The current folder is the same afterwards."""
    before = Path.cwd()
    try:
        fmpy_client.run_fmu(file, recording)
    except InputError as refused:
        return str(refused)
    finally:
        assert Path.cwd() == before
    return "run"


@pytest.mark.parametrize("name", ARCHIVES)
def test_refused_in_one_line(
    small_fmu_path: Path, recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    file = tmp_path / "model.fmu"
    ARCHIVES[name](small_fmu_path, file)
    said = outcome(file, recording)
    assert (said == "run" and name in HARMLESS) or (said.startswith(str(file)) and "\n" not in said)
    assert list((tmp_path / "temporary").iterdir()) == []
    assert {path.name for path in tmp_path.iterdir()} == {"temporary", "model.fmu"}


def test_nothing_is_unpacked_of_an_archive_that_would_fill_the_disk(
    small_fmu_path: Path, recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fmpy.extract", lambda *_, **__: pytest.fail("unpacked"))
    monkeypatch.setattr(fmpy_client, "LARGEST_UNPACKED", 1 << 24)
    file = tmp_path / "model.fmu"
    with_member("resources/zeros", bytes(1 << 24))(small_fmu_path, file)
    with pytest.raises(InputError, match=r"GB when unpacked; expected an FMU"):
        fmpy_client.run_fmu(file, recording)
