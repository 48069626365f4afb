"""How a diagnosis reads in plain words: names of places, sentences for page and terminal, printed tables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tendonfmu.arrays import Numbers
from tendonfmu.diagnosis import (
    CONTACT,
    UNKNOWN,
    ZERO,
    Cause,
    CausePlace,
    Diagnosis,
    Invisible,
    Names,
    Where,
    at_place,
    names_in,
    numbered,
    quantity,
    reported_causes,
    title_of,
)
from tendonfmu.files import counted
from tendonfmu.report.kit import (
    Row,
    Table,
    capital,
    decimals,
    percent,
    percent_interval,
    rounded,
    together,
    torque_unit,
    words_of,
)
from tendonfmu.statistics import Interval

_NUMBERS = ("No", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine", "Ten")
_MOST_PLACES = 4  # listed at most
_PLACED = 4  # so many invisible effects are listed with their places
_FALLEN = math.exp(-1.0)  # a correlation that has fallen to this is over, as that of one time constant


def names_of(diagnosis: Diagnosis) -> Names:
    """Return the names of joints and tendons from the fitted description."""
    return names_in(diagnosis.nominal_data)


def unit_of(diagnosis: Diagnosis) -> tuple[float, str]:
    """Return factor and name of the unit in which all torques of a diagnosis are shown."""
    rms = [*diagnosis.nominal.train_rms, *diagnosis.nominal.test_rms, *diagnosis.bias_only_rms]
    return torque_unit(max((value for value in rms if math.isfinite(value)), default=0.0))


@dataclass(frozen=True)
class Left:
    """What is left on unseen data, in the unit of `unit_of`."""

    whole: float  # rms over all joints
    noise: float  # the part that nothing recorded predicts
    predictable: float  # the rest
    digits: int  # decimals shown
    memory: str  # how long what is left stays correlated, in words; empty for white noise, or where it is unknown

    def text(self, value: float) -> str:
        return f"{value:.{self.digits}f}"


def left_of(diagnosis: Diagnosis) -> Left | None:
    """Return what is left on unseen data; None where the noise floor is unknown."""
    factor, _ = unit_of(diagnosis)
    whole, noise = factor * together(diagnosis.extended.test_rms), factor * together(diagnosis.noise_floor)
    if not (math.isfinite(whole) and math.isfinite(noise)):
        return None
    digits = decimals(whole)
    whole, noise = round(whole, digits), round(min(noise, whole), digits)
    return Left(whole, noise, round(whole - noise, digits), digits, _memory(diagnosis))


def _memory(diagnosis: Diagnosis) -> str:
    """Say over which time what is left is correlated, at the joint where it is longest: until 1/e of it remains."""
    views = [view for view in diagnosis.views if view.kind == "autocorrelation"]
    times = [_time_to_fall(view.x, view.after) for view in views if view.after[0] > _FALLEN]
    if not times:
        return ""
    longest = max(times)
    return f"{float(f'{1e3 * longest:.2g}'):g} ms" if longest < math.inf else f"{views[0].x[-1]:.2g} s or more"


def _time_to_fall(lag: Numbers, correlation: Numbers) -> float:
    """Return the lag (s) at which a correlation above `_FALLEN` first meets it; infinite if it stays above."""
    below = np.flatnonzero(correlation <= _FALLEN)
    if not len(below):
        return math.inf
    pair = [below[0], below[0] - 1]  # the lower value first, as np.interp wants
    return float(np.interp(_FALLEN, correlation[pair], lag[pair]))


# --- sentences --------------------------------------------------------------------------------------------------------


def has_rivals(cause: Cause) -> bool:
    """Return whether the data cannot distinguish a cause from other effects."""
    return bool(cause.confusable_with)


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict in one sentence, and a second one where something touches the finger."""
    count = len(diagnosis.causes)
    many = f"{_NUMBERS[count] if count < len(_NUMBERS) else count} {words_of(diagnosis.kind).one}s"
    text = words_of(diagnosis.kind).headlines[diagnosis.verdict][min(count, 2)].format(Many=many, many=many.lower())
    if count == 1:
        cause = diagnosis.causes[0]
        size = f", {cause.size}" if cause.changed else ""
        text = f"{text[:-1]}: {at_place(cause.title, cause.where, names_of(diagnosis))}{size}."
    if any(map(has_rivals, diagnosis.causes)):
        text += f" {'It' if count == 1 else 'Some of them'} may also be another effect, which looks alike here."
    left = left_of(diagnosis)
    if left is not None and diagnosis.kind != "change" and diagnosis.verdict in ("adequate", "explained"):
        memory = f", correlated over {left.memory}" if left.memory else ""
        if not count:
            text = f"{text[:-1]}: {left.text(left.whole)} {unit_of(diagnosis)[1]} remain{memory}."
        elif mostly_left(diagnosis):
            factor, unit = unit_of(diagnosis)
            before = rounded(factor * together(diagnosis.nominal.test_rms))
            text += f" But {left.text(left.whole)} of {before} {unit} remain{memory}: no recorded signal predicts them."
    for cause in reported_causes(diagnosis):
        if cause.where.effect == CONTACT and cause.changed is None:
            text += f" In some stretches it seems that {cause.title}: they were left out ({cause.size})."
        elif cause.where.effect == CONTACT:
            contact = f"{at_place(cause.title, cause.where, names_of(diagnosis))}, {cause.size}."
            text = f"{text} And {contact}" if count else capital(contact)
    return text


