"""What happens from the command line to the exit status: `tendonfmu` parses, calls and prints.

Results go to files or standard output, messages to standard error.

Exit status: 0 done, 1 the answer is no, 2 bad usage or input, 3 internal fault of tendonfmu, 130 and 143 interrupted.
"""

from __future__ import annotations

import functools
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, NoReturn, TextIO

import typer
from typer.main import get_command

from tendonfmu.cli import calibrate as cli_calibrate
from tendonfmu.cli import campaign as cli_campaign
from tendonfmu.cli import check as cli_check
from tendonfmu.cli import convert as cli_convert
from tendonfmu.cli import describe as cli_describe
from tendonfmu.cli import detect as cli_detect
from tendonfmu.cli import diagnose as cli_diagnose
from tendonfmu.cli import import_mjcf as cli_import_mjcf
from tendonfmu.cli import run as cli_run
from tendonfmu.cli.console import (
    BAD_INPUT,
    FAULT,
    INTERRUPTED,
    PRINTED,
    fail,
    fit_bar,
    leave,
    phase_bar,
    print_json,
    print_tables,
    progress_bar,
    reader_may_leave,
    say,
    say_files,
    warn,
)
from tendonfmu.cli.fault_report import is_own_file, is_without_memory, write_fault_report
from tendonfmu.cli.options import (
    AsJson,
    FingerFile,
    FreeRecordings,
    Kinematics,
    Progress,
    Quiet,
    Report,
    Seed,
    Subject,
)
from tendonfmu.cli.standard_streams import check_table, name_of, reads, write_table
from tendonfmu.errors import InputError, InputWarning, line_of
from tendonfmu.files import counted
from tendonfmu.tasks import ended_by_signals

_show_as_python = warnings.showwarning

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # its boxes cut off the names of options at 80 columns
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Model the friction of tendon-driven robot fingers, and detect contact without a tactile sensor.",
)

cli_check.register(app)


@functools.cache
def _commands() -> Callable[..., Any]:
    """Return what `app` runs at each call. To read the options of all commands takes 50 ms: once in a process."""
    return get_command(app)


def main() -> None:
    """Run the command.

    A refusal is one line on standard error and exit status 2. An internal fault is one line and exit status 3.
    """
    PRINTED.quiet = PRINTED.json = PRINTED.table = False
    warnings.showwarning = _show_warning
    warnings.simplefilter("default", InputWarning)  # each text once
    with ended_by_signals() as ending:
        try:
            status = _commands()(prog_name="tendonfmu", standalone_mode=False)
        except (InputError, OSError) as refused:
            if isinstance(refused, BrokenPipeError):  # the reader of standard output has closed it, as `head` does
                sys.stderr.close()
                sys.exit(0)
            if isinstance(refused, OSError) and (refused.errno is None or is_own_file(refused.filename)):
                _fault(refused)
            _refuse(line_of(refused))
        except (KeyboardInterrupt, typer.Abort):
            _interrupted(ending.status)
        except SystemExit as ended:
            if ended.code == INTERRUPTED:  # the command has already reported what it saved
                leave(ending.status)
            raise
        except Exception as refused:
            if is_without_memory(refused):
                _refuse("not enough memory")
            # Bad usage is recognised by this method: its class has moved between versions of typer.
            if not hasattr(refused, "format_message"):
                _fault(refused)
            elif type(refused).__name__ == "NoArgsIsHelpError":
                print(refused.format_message(), file=sys.stderr)
                sys.exit(BAD_INPUT)
            else:
                page = getattr(getattr(refused, "ctx", None), "command_path", "tendonfmu")
                _refuse(f"{refused.format_message().rstrip('.')}; see {page} --help")
        else:
            if status == INTERRUPTED:  # newer versions of typer turn Ctrl-C into a status
                _interrupted(ending.status)
            with reader_may_leave(sys.stdout):
                sys.stdout.flush()
            sys.exit(status if isinstance(status, int) else 0)


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Show a warning about the input as a line, and any other as Python does."""
    if issubclass(category, InputWarning):
        warn(" ".join(str(message).split()))
    else:
        _show_as_python(message, category, filename, lineno, file, line)


def _refuse(reason: str) -> NoReturn:
    fail(" ".join(reason.split()))
    sys.exit(BAD_INPUT)


def _fault(error: BaseException) -> NoReturn:
    report = write_fault_report(error, sys.argv[1:])
    where = "no report could be written" if report is None else f"please send the report {report}"
    fail(f"internal error ({type(error).__name__}), a fault of tendonfmu, not of its input; {where}")
    leave(FAULT)


def _interrupted(status: int) -> NoReturn:
    fail("interrupted; no file was left half written")
    leave(status)


def _show_version(wanted: bool) -> None:
    if wanted:
        from tendonfmu import __version__

        print(f"tendonfmu {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="print the version and exit")
    ] = False,
) -> None:
    """Model the friction of tendon-driven robot fingers, and detect contact without a tactile sensor."""


@app.command()
@reads("file")
def build(
    file: Subject,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FINGER.fmu", help="FMU to write")],
    reference: Annotated[
        Path | None,
        typer.Option(metavar="REC", help="recording; the FMU carries its inputs and outputs for checks"),
    ] = None,
    ssv: Annotated[
        list[Path] | None,
        typer.Option(metavar="SET.ssv", help="parameter set that the FMU carries; may be repeated"),
    ] = None,
    binaries: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="folder of binaries by FMI platform [default: those installed]"),
    ] = None,
    fmi: Annotated[
        int, typer.Option(min=2, max=3, metavar="2|3", help="version of FMI; 3: forces and torques as arrays")
    ] = 2,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Pack a co-simulation FMU: the friction of a finger, or the simulated finger of a rig.

    Needs no compiler. The same input gives the same bytes.
    """
    from tendonfmu.fmu import fmu_report
    from tendonfmu.interface import build as build_fmu

    build_fmu(file, output, reference=reference, ssv=ssv or [], binaries=binaries, fmi=fmi)
    say(f"{output}: {output.stat().st_size / 1024:.0f} KiB")
    print_json(lambda: fmu_report(file, output))


