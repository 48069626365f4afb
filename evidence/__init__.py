"""What the project's figures come from: each file asks one question."""

import sys
from pathlib import Path

# Fingers that tests use as well.
sys.path.append(str(Path(__file__).resolve().parent.parent / "python_tests" / "support"))