def mostly_left(diagnosis: Diagnosis) -> bool:
    """Return whether causes leave more than half of the error, and not as white noise."""
    left = left_of(diagnosis)
    return bool(diagnosis.causes and left is not None and left.memory) and diagnosis.gain.value < 0.5


def error_sentence(diagnosis: Diagnosis) -> str:
    """Return a sentence on the error on unseen data."""
    factor, unit = unit_of(diagnosis)
    nominal, extended = (together(each.test_rms) for each in (diagnosis.nominal, diagnosis.extended))
    text = f"On {unseen(diagnosis)} the error{words_of(diagnosis.kind).error}"
    if diagnosis.torque_causes:
        fall = f"from {rounded(factor * nominal)} to {rounded(factor * extended)} {unit} (rms)"
        text += f" falls {fall}, by {percent_interval(diagnosis.gain)}."
    else:
        text += f" is {rounded(factor * nominal)} {unit} (rms)."
    bias = together(diagnosis.bias_only_rms)
    if math.isfinite(bias):
        text += f" Without any friction model it would be {rounded(factor * bias)} {unit}."
    with_bias = [factor * together(each.test_rms) for each in diagnosis.delivered]
    if all(map(math.isfinite, with_bias)):
        text += f" With the bias, as the FMU runs, {rounded(with_bias[0])} and {rounded(with_bias[1])} {unit} remain."
    return text


def left_sentence(diagnosis: Diagnosis) -> str:
    """Return a sentence on what is left on unseen data."""
    left, (_, unit) = left_of(diagnosis), unit_of(diagnosis)
    if left is None:
        return ""
    noise = f"but it is correlated over {left.memory}, not white" if left.memory else "so for these sensors it is noise"
    planted = diagnosis.unexplained.planted
    if math.isfinite(planted):
        noise += (
            f"; of hidden states that were planted for a test the learner finds {100.0 * planted:.0f} % of the variance"
        )
    if left.predictable <= 0.0:
        return f"{left.text(left.whole)} {unit} remain. No recorded signal predicts any of it, {noise}."
    is_little = not diagnosis.unexplained.unknown and diagnosis.kind != "change"
    little = ": too little to matter, or no more than another friction law would gain" if is_little else ""
    return (
        f"{left.text(left.whole)} {unit} remain. Without the part that {words_of(diagnosis.kind).no_name} it would be "
        f"{left.text(left.noise)} {unit}{little}. No recorded signal predicts the rest, {noise}."
    )


def unknown_sentence(diagnosis: Diagnosis) -> str:
    """Say where the part is that can be predicted but has no name; empty where it is too little to matter."""
    where = diagnosis.unexplained.description.strip().rstrip(".") if diagnosis.unexplained.unknown else ""
    return f"{capital(where)}." if where else ""


def too_small_sentence(diagnosis: Diagnosis) -> str:
    """Introduce the list of effects that are too small to matter."""
    return words_of(diagnosis.kind).small.format(least=percent(diagnosis.least_gain))


def unseen(diagnosis: Diagnosis) -> str:
    """Name the data on which the gain was measured."""
    if diagnosis.held_out:
        return "parts of the recordings that were kept for testing"
    return "the test recording" if len(diagnosis.tests) == 1 else "the test recordings"


def tested_sentence(diagnosis: Diagnosis) -> str:
    """Say how many candidate causes were tested, and what the p-values mean."""
    if not diagnosis.tested:
        return ""
    return (
        f"{diagnosis.tested} candidate causes were tested. p is the probability that chance alone makes the strongest "
        "of them look like this."
    )


def confusion_sentence(cause: Cause, names: Names) -> str:
    """Name what the data cannot distinguish a cause from; empty if nothing."""
    if not cause.confusable_with:
        return ""
    places: dict[str, list[Where]] = {}
    for other in cause.confusable_with:
        places.setdefault(other.effect if other.effect == ZERO else str(other), []).append(other)
    others = [
        f"{at_place(title_of(first.effect), first, names)}{''.join(f' and {names.place(other)}' for other in more)}"
        for first, *more in places.values()
    ]
    return f"These recordings cannot distinguish it from: {'; '.join(others)}."


