"""Where the project's figures come from: each file asks one question, and has the parts that answer it in PARTS."""

import sys
from pathlib import Path

# Simulators of fingers that tests use, too. Here, so that worker processes find them as well.
sys.path.append(str(Path(__file__).resolve().parent.parent / "python_tests" / "support"))
