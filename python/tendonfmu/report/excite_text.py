"""What a motion excites, as tables and lines that `cli/excite.py` prints."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

from tendonfmu.estimate import EffectCoverage, Verdict, counts_by_kind, identifiability
from tendonfmu.excite import ExciteResult
from tendonfmu.files import counted
from tendonfmu.report.numbers import Row, Table

KEYS = ("static", "coulomb", "stribeck_velocity", "viscous")
NEVER = ("side", "working_point", "slow")  # causes that another motion removes


def tables(result: ExciteResult) -> Iterator[Table]:
    """List the tables to print: joints, friction effects, kinds of numbers."""
    motion = result.motion
    yield (
        f"{result.subject.finger.name}: {motion.time[-1]:g} s of motion, {_load(result)}",
        ("joint", "range, rad", "fastest, rad/s", "strokes", "reversals", "slow reversals", "rests", "resting, s"),
        [
            (
                span.name,
                f"{cover.lowest:.3g} to {cover.highest:.3g}",
                f"{cover.fastest:.2f}",
                *map(str, (cover.strokes, cover.reversals, cover.slow_reversals, cover.rests)),
                f"{cover.resting:.1f}",
            )
            for span, cover in zip(result.ranges, result.joints, strict=True)
        ],
    )
    yield (
        "friction effects: time of sliding in each direction, and below v_min",
        ("effect", "positive, s", "negative, s", "below v_min, s", "cannot be identified"),
        [_effect_row(cover, result.judgement.verdicts) for cover in result.effects],
    )
    yield (
        f"numbers with a standard error of at most {identifiability.LIMIT:.0%}",
        ("kind", "numbers", "identified", "if all else were known"),
        [
            (f"{kind}.{key}", *map(str, counts))
            for (kind, key), counts in sorted(counts_by_kind(result.judgement.verdicts).items())
        ],
    )


def _load(result: ExciteResult) -> str:
    plan = result.plan
    if plan.vary is None:
        return f"pretension {', '.join(f'{level:g}' for level in plan.pretensions)} N"
    return f"tensions of {plan.vary.lowest:g} to {plan.vary.highest:g} N, changed every {plan.vary.every:g} s"


def _effect_row(cover: EffectCoverage, verdicts: list[Verdict]) -> Row:
    own = [v for v in verdicts if v.number.effect is not None and v.number.effect.path == cover.effect.path]
    missing = []
    for key in KEYS:
        of_key = [v for v in own if v.number.key == key]
        lost = [v for v in of_key if not v.identifiable]
        if lost:
            missing.append(key if len(lost) == len(of_key) else f"{key} {_which(lost)}")
    times = cover.times
    return (
        cover.effect.path,
        *(f"{seconds:.1f}" for seconds in (times.positive, times.negative, times.stuck)),
        ", ".join(missing) or "-",
    )


def _which(lost: list[Verdict]) -> str:
    """Name the laws, and the sides of an asymmetric law."""
    effect = lost[0].number.effect
    if effect is not None and effect.angles:
        return "of laws " + _runs(sorted({v.number.point + 1 for v in lost}))
    return "of " + ", ".join(v.number.path.split(".")[-2] for v in lost)


def _runs(numbers: list[int]) -> str:
    """Shorten 1, 2, 3, 5 to "1-3, 5"."""
    parts = []
    for _, group in groupby(enumerate(numbers), lambda pair: pair[1] - pair[0]):
        run = [number for _, number in group]
        parts.append(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}")
    return ", ".join(parts)


def lines(result: ExciteResult) -> Iterator[str]:
    """List the lines to print: a summary, the assumptions, and which numbers another motion would identify."""
    judgement, noise = result.judgement, result.noise
    verdicts = judgement.verdicts
    known = sum(verdict.identifiable for verdict in verdicts)
    yield (
        f"{known} of {counted(len(verdicts), 'number')} can be identified one by one, "
        f"{counted(judgement.directions, 'independent combination')} of them; each joint's bias is tracked as well"
    )
    for cause, count in identifiability.causes(verdicts).items():
        yield f"  {count} not identified: {identifiability.CAUSES[cause]}"
    tendons, joints = len(result.subject.finger.tendon_names), len(result.ranges)
    if result.plan.vary is None and "combination" in identifiability.causes(verdicts) and tendons > joints + 1:
        yield "  --vary-tension LOW:HIGH loads the tendons in turn and identifies more of those combinations"
    yield (
        f"assumed: white noise of {noise.std:g} N·m + {noise.per_force:g} N·m per N in each {1e3 * noise.time:g} ms, "
        f"bias a random walk of {noise.drift:g} (N·m)²/s"
    )
    for verdict in verdicts:
        if verdict.cause in NEVER:
            yield f"  {verdict.number.path}: {verdict.reason}"
    for i, seconds in enumerate(result.slack, start=1):
        if seconds > 0:
            name = result.subject.finger.tendon_names[i - 1]
            higher = "--pretension" if result.plan.vary is None else "lowest tension of --vary-tension"
            yield f"  {name} would go slack for {seconds:.1f} s: a higher {higher} keeps it taut"
