"""Makes the pictures of docs/guide and docs/reference/paper.md by the commands of these pages.

    python docs/figures/make_guide.py [-o FOLDER]      some 5 min of one core; needs tendonfmu, Pillow, Chromium

The pages that the commands write are photographed in a headless Chromium, and become small PNGs.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageChops

HERE = Path(__file__).resolve().parent
EXAMPLES = HERE.parents[1] / "examples"
RECORDED = EXAMPLES / "demo_recording"
SERVO = EXAMPLES / "one_joint"
WIDTH = 1100  # pixels; twice what a phone shows, sharp on a desk
COLOURS = 256

CALIBRATE = ["calibrate", RECORDED / "two_joints.json", RECORDED / "two_joints_training.parquet", "-o", "calibrated"]
DIAGNOSE = [
    *("diagnose", RECORDED / "two_joints.json", RECORDED / "two_joints_training.parquet"),
    *("--test", RECORDED / "two_joints_unseen.parquet", "-o", "diagnosis"),
]
FIT = [
    *("fit", EXAMPLES / "fingers" / "index_finger.json", RECORDED / "index_finger_free.parquet", "--holdout", "0.2"),
    *("-o", "fitted.json", "--figures", "fitted"),
]
SCORE = [
    *("score", RECORDED / "index_finger_calibrated.json", RECORDED / "index_finger_pushes.parquet"),
    *("-o", "score.json", "--figures", "score"),
]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=HERE, help="folder")
    output = parser.parse_args().output.resolve()
    output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        tendonfmu(folder, *CALIBRATE)
        keep(photograph(folder / "calibrated" / "calibration.html", 980), output / "calibrate.png")
        tendonfmu(folder, *DIAGNOSE)
        keep(photograph(folder / "diagnosis" / "diagnosis.html", 1130), output / "diagnose.png")
        tendonfmu(folder, *FIT)
        keep(photograph(folder / "fitted" / "report.html", 1130, "torque_2"), output / "fit.png")
        tendonfmu(folder, *SCORE)
        keep(photograph(folder / "score" / "score.html", 1130, "contacts"), output / "detect.png")
        servo_history(folder)
        keep(photograph(folder / "history" / "history.html", 980), output / "change.png")
        drawings(folder, output)


def drawings(folder: Path, output: Path) -> None:
    """The paper's figures, drawn again."""
    subprocess.run([sys.executable, "-m", "evidence", "fit.paper", "-o", folder], cwd=EXAMPLES.parent, check=True)
    for page in (folder / "fit.paper").glob("paper_*.html"):
        keep(photograph(page, 1100, width=820), output / f"{page.stem}.png")


def servo_history(folder: Path) -> None:
    """The servo of examples/one_joint: two weeks held against the first one."""
    subprocess.run([sys.executable, SERVO / "make_logs.py", "-o", "logs"], cwd=folder, check=True)
    for week, finger in ((1, ["--finger", "servo.json"]), (3, []), (5, [])):
        log = f"logs/week_{week}.csv"
        table = ["convert", "table", log, "--map", SERVO / "map.json", "-o", f"week_{week}.parquet"]
        tendonfmu(folder, *table, *finger)
    weeks = ["week_3.parquet", "week_5.parquet", "--reference", "week_1.parquet"]
    tendonfmu(folder, "diagnose", "servo.json", *weeks, "--history", "--kinematics", "3", "-o", "history")


def tendonfmu(folder: Path, *words: str | Path) -> None:
    command = [sys.executable, "-m", "tendonfmu", *map(str, words)]
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)


def photograph(page: Path, height: int, place: str = "", width: int = 1280) -> Path:
    """`height` pixels of a page, `width` pixels wide, from its top, or of the element with an id alone."""
    picture = page.with_suffix(".png")
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        raise SystemExit("make_guide.py: no Chromium found; expected chromium or google-chrome on the PATH")
    # figures are drawn after the page has loaded
    options = ["--headless", "--no-sandbox", "--hide-scrollbars", "--virtual-time-budget=5000"]
    options.append(f"--window-size={width},{height}")
    styles = ".modebar { display: none }"
    if place:  # a page that is scrolled is photographed white, so all else is hidden
        shown = ", ".join(f"#{each}, #{each} *" for each in (place, "js-plotly-tester"))  # which measures texts
        styles += f" body *:not(:has(#{place}), {shown}) {{ display: none !important }}"
    copy = page.with_stem(f"{page.stem}_{place}")
    copy.write_text(f"{page.read_text('utf-8')}<style>{styles}</style>", encoding="utf-8")
    command = [browser, *options, f"--screenshot={picture}", copy.as_uri()]
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    return picture


def keep(picture: Path, target: Path) -> None:
    """Without white below, shrunk to WIDTH and COLOURS."""
    with Image.open(picture) as image:
        small = image.convert("RGB")
        drawn = ImageChops.invert(small).getbbox() or (0, 0, *small.size)
        small = small.crop((0, 0, small.width, min(small.height, drawn[3] + 20)))
        if small.width > WIDTH:
            small = small.resize((WIDTH, round(small.height * WIDTH / small.width)), Image.Resampling.LANCZOS)
        small.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(target, optimize=True)


if __name__ == "__main__":
    main()