@dataclass(frozen=True)
class Hidden:
    """One effect that these data cannot show, at all its places."""

    title: str  # the effect and its places, in plain words
    places: str
    # at its first place: the share that survives the refit, and the change of the error at its ordinary size
    share: float
    gain: float | None
    absorbed: bool  # whether refitting absorbs it everywhere
    experiment: str  # experiment that would show it


def hidden(diagnosis: Diagnosis, names: Names) -> list[Hidden]:
    """List the effects that these data cannot show, each with the experiment of its first place, which shows most."""
    by_effect: dict[str, list[Invisible]] = {}
    for invisible in diagnosis.invisible:
        by_effect.setdefault(invisible.where.effect, []).append(invisible)
    effects = []
    for members in by_effect.values():
        best = members[0]
        places = [names.place(member.where) for member in members]
        text = "" if places == [""] else "; ".join(place or "the whole finger" for place in places)
        if len(places) > _MOST_PLACES:
            text = f"{len(places)} places, such as {places[0]}"
        share, gain = best.surviving_share, best.ordinary_gain
        effects.append(Hidden(best.title, text, share, gain, best.absorbed, best.experiment))
    return effects


def hidden_sentences(diagnosis: Diagnosis, names: Names) -> Iterator[str]:
    """Describe what these data cannot show: what refitting absorbs, and what would have to be larger than usual."""
    effects = hidden(diagnosis, names)
    change = diagnosis.kind == "change"
    hides = "the errors that both recordings share hide" if change else "other numbers of the model imitate"
    absorbed = [effect for effect in effects if effect.absorbed]
    small = [effect for effect in effects if not effect.absorbed]
    if absorbed:
        because = f"because {hides} {'it' if len(absorbed) == 1 else 'them'}"
        yield f"These recordings cannot show {counted(len(absorbed), 'effect')}, {because}: {_listed(absorbed)}."
    if small:
        what = f"{counted(len(small), 'effect')} only if larger than usual{_limit(diagnosis)}"
        yield f"These recordings can show {what}: {_listed(small)}."


def _limit(diagnosis: Diagnosis) -> str:
    needed = [each.needed_gain for each in diagnosis.invisible if each.needed_gain is not None and not each.absorbed]
    return f" (each must change the error by at least {percent(max(needed))})" if needed else ""


def _listed(effects: Sequence[Hidden]) -> str:
    """List effects, a few of them with their places; the table on the page has all places."""
    placed = len(effects) <= _PLACED
    return "; ".join(f"{each.title} ({each.places})" if placed and each.places else each.title for each in effects)


def next_sentence(diagnosis: Diagnosis) -> str:
    """Say what to record next."""
    sentence = diagnosis.experiment.sentence.rstrip(".")
    return f"{sentence}." if sentence else "No further recording is needed: nothing is left to find out."


def meaning_of_gain(diagnosis: Diagnosis, cause: Cause) -> str:
    """Say what the gain of a cause is less of. The gain of the whole diagnosis is another: that of `error_sentence`."""
    words = words_of(diagnosis.kind)
    if cause.where.effect == CONTACT:
        return (
            "error removed by using the level of the new recordings instead of the level of the reference"
            if cause.changed
            else "error removed on the training recordings by leaving out these stretches"
        )
    if cause.where.effect == UNKNOWN:
        return "error that would be removed if the predictable part were known"
    if cause.gain_unit == "m":
        return "error of the tendon positions that the cause removes on unseen data, all tendons together"
    return words.own_gain + (f", with the other {words.one}s in the model" if len(diagnosis.torque_causes) > 1 else "")


def gain_text(diagnosis: Diagnosis, cause: Cause) -> str:
    """Write the gain of a cause with its interval, and what it is less of."""
    return f"{percent_interval(cause.gain)} {meaning_of_gain(diagnosis, cause)}"


def own_gain_sentences(diagnosis: Diagnosis) -> Iterator[str]:
    """Explain the column "gain" of `tables`: one sentence for all causes whose gain has the same meaning."""
    meanings: dict[str, list[str]] = {}
    for k, cause in enumerate(reported_causes(diagnosis), start=1):
        meanings.setdefault(meaning_of_gain(diagnosis, cause), []).append(str(k))
    for meaning, numbers in meanings.items():
        of = f" of {', '.join(numbers)}" if len(meanings) > 1 else ""
        yield f"gain{of}: {meaning}"


# --- printed ----------------------------------------------------------------------------------------------------------


