"""Where things are in the repository, for tests and benchmarks."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TESTS = ROOT / "python_tests"
SUPPORT = TESTS / "support"
