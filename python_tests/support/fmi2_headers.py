"""The headers of FMI 2.0, in a folder for a C compiler.

fmpy brings a copy whose fmi2Functions.h is changed in two definitions, and says so: it ignores FMI2_FUNCTION_PREFIX.
Here both are again what the standard has (FMI 2.0.3).
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import fmpy

FMPY_HEADERS = Path(fmpy.__file__).parent / "c-code"
NAMES = ("fmi2TypesPlatform.h", "fmi2FunctionTypes.h", "fmi2Functions.h")
# From the comment on FMI2_Export to the first table of functions.
CHANGED = re.compile(r"/\*\s*Export FMI2 API functions.*?(?=/\*{20,}\s*Common Functions)", re.DOTALL)
OF_THE_STANDARD = """\
#if !defined(FMI2_Export)
#if defined(FMI2_FUNCTION_PREFIX)
#define FMI2_Export
#elif defined(_WIN32) || defined(__CYGWIN__)
#define FMI2_Export __declspec(dllexport)
#elif __GNUC__ >= 4
#define FMI2_Export __attribute__((visibility("default")))
#else
#define FMI2_Export
#endif
#endif

#if defined(FMI2_FUNCTION_PREFIX)
#define fmi2Paste(a, b) a##b
#define fmi2PasteB(a, b) fmi2Paste(a, b)
#define fmi2FullName(name) fmi2PasteB(FMI2_FUNCTION_PREFIX, name)
#else
#define fmi2FullName(name) name
#endif

"""


def write_headers(folder: Path) -> Path:
    """Write the headers into a new folder, and return it."""
    folder.mkdir()
    for name in NAMES:
        shutil.copy(FMPY_HEADERS / name, folder)
    path = folder / "fmi2Functions.h"
    text = path.read_text(encoding="utf-8")
    if "defined(FMI2_FUNCTION_PREFIX)" not in text:
        text, count = CHANGED.subn(OF_THE_STANDARD, text)
        assert count == 1, "fmpy's fmi2Functions.h is not the one that this module knows"
        path.write_text(text, encoding="utf-8")
    return folder