cli_run.register(app)


@app.command()
@reads("rig")
def simulate(
    rig: Annotated[Path, typer.Argument(metavar="RIG.json", help="rig of a simulated finger")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="REC.parquet", help="recording, .csv or .parquet")],
    truth: Annotated[
        Path | None, typer.Option(metavar="TRUTH.parquet", help="true signals to write, .csv or .parquet")
    ] = None,
    integrator: Annotated[str | None, typer.Option(metavar="cvode|fixed_step", help="[default: the rig's]")] = None,
    progress: Progress = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Simulate a finger and write the recording. The same rig gives the same numbers."""
    from tendonfmu.files import check_format, check_output
    from tendonfmu.simulate import INTEGRATORS, read_rig
    from tendonfmu.simulate import simulate as simulate_rig

    if integrator is not None and integrator not in INTEGRATORS:
        raise InputError(f"--integrator {integrator}: expected {' or '.join(INTEGRATORS)}")
    found = read_rig(rig)
    check_table(output, *found.files)
    if truth is not None:
        check_format(truth)
        check_output(truth, *found.files)
    if truth is not None and truth.resolve() == output.resolve():
        raise InputError(f"{truth}: the same file for recording and truth; expected two names")
    with progress_bar(progress) as bar:
        task = bar.add_task("samples", total=None)
        result = simulate_rig(
            found,
            truth=truth is not None,
            integrator=integrator,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )
    if truth is not None and result.truth is not None:
        write_table(truth, result.truth)
    write_table(output, result.recording)
    written = {"output": output} if truth is None else {"output": output, "truth": truth}
    print_json(lambda: result.report(found, written))
    for line in result.summary(found):
        say(f"{name_of(output)}: {line}")


cli_convert.register(app)
cli_import_mjcf.register(app)
cli_describe.register(app)


@app.command()
@reads("finger")
def excite(
    context: typer.Context,
    finger: Annotated[Path, typer.Argument(metavar="FINGER.json|RIG.json", help="finger description, or rig")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="MOTION.csv", help="motion, .csv or .parquet")],
    duration: Annotated[
        float, typer.Option(min=1.0, max=1e5, metavar="SECONDS", help="per pretension, in all with --alternate")
    ] = 400.0,
    max_speed: Annotated[float, typer.Option(min=1e-3, max=100.0, metavar="RAD/S", help="limit for every joint")] = 1.0,
    range_: Annotated[
        list[str] | None,
        typer.Option(
            "--range", metavar="JOINT=LOW:HIGH", help="joint range in rad, by number or name; may be repeated"
        ),
    ] = None,
    pretension: Annotated[
        list[float] | None,
        typer.Option(min=1e-3, max=1e6, metavar="NEWTON", help="mean tendon force; may be repeated [default: 10]"),
    ] = None,
    alternate: Annotated[
        float | None, typer.Option(min=1.0, metavar="SECONDS", help="time between changes of the pretension")
    ] = None,
    vary_tension: Annotated[
        str | None,
        typer.Option(metavar="LOW:HIGH", help="in N; vary the tension of each tendon in turn, without a pretension"),
    ] = None,
    vary_every: Annotated[
        float, typer.Option(min=2.0, max=1e5, metavar="SECONDS", help="time between changes of the tensions")
    ] = 10.0,
    max_acceleration: Annotated[
        float, typer.Option(min=0.1, max=1e4, metavar="RAD/S²", help="limit for every joint")
    ] = 10.0,
    rate: Annotated[float, typer.Option(min=20.0, max=10000.0, metavar="HZ", help="rows per second")] = 100.0,
    seed: Seed = 0,
    report: Report = None,
    discriminate: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="write the next experiment of this diagnosis; only --rate applies"),
    ] = None,
    progress: Progress = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Plan a training motion; report what it excites and which parameters it cannot identify."""
    if discriminate is not None:
        cli_diagnose.discriminate(context, finger, discriminate, output, rate)
        return
    import json
    import shlex

    from tendonfmu.excite import Plan
    from tendonfmu.excite import training_motion as exciting
    from tendonfmu.files import check_output, write_text
    from tendonfmu.report import excite_text
    from tendonfmu.simulate import description_files, is_rig

    inputs = description_files(finger) if is_rig(finger) else [finger]
    check_table(output, *inputs)
    if report is not None:
        check_output(report, *inputs)
    if report is not None and report.resolve() == output.resolve():
        raise InputError(f"{report}: the same file for motion and report; expected two names")
    subject = exciting.read_subject(finger)
    ranges = exciting.find_ranges(subject, range_ or [])
    for span in ranges:
        if span.guessed:
            warn(f"joint {span.name}: {span.source}; set it with --range {span.name}=LOW:HIGH")
    vary = exciting.find_variation(vary_tension, vary_every, pretension, alternate)
    levels = exciting.find_pretensions(subject, pretension or [])
    plan = Plan(exciting.as_array(ranges), max_speed, duration, levels, alternate, rate, seed, vary, max_acceleration)
    with progress_bar(progress) as bar:
        task = bar.add_task("judging the motion", total=None)
        result = exciting.excite(subject, ranges, plan, lambda done, all_: bar.update(task, completed=done, total=all_))
    write_table(output, result.motion.columns())
    text = json.dumps(exciting.report(result, shlex.join(["tendonfmu", *sys.argv[1:]])), indent=1) + "\n"
    if report is not None:
        write_text(report, text)
    print_json(lambda: text)
    print_tables(excite_text.tables(result), excite_text.lines(result), left="cannot be identified")
    say(f"{name_of(output)}: {counted(len(result.motion.time), 'row')}, {result.motion.time[-1]:g} s")


