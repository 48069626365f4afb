"""Six dated recordings of a finger in numpy, the friction of one edge 6 % higher from each to the next.

python -m evidence.diagnosis.change_history -o history
cd history && tendonfmu diagnose finger.json 2026-*.parquet --history -o out
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from evidence.diagnosis.change_measured import fitted
from evidence.diagnosis.change_simulated import NONE, How, described, record, scaled
from evidence.fingers import numpy_maxwell
from tendonfmu.files.tables import write_table

DAYS = ("2026-03-01", "2026-03-08", "2026-03-15", "2026-03-22", "2026-04-05", "2026-04-12")
GROWTH = 0.06  # of the friction of tendon 5's edge at joint 1, from one recording to the next
SECONDS = 30.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder, made if it is not there")
    folder: Path = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    for k, day in enumerate(DAYS):
        difference = scaled("SHARE", 1.0 + GROWTH * k, 4, 0) if k else NONE
        columns = record(numpy_maxwell, difference, How(motion=100 + k, noise=200 + k, seconds=SECONDS)).columns
        write_table(folder / f"{day}.parquet", dict(columns))
        if not k:
            model = fitted(described(numpy_maxwell), [columns])
            (folder / "finger.json").write_text(json.dumps(model), encoding="utf-8")


if __name__ == "__main__":
    main()
