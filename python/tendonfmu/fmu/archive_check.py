"""Which archives are refused as FMUs before they are unpacked or their libraries loaded."""

from __future__ import annotations

import stat
import struct
import zipfile
from pathlib import Path

from tendonfmu.errors import InputError
from tendonfmu.files import counted

# An FMU of `tendonfmu build` has some 4 MB in 200 files; what is larger by far is no FMU and would fill the disk.
LARGEST_UNPACKED, MOST_MEMBERS = 1 << 30, 10_000


def is_whole(library: bytes) -> bool:
    """Return whether a 64-bit ELF library has all its sections: loading one without ends the process (SIGBUS)."""
    if library[:6] != b"\x7fELF\x02\x01" or len(library) < 64:
        return True  # of another kind: the loader refuses what it does not know
    (table,) = struct.unpack_from("<Q", library, 40)
    size, count = struct.unpack_from("<HH", library, 58)
    return bool(len(library) >= table + size * count)


def one_line(error: Exception) -> str:
    """Return what an error says, in one line."""
    return " ".join(str(error).split()) or type(error).__name__


def check_members(path: Path) -> None:
    """Check an archive before any of it is unpacked."""
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
    if len(members) > MOST_MEMBERS:
        raise InputError(f"{path}: {counted(len(members), 'file')} in it; expected an FMU, of at most {MOST_MEMBERS}")
    size = sum(member.file_size for member in members)  # no more is unpacked, whatever the data hold
    if size > LARGEST_UNPACKED:
        raise InputError(f"{path}: {size / 1e9:.3g} GB when unpacked; expected an FMU, of at most 1.07 GB")
    for member in members:
        if ".." in member.filename.split("/") or stat.S_ISLNK(member.external_attr >> 16):
            raise InputError(f"{path}: {member.filename!r} is a link or leads out of it; expected an FMU")