@app.command()
@reads("finger", "recordings")
def fit(
    finger: FingerFile,
    recordings: FreeRecordings,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FITTED.json", help="description to write")],
    method: Annotated[str, typer.Option(metavar="batch|ekf", help="maximum likelihood or Kalman filter")] = "batch",
    report: Report = None,
    ssv: Annotated[
        Path | None, typer.Option(metavar="FITTED.ssv", help="parameter set of SSP to write, for FMUs of the finger")
    ] = None,
    figures: Annotated[Path | None, typer.Option(metavar="DIR", help="folder for figures and report.html")] = None,
    compare: Annotated[
        list[Path] | None, typer.Option(metavar="RECORDING", help="recording to judge, not to fit; may be repeated")
    ] = None,
    holdout: Annotated[
        float, typer.Option(min=0.0, max=0.9, metavar="SHARE", help="share of the time not used in the fit")
    ] = 0.0,
    holdout_block: Annotated[float, typer.Option(min=1.0, metavar="SECONDS", help="longest block left out")] = 10.0,
    kinematics: Kinematics = 1,
    only: Annotated[
        list[str] | None, typer.Option(metavar="PATTERN", help="estimate only these numbers; may be repeated")
    ] = None,
    fix: Annotated[
        list[str] | None, typer.Option(metavar="PATTERN", help="keep these numbers fixed; may be repeated")
    ] = None,
    share: Annotated[
        list[str] | None,
        typer.Option(metavar="tendons|pulleys|PATTERN", help="laws that share one set of values; may be repeated"),
    ] = None,
    asymmetric: Annotated[
        bool | None, typer.Option("--asymmetric/--symmetric", help="fit the two sides of a law apart, or as one")
    ] = None,
    prior: Annotated[
        float, typer.Option(min=1e-6, max=1e6, metavar="RATIO", help="prior: standard deviation / expected magnitude")
    ] = 1.0,
    scale: Annotated[
        list[str] | None, typer.Option(metavar="PATTERN=VALUE", help="expected magnitude, instead of the description's")
    ] = None,
    previous: Annotated[
        Path | None,
        typer.Option("--from", metavar="PREVIOUS.json", help="report or description of an earlier fit, as the prior"),
    ] = None,
    change: Annotated[
        float,
        typer.Option(
            min=1e-6, max=10.0, metavar="SHARE", help="with --from: expected relative change of the numbers since"
        ),
    ] = 0.02,
    effective_samples: Annotated[
        bool | None,
        typer.Option(help="count correlated residuals as fewer samples [default: with --from]"),
    ] = None,
    passes: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="most passes over the data [default: 60; ekf: 2]")
    ] = None,
    tolerance: Annotated[
        float, typer.Option(min=1e-9, max=0.5, metavar="SIZE", help="batch: last step, in standard errors")
    ] = 0.3,
    drift: Annotated[
        float, typer.Option(min=0.0, max=1.0, metavar="RATE", help="ekf: relative variance of the numbers per s")
    ] = 0.0,
    uncertainty: Annotated[
        bool,
        typer.Option("--uncertainty/--no-uncertainty", help="write the uncertainty of the friction, for detection"),
    ] = True,
    resume: Annotated[
        Path | None, typer.Option(metavar="FITTED.unfinished.json", help="continue an interrupted fit")
    ] = None,
    progress: Progress = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Estimate the numbers of a finger from recordings of free motion, with their uncertainty.

    PATTERN is a path of the description, such as
    tendons[*].edge_friction[2]*.viscous; * stands for anything. Ctrl-C saves
    the best estimate so far in FITTED.unfinished.json.
    """
    from tendonfmu.estimate import FitWarning, check_outputs, fit_report, write_unfinished
    from tendonfmu.files import write_text
    from tendonfmu.fmu import check_parameter_set_path
    from tendonfmu.interface import FitInterrupted
    from tendonfmu.interface import fit as fit_finger
    from tendonfmu.report import fit_text

    inputs = [finger, *recordings, *(compare or []), *(each for each in (previous, resume) if each is not None)]
    check_outputs(output, report, figures, inputs)
    if ssv is not None:
        check_parameter_set_path(ssv, *inputs)
    with progress_bar(progress) as bar:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", FitWarning)  # printed below, one line each
                found = fit_finger(
                    finger,
                    recordings,
                    method=method,
                    compare=compare or [],
                    holdout=holdout,
                    holdout_block=holdout_block,
                    kinematics=kinematics,
                    only=only or [],
                    fix=fix or [],
                    share=share or [],
                    asymmetric=asymmetric,
                    prior=prior,
                    scale=scale or [],
                    previous=previous,
                    change=change,
                    effective_samples=effective_samples,
                    passes=passes,
                    tolerance=tolerance,
                    drift=drift,
                    uncertainty=uncertainty,
                    resume=resume,
                    progress=fit_bar(bar),
                )
        except FitInterrupted as stopped:
            bar.stop()
            left = write_unfinished(output, stopped.unfinished)
            fail(f"interrupted; the best estimate so far is in {left}; continue with --resume {left}")
            sys.exit(INTERRUPTED)
    fitting = found.estimator
    for sentence in found.warnings:
        warn(sentence)
    found.write(output)
    text = fit_report.report_text(found.report)
    if report is not None:
        write_text(report, text)
    if ssv is not None:
        found.write(ssv)
    print_json(lambda: text)
    print_tables(fit_text.tables(fitting), fit_text.lines(fitting), left="joint")
    say(f"{output}: {counted(len(fitting.parameters_), 'number')} estimated")
    if report is not None:
        say(f"{report}: all results, as JSON")
    if ssv is not None:
        say(f"{ssv}: parameter set for an FMU of the finger")
    if figures is not None:
        from tendonfmu.report import write_fit_page

        say_files(write_fit_page(fitting.picture(), figures))


cli_calibrate.register(app)
cli_diagnose.register(app)
cli_detect.register(app)
cli_campaign.register(app)


@app.command()
def demo(
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="folder for the results")] = Path(
        "tendonfmu-demo"
    ),
    progress: Progress = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Show every step on built-in data in a minute: calibrate, detect, diagnose, fit, run.

    DIR gets the page story.html and all the files that it is made from.
    """
    from tendonfmu.demo import Story, chapter_lines, chapter_tables, file_lines, story_report, write_story

    story = Story(output)
    if story.missing:
        warn(f"{story.missing}")
    for number, chapter in enumerate(story.chapters, start=1):
        say(f"{number} {chapter.name}: {chapter.title[:1].lower()}{chapter.title[1:]}")
        with progress_bar(progress) as bar:
            chapter.run(phase_bar(bar))
        print_tables(chapter_tables(story, chapter.name), chapter_lines(story, chapter.name), left="")
    write_story(story)
    print_tables((), file_lines(story), left="")
    print_json(lambda: story_report(story))
