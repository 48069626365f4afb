"""How the steps of a long computation are kept in a folder, so that finished and unchanged steps are not repeated.

A result is JSON and belongs to everything it was made from: the digest of the recordings, of the options, of the
results before it, and of the version of the product.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tendonfmu.files import write_text

if TYPE_CHECKING:
    from numpy.typing import NDArray

FOLDER = ".steps"
FORMAT = "tendonfmu-calibration-step-1"


class Steps:
    """Results of steps in a folder."""

    def __init__(self, folder: Path, made_from: Mapping[str, Any]) -> None:
        self._folder = folder / FOLDER
        self._before = digest_of(made_from)
        self.repeated: list[str] = []  # names of the steps whose results were reused

    def result(
        self,
        name: str,
        made_from: Mapping[str, Any],
        compute: Callable[[], dict[str, Any]],
        page: Path | None = None,
    ) -> dict[str, Any]:
        """Return the result of a step, computed only if it does not exist."""
        key = self._before = digest_of({"before": self._before, "name": name, **made_from})
        file = self._folder / f"{name}.json"
        kept = _read(file, key)
        if kept is not None and (page is None or page.is_file()):
            self.repeated.append(name)
            return kept
        result = compute()
        self._folder.mkdir(parents=True, exist_ok=True)
        write_text(file, json.dumps({"format": FORMAT, "key": key, "result": result}) + "\n")
        # as a later call would read it: tuples become lists
        return dict(json.loads(json.dumps(result)))


def forget_steps(folder: Path) -> None:
    """Delete the results, so that the next calibration in this folder computes everything again."""
    shutil.rmtree(folder / FOLDER, ignore_errors=True)


def _read(file: Path, key: str) -> dict[str, Any] | None:
    """Return the result with this key, or None if there is none or the file is something else."""
    try:
        content = json.loads(file.read_bytes())
    except (OSError, ValueError):
        return None
    if not isinstance(content, dict) or content.get("format") != FORMAT or content.get("key") != key:
        return None
    result = content.get("result")
    return result if isinstance(result, dict) else None


def digest_of(content: Mapping[str, Any]) -> str:
    """Return the digest of JSON values, independent of the order of keys."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def digest_of_arrays(arrays: Mapping[str, NDArray[Any]]) -> str:
    """Return the digest of named arrays."""
    digest = hashlib.sha256()
    for name, values in arrays.items():
        digest.update(f"{name}{values.shape}".encode() + values.tobytes())
    return digest.hexdigest()
