"""What a 64-bit shared library of Linux (ELF), Windows (PE) or macOS (Mach-O) offers and asks for.

    contents = read_contents(data)      exported names, libraries, imported names, GLIBC versions

Read from the file alone, so that the binaries of all platforms can be checked on any of them.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass

ELF_EXPORTING = (1, 2)  # bindings GLOBAL and WEAK
ELF_MACHINES = {62: "x86_64", 183: "aarch64"}
PE_MACHINES = {0x8664: "x86_64", 0xAA64: "aarch64"}
MACH_O_MACHINES = {0x01000007: "x86_64", 0x0100000C: "aarch64"}
MACH_O_SYMTAB, MACH_O_LOAD_DYLIB = 0x2, 0xC
MACH_O_EXTERNAL, MACH_O_TYPE, MACH_O_UNDEFINED, MACH_O_PRIVATE = 0x01, 0x0E, 0x00, 0x10


@dataclass(frozen=True)
class Contents:
    """format: ELF, PE or Mach-O. Names of C functions stand without the underscore that macOS puts before them."""

    format: str
    machine: str
    exports: frozenset[str]
    imports: frozenset[str]
    libraries: tuple[str, ...]
    glibc: tuple[str, ...]  # versions of GLIBC asked for, ascending

    @property
    def glibc_floor(self) -> tuple[int, ...]:
        """The oldest GLIBC that has them all; () where none is asked for."""
        return max((number_of(version) for version in self.glibc), default=())


def broken_promises(
    contents: Contents, exports: re.Pattern[str], libraries: re.Pattern[str], glibc: tuple[int, ...]
) -> list[str]:
    """What a library exports or needs beyond what it may; empty for a good one."""
    found = []
    foreign = sorted(name for name in contents.exports if not exports.fullmatch(name))
    if foreign:
        more = f" and {len(foreign) - 5} more" if len(foreign) > 5 else ""
        found.append(f"exports {', '.join(foreign[:5])}{more}; expected {exports.pattern} only")
    others = [name for name in contents.libraries if not libraries.fullmatch(name)]
    if others:
        found.append(f"needs {', '.join(others)}; expected the system's C library only")
    if contents.glibc_floor > glibc:
        found.append(f"needs GLIBC {contents.glibc[-1]}; expected at most {'.'.join(map(str, glibc))}")
    return found


def number_of(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split("."))


def read_contents(data: bytes) -> Contents:
    """Contents of a shared library. Raises ValueError for anything else."""
    if data[:5] == b"\x7fELF\x02":
        return _elf(data)
    if data[:2] == b"MZ":
        return _pe(data)
    if data[:4] == b"\xcf\xfa\xed\xfe":
        return _mach_o(data)
    raise ValueError(f"starts with {data[:4]!r}; expected a 64-bit ELF, PE or Mach-O shared library")


def _text(data: bytes, at: int) -> str:
    return data[at : data.index(b"\0", at)].decode()


# --- ELF -------------------------------------------------------------------------------------------------------------


def _elf(data: bytes) -> Contents:
    machine = ELF_MACHINES.get(struct.unpack_from("<H", data, 18)[0], "unknown")
    table, entry, count = struct.unpack_from("<Q", data, 40)[0], *struct.unpack_from("<HH", data, 58)
    # type, offset, size, link of each section
    sections = []
    for k in range(count):
        at = table + k * entry
        kind, offset, size = *struct.unpack_from("<I", data, at + 4), *struct.unpack_from("<QQ", data, at + 24)
        sections.append((kind, offset, size, struct.unpack_from("<I", data, at + 40)[0]))
    exports: set[str] = set()
    imports: set[str] = set()
    versions: set[str] = set()
    libraries = []
    for kind, offset, size, link in sections:
        strings = sections[link][1] if link < len(sections) else 0
        if kind == 11:  # dynamic symbols
            for at in range(offset + 24, offset + size, 24):
                name, info, _, section = struct.unpack_from("<IBBH", data, at)
                if info >> 4 in ELF_EXPORTING:
                    (exports if section else imports).add(_text(data, strings + name))
        elif kind == 6:  # dynamic section; tag 1 names a library
            for at in range(offset, offset + size, 16):
                tag, value = struct.unpack_from("<QQ", data, at)
                if tag == 1:
                    libraries.append(_text(data, strings + value))
        elif kind == 0x6FFFFFFE:  # versions needed
            versions |= _needed_versions(data, offset, strings)
    glibc = sorted((found[1] for v in versions if (found := re.fullmatch(r"GLIBC_([\d.]+)", v))), key=number_of)
    return Contents("ELF", machine, frozenset(exports), frozenset(imports), tuple(libraries), tuple(glibc))


def _needed_versions(data: bytes, at: int, strings: int) -> set[str]:
    found = set()
    while True:
        _, _, _, first, following = struct.unpack_from("<HHIII", data, at)
        entry = at + first
        while True:
            name, step = struct.unpack_from("<II", data, entry + 8)
            found.add(_text(data, strings + name))
            if not step:
                break
            entry += step
        if not following:
            return found
        at += following


# --- PE --------------------------------------------------------------------------------------------------------------


def _pe(data: bytes) -> Contents:
    header = struct.unpack_from("<I", data, 60)[0]
    if data[header : header + 4] != b"PE\0\0" or struct.unpack_from("<H", data, header + 24)[0] != 0x20B:
        raise ValueError("expected a 64-bit PE library")
    kind, count = struct.unpack_from("<HH", data, header + 4)
    sections = header + 24 + struct.unpack_from("<H", data, header + 20)[0]

    def place(address: int) -> int:
        """Offset in the file of an address relative to the image."""
        for k in range(count):
            size, start, length, offset = struct.unpack_from("<IIII", data, sections + 40 * k + 8)
            if start <= address < start + max(size, length):
                return int(address - start + offset)
        raise ValueError(f"address {address:#x} lies in no section")

    exports_at, _, imports_at, _ = struct.unpack_from("<IIII", data, header + 24 + 112)
    exports, imports, libraries = set(), set(), []
    if exports_at:
        names, first = struct.unpack_from("<I4xI", data, place(exports_at) + 24)
        for k in range(names):
            exports.add(_text(data, place(struct.unpack_from("<I", data, place(first) + 4 * k)[0])))
    entry = place(imports_at) if imports_at else 0
    while entry and (name := struct.unpack_from("<I", data, entry + 12)[0]):
        libraries.append(_text(data, place(name)))
        at = place(struct.unpack_from("<I", data, entry)[0])
        while lookup := struct.unpack_from("<Q", data, at)[0]:
            if not lookup >> 63:  # by name, after a hint of two bytes
                imports.add(_text(data, place(lookup) + 2))
            at += 8
        entry += 20
    return Contents(
        "PE", PE_MACHINES.get(kind, "unknown"), frozenset(exports), frozenset(imports), tuple(libraries), ()
    )


# --- Mach-O ----------------------------------------------------------------------------------------------------------


def _mach_o(data: bytes) -> Contents:
    machine = MACH_O_MACHINES.get(struct.unpack_from("<I", data, 4)[0], "unknown")
    exports: set[str] = set()
    imports: set[str] = set()
    libraries = []
    at = 32
    for _ in range(struct.unpack_from("<I", data, 16)[0]):
        command, size = struct.unpack_from("<II", data, at)
        if command == MACH_O_LOAD_DYLIB:
            libraries.append(_text(data, at + struct.unpack_from("<I", data, at + 8)[0]))
        elif command == MACH_O_SYMTAB:
            symbols, count, strings = struct.unpack_from("<III", data, at + 8)
            for k in range(count):
                name, kind = struct.unpack_from("<IB", data, symbols + 16 * k)
                if kind & MACH_O_EXTERNAL and not kind & MACH_O_PRIVATE:
                    undefined = kind & MACH_O_TYPE == MACH_O_UNDEFINED
                    (imports if undefined else exports).add(_text(data, strings + name).removeprefix("_"))
        at += size
    return Contents("Mach-O", machine, frozenset(exports), frozenset(imports), tuple(libraries), ())
