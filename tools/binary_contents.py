"""What a 64-bit shared library of Linux (ELF), Windows (PE) or macOS (Mach-O) offers and asks for, by its file alone.

contents = read_contents(data)      exported names, libraries, imported names, GLIBC versions
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import lief

MACHINES = {"X86_64": "x86_64", "AMD64": "x86_64", "AARCH64": "aarch64", "ARM64": "aarch64"}


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
    lief.logging.disable()
    library = lief.parse(data)
    if isinstance(library, lief.ELF.Binary) and library.header.identity_class == lief.ELF.Header.CLASS.ELF64:
        return _elf(library)
    if isinstance(library, lief.PE.Binary) and library.optional_header.magic == lief.PE.PE_TYPE.PE32_PLUS:
        return _pe(library)
    if isinstance(library, lief.MachO.Binary) and library.header.is_64bit:
        return _mach_o(library)
    raise ValueError(f"starts with {data[:4]!r}; expected a 64-bit ELF, PE or Mach-O shared library")


def _elf(library: lief.ELF.Binary) -> Contents:
    needed = {
        found[1]
        for version in library.symbols_version_requirement
        for each in version.get_auxiliary_symbols()
        if (found := re.fullmatch(r"GLIBC_([\d.]+)", each.name))
    }
    exports = frozenset(symbol.name for symbol in library.exported_symbols)
    imports = frozenset(each.name for each in library.dynamic_symbols if each.name and not each.shndx)
    machine = _machine(library.header.machine_type)
    return Contents("ELF", machine, exports, imports, tuple(library.libraries), tuple(sorted(needed, key=number_of)))


def _pe(library: lief.PE.Binary) -> Contents:
    exported = library.get_export()
    exports = frozenset(entry.name for entry in exported.entries) if exported else frozenset()
    imports = frozenset(entry.name for each in library.imports for entry in each.entries if not entry.is_ordinal)
    return Contents("PE", _machine(library.header.machine), exports, imports, tuple(library.libraries), ())


def _mach_o(library: lief.MachO.Binary) -> Contents:
    exports, imports = (
        frozenset(symbol.name.removeprefix("_") for symbol in symbols)
        for symbols in (library.exported_symbols, library.imported_symbols)
    )
    own = lief.MachO.LoadCommand.TYPE.LOAD_DYLIB
    libraries = tuple(each.name for each in library.libraries if each.command == own)
    return Contents("Mach-O", _machine(library.header.cpu_type), exports, imports, libraries, ())


def _machine(header: object) -> str:
    return MACHINES.get(str(header).rpartition(".")[2], "unknown")
