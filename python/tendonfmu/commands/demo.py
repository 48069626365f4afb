"""The demo: every command on built-in data, from free motion to a tuned FMU. Each chapter calls it as a user would.

- calibrate: a two-joint finger is calibrated on a minute of motion;
- detect: pushes on an index finger are detected, which was calibrated on 27 min of motion;
- diagnose: what the model of the two-joint finger lacked, which is unknown to the demo;
- fit: the numbers of the two-joint finger alone;
- run: the FMU of the index finger runs over free motion, and over the same motion at four times the pretension.

One page shows all of them and leads to the page of each command. If the installation cannot estimate, the chapters of
the two-joint finger are left out.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated, Any

from tendonfmu import calibration, estimate
from tendonfmu import drawing as draw
from tendonfmu import report as reporting
from tendonfmu.commands.build import build
from tendonfmu.commands.calibrate import CalibrateResult, calibrate
from tendonfmu.commands.command import Progress, command, output_option
from tendonfmu.commands.console import Bar, print_json, print_results, say, say_files, warn
from tendonfmu.commands.detection import score
from tendonfmu.commands.fit import fit
from tendonfmu.commands.run import run
from tendonfmu.files import check_output_folder, write_bytes, write_text
from tendonfmu.model import read_finger
from tendonfmu.tasks import forget_steps

FORMAT = "tendonfmu-demo-2"
PAGE = "story.html"
DATA = files("tendonfmu") / "data"
TWO_JOINTS, TRAINING, UNSEEN = "two_joints.json", "two_joints_training.parquet", "two_joints_unseen.parquet"
INDEX, GIVEN, FMU = "index_finger_calibrated.json", "index_finger.json", "index_finger.fmu"
FREE, FREE_X4, PUSHES = "index_finger_free", "index_finger_free_x4", "index_finger_pushes"
SHOWN = "mcp_flexion"  # joint that is drawn
TITLES = {
    "calibrate": "From free motion to a tuned FMU",
    "detect": "Contact without a touch sensor",
    "diagnose": "What the model got wrong, and why",
    "fit": "Its numbers alone, and how well they are known",
    "run": "What the joints feel, friction subtracted",
}
ESTIMATING = ("calibrate", "diagnose", "fit")  # chapters that need the estimation, which some installations lack

Phase = Callable[[str, int, int | None], None]  # words, steps done, steps


@dataclass(frozen=True)
class Chapter:
    """What a chapter shows, in the terminal and on the page."""

    name: str
    tile: reporting.Tile  # its most important number
    tables: Sequence[reporting.Table]
    lines: Sequence[str]
    sheets: Sequence[draw.Sheet]
    page: str  # the page of its command, in the folder

    @property
    def title(self) -> str:
        return TITLES[self.name]


class Story:
    """The demo in a folder: `run` its chapters in the order of `names`, then `write` the page."""

    def __init__(self, folder: Path) -> None:
        check_output_folder(folder)
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self.names = [name for name in TITLES if estimate.HAS_ESTIMATION or name not in ESTIMATING]
        self.missing = (
            "" if estimate.HAS_ESTIMATION else f"{', '.join(ESTIMATING)} are left out: {estimate.ESTIMATION_MISSING}"
        )
        self.chapters: list[Chapter] = []
        self.files: dict[Path, str] = {}  # each file with its content in words
        self._calibrated: CalibrateResult

    def run(self, name: str, phase: Phase) -> Chapter:
        """Run a chapter. `phase` is called with what it does."""
        with as_file(DATA) as data, warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # the pages list them
            chapter: Chapter = getattr(self, f"_{name}")(data, phase)
        self.chapters.append(chapter)
        return chapter

    def write(self) -> None:
        """Write the page of all chapters that have run, whole or not at all."""
        page, copied = self.folder / PAGE, self.folder / "data"
        copied.mkdir(exist_ok=True)
        for file in DATA.iterdir():
            self.files[write_bytes(copied / file.name, file.read_bytes())] = (
                "built-in data, which the examples of --help use"
            )
        sheets = [replace(sheet, section=each.name) for each in self.chapters for sheet in each.sheets]
        written = [(path.relative_to(self.folder).as_posix(), what) for path, what in self.files.items()]
        content = {"chapters": self.chapters, "missing": self.missing, "files": written}
        write_text(page, reporting.render("story.html.jinja", sheets, **content))
        self.files = {page: "the whole demo, for a browser", **self.files}

    def report(self) -> dict[str, Any]:
        """Return what `tendonfmu demo --json` prints."""
        return {
            "format": FORMAT,
            "folder": str(self.folder),
            "chapters": [
                {"name": each.name, "title": each.title, "result": each.tile._asdict(), "lines": each.lines}
                for each in self.chapters
            ],
            "left_out": self.missing or None,
            "files": {str(path): what for path, what in self.files.items()},
        }

    # --- chapters: the two-joint finger -------------------------------------------------------------------------------

    def _calibrate(self, data: Path, phase: Phase) -> Chapter:
        folder = self.folder / "calibration"
        forget_steps(folder)  # of an earlier demo: this one shows every step
        self._calibrated = calibrate(
            data / TWO_JOINTS,
            data / TRAINING,
            test=data / UNSEEN,
            folder=folder,
            progress=lambda state: phase(state.words, state.done, state.total),
        )
        phase("writing", 0, None)
        self.files |= self._calibrated.write(folder)
        report = self._calibrated.report
        lines = [*(f"warning: {sentence}" for sentence in report["warnings"]), *calibration.text.lines(report)]
        tile = reporting.Tile(*next(calibration.text.tiles(report)))
        sheet = next(calibration.text.sheets(self._calibrated.calibration))
        page = f"{folder.name}/{calibration.PAGE}"
        return Chapter("calibrate", tile, list(calibration.text.tables(report)), lines, [sheet], page)

    def _diagnose(self, data: Path, phase: Phase) -> Chapter:
        """Show what the calibration has found."""
        del data, phase
        found, words = self._calibrated.calibration.diagnosis, reporting.diagnosis_text
        assert found is not None, "no step was there to be repeated"
        factor, unit = words.unit_of(found)
        before, after = (factor * reporting.together(model.test_rms) for model in (found.nominal, found.extended))
        meaning = "error on held-out parts, before and after the causes are built in"
        sheets = [sheet for sheet in reporting.diagnosis_sheets(found) if sheet.section != "views"]
        page = f"calibration/{calibration.DIAGNOSIS}/{reporting.diagnosis_page.PAGE}"
        tile = _fell(before, after, unit, meaning)
        return Chapter("diagnose", tile, list(words.tables(found)), list(words.lines(found)), sheets, page)

    def _fit(self, data: Path, phase: Phase) -> Chapter:
        fitted = fit(
            data / TWO_JOINTS,
            data / TRAINING,
            compare=data / UNSEEN,
            progress=lambda now: phase(f"fitting: {now.phase}", now.done, now.total),
        )
        phase("drawing the fit", 0, None)
        folder, picture = self.folder / "fit", fitted.estimator.picture()
        self.files |= reporting.write_fit_page(picture, folder)
        fitted.write(folder / "fitted.json")
        self.files[folder / "fitted.json"] = "the fitted description"
        residuals = reporting.residual_tables(picture.report, picture.fitted.joint_names)
        *_, unseen = residuals
        meaning = "error on an unseen recording, before and after the fit"
        tile = _fell(unseen.all.start, unseen.all.fitted, unseen.unit, meaning)
        sheets = [list(reporting.torque_sheets(picture))[-1]]
        sheets += [sheet for sheet in reporting.law_sheets(picture) if sheet.name == "laws_joints"]
        lines, page = list(reporting.fit_page.summary_sentences(picture, residuals)), f"fit/{reporting.fit_page.PAGE}"
        return Chapter("fit", tile, [next(reporting.fit_page.tables(fitted.estimator))], lines, sheets, page)

    # --- chapters: the index finger -----------------------------------------------------------------------------------

    def _detect(self, data: Path, phase: Phase) -> Chapter:
        fmu = self.folder / FMU
        build(data / INDEX, fmu)
        self.files[fmu] = "the calibrated index finger's FMU"
        pushes = data / f"{PUSHES}.parquet"
        show = partial(phase, "running the finger")
        after, before = (score(data / finger, pushes, progress=show) for finger in (INDEX, GIVEN))
        self.files |= reporting.write_score_figures(after.scored, self.folder / "score")
        tile = reporting.Tile(f"{after.found} of {after.events}", "", "pushes found, without a touch sensor")
        as_given = f"as given: {before.found} of {before.events} pushes found"
        lines = [*reporting.detection.score_lines(after.scored), as_given]
        tables, sheet = list(reporting.detection.score_tables(after.scored)), next(reporting.score_sheets(after.scored))
        return Chapter("detect", tile, tables, lines, [sheet], "score/score.html")

    def _run(self, data: Path, phase: Phase) -> Chapter:
        finger, fmu = read_finger(data / INDEX), self.folder / FMU
        headings, reports, sheets, lines = ["joint"], [], [], []
        for name in (FREE, FREE_X4):
            outputs = self.folder / f"{name}.csv"
            result = run(fmu, data / f"{name}.parquet", progress=lambda done: phase("running the FMU", done, None))
            result.write(outputs)
            table = result.columns()
            report = reporting.run_report(
                fmu, Path(f"{name}.parquet"), table, finger, kinematics=1, output=outputs.name
            )
            page = reporting.write_run_page(self.folder / f"{name}.html", report, table)
            self.files |= {outputs: f"the FMU's outputs over {name}.parquet", page: "the same, for a browser"}
            force = f"{result.recording.groups['tendon_force'].mean():.0f} N"
            (joint,) = (sheet for sheet in reporting.run_sheets(table, finger.joint_names) if sheet.title == SHOWN)
            sheets.append(replace(joint, caption=f"{SHOWN.replace('_', ' ')}, free motion at {force}"))
            lines.append(f"free motion at {force}: {result.summary}")
            headings.append(f"at {force}")
            reports.append(report)
        left = ([_pair(joint) for joint in report["joints"]] for report in reports)
        rows = [tuple(row) for row in zip(finger.joint_names, *left, strict=True)]
        title = f"{finger.name}: joint torque → left after compensation, rms in mN·m"
        joint = reports[0]["joints"][finger.joint_names.index(SHOWN)]
        tile = reporting.Tile(_pair(joint), "mN·m", "torque at the base of the finger, before and after compensation")
        return Chapter("run", tile, [(title, tuple(headings), rows)], lines, sheets, f"{FREE}.html")


def _fell(before: float | None, after: float | None, unit: str, meaning: str) -> reporting.Tile:
    return reporting.Tile(f"{reporting.rounded(before)} → {reporting.rounded(after)}", unit, meaning)


def _pair(joint: dict[str, Any]) -> str:
    return f"{1e3 * joint['joint_torque_rms']:.1f} → {1e3 * joint['compensated_torque_rms']:.1f}"


@command("demo")
def demo_files(
    output: Annotated[Path, output_option("DIR", "folder for the results")] = Path("tendonfmu-demo"),
    progress: Progress = None,
) -> None:
    """Show every step on built-in data in a minute: calibrate, detect, diagnose, fit, run.

    DIR gets the page story.html and all the files that it is made from.
    """
    story = Story(output)
    if story.missing:
        warn(f"{story.missing}")
    for number, name in enumerate(story.names, start=1):
        say(f"{number} {name}: {TITLES[name][:1].lower()}{TITLES[name][1:]}")
        with Bar(progress) as bar:
            chapter = story.run(name, bar)
        print_results(chapter.tables, chapter.lines, left="")
    story.write()
    say_files(story.files)
    print_json(story.report)
