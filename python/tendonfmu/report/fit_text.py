"""How a finished fit reads in the terminal: tables and lines that `cli/fit.py` prints."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from tendonfmu.estimate import Fitted, FrictionFit, verdicts
from tendonfmu.files import counted

Row = tuple[str, ...]
EXAMPLES = 3  # paths listed for each reason


def tables(fit: FrictionFit) -> Iterator[tuple[str, Row, list[Row]]]:
    """List the tables to print: what is left of the torque, and the numbers by kind."""
    report, numbers, joints = fit.report_, fit.numbers_, fit.description_.joint_names
    known = report["identified"]
    yield _residuals(report, joints)
    yield (
        f"numbers with a standard error of at most 30 %: {known['count']} of {known['of']}",
        ("kind", "numbers", "identified", "median change", "at a bound"),
        list(_kinds(numbers)),
    )


def _residuals(report: Mapping[str, Any], joints: Sequence[str]) -> tuple[str, Row, list[Row]]:
    residual = report["residual"]
    sets = [("training", residual["train"]), ("held out", residual["held_out"])]
    sets += [(f"{each['label']}, {each['mean_force']:.3g} N", each) for each in residual["comparisons"]]
    rows = []
    for label, found in sets:
        if not found or "rms" not in found:
            continue
        for j, joint in enumerate(joints):
            names = ("torque_rms", "bias_only_rms", "model_only_rms", "start_rms", "rms")
            rows.append((label if j == 0 else "", joint, *(_milli(found[name][j]) for name in names), _share(found, j)))
    headings = ("", "joint", "torque", "bias only", "model only", "before", "fitted", "left")
    return f"{report['finger']}: residual before the bias learns from it, rms in mN·m", headings, rows


def _milli(value: float | None) -> str:
    return "-" if value is None else f"{1e3 * value:.2f}"


def _share(found: Mapping[str, Any], j: int) -> str:
    left, torque = found["rms"][j], found["torque_rms"][j]
    return f"{100 * left / torque:.0f} %" if left is not None and torque else "-"


def _kinds(numbers: Sequence[Fitted]) -> Iterator[Row]:
    by_kind: dict[str, list[Fitted]] = {}
    for number in numbers:
        by_kind.setdefault(_kind(number), []).append(number)
    for kind, members in sorted(by_kind.items()):
        known = [number for number in members if number.identified]
        changes = sorted(abs(number.value / number.start - 1) for number in known if number.start)
        change = f"{100 * changes[len(changes) // 2]:.0f} %" if changes else "-"
        bound = sum(number.at_bound is not None for number in members)
        yield kind, str(len(members)), str(len(known)), change, str(bound) if bound else "-"


def _kind(number: Fitted) -> str:
    path = number.number.path
    return path.split("[")[0] if path.startswith("bias") else f"{number.number.kind}.{number.number.key}"


def lines(fit: FrictionFit) -> Iterator[str]:
    """List the lines to print: how the fit went, the residuals, and what would identify the remaining numbers."""
    report, numbers = fit.report_, fit.numbers_
    used = sum(each["used"] for each in report["recordings"])
    held = sum(each["held_out"] for each in report["recordings"])
    left = sum(each["contact_left_out"] + each["faulty_left_out"] for each in report["recordings"])
    ended = "converged" if report["converged"] else "NOT converged"
    passes = f", {counted(report['passes'], 'pass', 'passes')}" if report["passes"] else ""
    yield (
        f"{report['method']}: {ended} in {report['seconds']:.1f} s{passes}; trained on {counted(used, 'sample')}, "
        f"{held} held out, {left} left out"
    )
    innovations = report["innovations"]
    low, high = innovations["nis"]["interval"]
    if innovations["nis"]["mean"] is not None:
        lags = ", ".join("-" if value is None else f"{value:.2f}" for value in innovations["whiteness"]["lag_one"])
        yield (
            f"innovations: NIS {innovations['nis']['mean']:.3g} ({low:.3f} to {high:.3f} where the noise settings "
            f"hold), autocorrelation at lag one {lags}"
        )
    samples, worth = (innovations["effective"][key] for key in ("samples", "worth"))
    if sum(worth) < sum(samples):
        by_joint = ", ".join(f"{each:.0f}" for each in worth)
        yield f"effective number of samples by joint: {by_joint} of {samples[0]:.0f}"
    if report["uncertainty"]:
        yield _uncertainty(report["uncertainty"])
    for cause, count in Counter(number.cause for number in numbers if number.cause).most_common():
        yield f"  {count} not identified: {verdicts.CAUSES[cause]}"
        several = [number for number in numbers if number.cause == cause]
        for number in several[:EXAMPLES]:
            yield f"    {number.number.path}: {number.advice}"
        if count > EXAMPLES:
            yield f"    ... and {count - EXAMPLES} more; --report lists all"


def _uncertainty(found: Mapping[str, Any]) -> str:
    std, error = found["train"]["std"], found["train"]["error_rms"]
    size = ", ".join(_milli(value) for value in std)
    times = ", ".join(f"{value:.3g}" for value in found["inflation"])
    left = ", ".join(f"{100 * e / s:.0f}" if s else "-" for e, s in zip(error, std, strict=True))
    return (
        f"uncertainty of the modelled friction torque: {size} mN·m rms, the residuals counting as {times} times the "
        f"noise settings; contact.uncertainty reproduces it within {left} % rms"
    )
