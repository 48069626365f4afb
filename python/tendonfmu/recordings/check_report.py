"""What `tendonfmu check --json` prints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tendonfmu.model import Finding
from tendonfmu.recordings.match_map import map_keys
from tendonfmu.recordings.match_text import verdict
from tendonfmu.recordings.recording import Recording

FORMAT = "tendonfmu-check-1"


def check_report(
    file: Path, kind: str, lines: Sequence[str], findings: Sequence[Finding], recordings: Sequence[dict[str, Any]]
) -> dict[str, Any]:
    """Return the report on a sound finger description or rig."""
    return {
        "format": FORMAT,
        "file": str(file),
        "sound": True,
        "kind": kind,
        "summary": list(lines),
        "findings": [_finding(each) for each in findings],
        "recordings": list(recordings),
    }


def refusal_report(file: Path, reason: str) -> dict[str, Any]:
    """Return the report on a refused description or rig. reason: one line."""
    return {"format": FORMAT, "file": str(file), "sound": False, "reason": reason}


def recording_report(recording: Recording, findings: Sequence[Finding]) -> dict[str, Any]:
    """Return the report on a recording. findings: from `belongs`."""
    return {
        "file": str(recording.path),
        "belongs": not any(finding.severity == "error" for finding in findings),
        "samples": len(recording),
        "duration": float(recording.time[-1] - recording.time[0]),
        "verdict": verdict(recording, findings),
        "findings": [_finding(each) for each in findings],
    }


def _finding(finding: Finding) -> dict[str, Any]:
    return {**asdict(finding), "path": str(finding.path), "map": map_keys(finding.entries), "line": finding.line()}