def tables(diagnosis: Diagnosis) -> Iterator[Table]:
    """List the tables to print: the causes, and the errors by joint."""
    names, causes = names_of(diagnosis), reported_causes(diagnosis)
    if causes:
        headings: Row = (words_of(diagnosis.kind).one, "place", "size", "gain", "may also be")
        rows: list[Row] = [
            (
                f"{k}. {cause.where.effect}",
                names.places(cause),
                "see below" if cause.where.effect in (CONTACT, UNKNOWN) and not cause.changed else cause.size,
                percent_interval(cause.gain),
                ", ".join(dict.fromkeys(other.effect for other in cause.confusable_with)) or "-",
            )
            for k, cause in enumerate(causes, start=1)
        ]
        yield f"{diagnosis.finger}: {diagnosis.verdict}", headings, rows
    factor, unit = unit_of(diagnosis)
    words = words_of(diagnosis.kind)
    before, after = words.nominal_column, words.extended_column
    headings = ("joint", "no friction", before, after, f"{before}, test", f"{after}, test", "noise floor")
    yield f"error by joint, rms in {unit}", headings, error_rows(diagnosis, names, factor)


def error_rows(diagnosis: Diagnosis, names: Names, factor: float) -> list[Row]:
    """List the errors by joint, then for all joints if there are several."""
    columns = [
        diagnosis.bias_only_rms,
        diagnosis.nominal.train_rms,
        diagnosis.extended.train_rms,
        diagnosis.nominal.test_rms,
        diagnosis.extended.test_rms,
        diagnosis.noise_floor,
    ]
    rows = [
        (
            names.joint(j),
            *(rounded(factor * values[0]) if values else "–" for values in (c[j - 1 : j] for c in columns)),
        )
        for j in range(1, len(diagnosis.nominal.train_rms) + 1)
    ]
    if len(rows) > 1:
        rows.append(("all joints", *(rounded(factor * together(column)) for column in columns)))
    return rows


def lines(diagnosis: Diagnosis) -> Iterator[str]:
    """List the lines to print: verdict, error, causes, what is left, what cannot be distinguished, what to do next."""
    names = names_of(diagnosis)
    yield headline(diagnosis)
    yield error_sentence(diagnosis)
    for k, cause in enumerate(diagnosis.causes, start=1):
        yield f"  {k}. {at_place(cause.title, cause.where, names)}: {cause.size}"
        yield from (f"     {': '.join(sensor.words)}" for sensor in cause.sensors if sensor.is_off)
        if confusion := confusion_sentence(cause, names):
            yield f"     {confusion}"
    yield from own_gain_sentences(diagnosis)
    for sentence in (left_sentence(diagnosis), unknown_sentence(diagnosis)):
        if sentence:
            yield sentence
    if diagnosis.too_small:
        small = dict.fromkeys(at_place(each.title, each.where, names) for each in diagnosis.too_small)
        yield f"too small to matter: {'; '.join(small)}"
    for cause in diagnosis.undecided:
        less = f"gain {percent_interval(cause.gain)}"
        yield f"uncertain: {at_place(cause.title, cause.where, names)}, {less}; to decide: {cause.experiment}"
    yield from hidden_sentences(diagnosis, names)
    for event in diagnosis.events:
        yield f"left out: {Path(event.recording).name}, {event.start:.2f} to {event.end:.2f} s: {event.description}"
    yield f"next: {next_sentence(diagnosis)}"


def place_rows(cause: Cause, names: Names, sizes: Sequence[str]) -> list[tuple[str, str, str]]:
    """List (joint, tendon, size) of each place of a cause; `sizes` has the size at each."""
    return [
        (_at("joint", each, names), _at("tendon", each, names), size)
        for each, size in zip(cause.places, sizes, strict=True)
    ]


def _at(kind: str, place: CausePlace, names: Names) -> str:
    number, all_names = (place.joint, names.joints) if kind == "joint" else (place.tendon, names.tendons)
    if number is not None:
        return numbered(kind, number, all_names).removeprefix(f"{kind} ")
    return "all" if place.joint is None and place.tendon is None else "–"


def change_rows(cause: Cause, recordings: Sequence[str]) -> list[tuple[str, str]]:
    """List (when, main number with its 95 % interval): in the reference, then now or in each new recording."""
    changed = cause.changed
    if changed is None:
        return []
    now = zip(recordings, changed.by, strict=False) if changed.by else [("now", changed.now)]
    return [
        ("reference", quantity(changed.reference.value, changed.unit)),
        *((Path(name).name, _quantity_interval(each, changed.unit)) for name, each in now),
    ]


def _quantity_interval(interval: Interval, unit: str) -> str:
    low, high = (quantity(end, unit) for end in (interval.low, interval.high))
    return f"{quantity(interval.value, unit)} ({low} to {high})"
