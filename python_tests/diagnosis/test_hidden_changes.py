"""What has changed since a reference: fingers of numpy, recorded twice with a number changed, or with none."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import lru_cache
from importlib.resources import files as files_of
from pathlib import Path

import jsonschema
import pytest

from command import Call
from repetitions import repeated
from tendonfmu.diagnosis.diagnosis import diagnose
from tendonfmu.diagnosis.result import Cause, Diagnosis
from tendonfmu.model import native
from worn_finger import WELL, How, Worn, finger, record, recording, write_files

SCHEMA = json.loads((files_of("tendonfmu") / "schema" / "diagnosis.schema.json").read_text("utf-8"))
THEN = How(motion=2, noise=1)
OTHER = How(motion=5, noise=2)
REPEAT = replace(THEN, noise=2)
DRIER = replace(WELL, dry=1.3 * WELL.dry)
HUMMING = replace(WELL, hum=0.006)
BOTH = replace(WELL, dry=1.4 * WELL.dry, cover=1.5 * WELL.cover)
GROWING = tuple(replace(WELL, dry=share * WELL.dry) for share in (1.1, 1.25, 1.4))


@lru_cache
def changes(now: Worn = WELL, how: How = OTHER, then: Worn = WELL, test: Worn | None = None) -> Diagnosis:
    """Of one new recording, and of a test of another motion where a finger for it is given."""
    tests = [] if test is None else [recording(record(test, motion=6, noise=3), "test.parquet")]
    return diagnose(
        finger(),
        [recording(record(now, how))],
        tests,
        reference=[recording(record(then, THEN), "then.parquet")],
        kinematics=3,
    )


def names(cause: Cause) -> set[str]:
    """What the recordings cannot tell apart."""
    return {cause.where.effect, *(each.effect for each in cause.confusable_with)}


# --- nothing changed --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "how", repeated([pytest.param(OTHER, id="other motion"), pytest.param(REPEAT, id="exact repeat")], 0)
)
def test_nothing_is_named_where_nothing_has_changed(how: How) -> None:
    found = changes(how=how)
    assert (found.kind, found.verdict, found.causes, found.load) == ("change", "adequate", (), None)
    assert found.gain.value == 0.0 and found.extended == found.nominal
    assert found.extended_data == found.nominal_data and not found.unexplained.unknown
    assert found.repeated == int(how == REPEAT)
    assert not any("can be compared" in text for text in found.warnings)  # of 60 s
    assert found.references == ("then.parquet",) and found.recordings == ("now.parquet",)


@pytest.mark.long
@pytest.mark.slow
def test_what_is_wrong_in_both_is_not_blamed() -> None:
    """A torque that no effect describes, as large as half of the friction. The model errs by it in both recordings."""
    quiet, humming = changes(), changes(now=HUMMING, then=HUMMING)
    assert humming.nominal.test_rms[0] > 1.5 * quiet.nominal.test_rms[0]
    assert (humming.verdict, humming.causes) == ("adequate", ())


@pytest.mark.long
def test_a_change_is_named_beside_what_is_wrong_in_both() -> None:
    (cause,) = changes(now=replace(HUMMING, dry=DRIER.dry), then=HUMMING).causes
    assert cause.where.effect == "joint_friction" and cause.changed is not None
    assert cause.changed.now.value / cause.changed.reference.value == pytest.approx(1.3, abs=0.05)


# --- numbers of the description ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("now", "how", "effect", "place", "number", "then", "size"),
    repeated(
        [
            (DRIER, OTHER, "joint_friction", (1, None), "coulomb", 0.012, 0.0036),
            (replace(WELL, dry=0.0084), OTHER, "joint_friction", (1, None), "coulomb", 0.012, -0.0036),
            (replace(WELL, edge=(0.039, 0.03)), REPEAT, "edge_friction", (1, 1), "coulomb", 0.03, 0.009),
            (replace(WELL, cover=0.039), OTHER, "cover_stiffness", (1, None), "stiffness", 0.03, 0.009),
        ],
        2,
    ),
    ids=["friction grows", "friction falls", "edge grows", "cover stiffens"],
)
def test_a_number_that_changed_by_30_percent_is_named_with_its_size(
    now: Worn, how: How, effect: str, place: tuple[int, int | None], number: str, then: float, size: float
) -> None:
    """Its size then: within 15 %, since friction of the joint and of two edges is hard to share out in 24 s. The
    change: within 5 %, and in its interval."""
    found = changes(now=now, how=how)
    assert found.verdict in ("explained", "partly explained") and found.gain.value > 0.0
    cause = found.causes[0]
    assert (cause.where.effect, cause.where.joint, cause.where.tendon) == (effect, *place)
    told = cause.changed
    assert told is not None and told.number == number
    assert told.reference.value == pytest.approx(then, rel=0.15)
    assert told.change.value == pytest.approx(size, rel=0.05)
    assert told.change.low <= size <= told.change.high
    assert told.now.value == pytest.approx(told.reference.value + told.change.value)
    assert cause.p_value < 0.01 and 0.0 < cause.gain.low < cause.gain.value < cause.gain.high
    native.image_from_json(json.dumps(found.extended_data))
    (path,) = [each for each in cause.parameters if each.endswith(number)]
    assert cause.parameters[path][0] == pytest.approx(told.now.value)


@pytest.mark.long
def test_a_term_that_the_description_lacks_was_0() -> None:
    found = changes(now=replace(WELL, mass=0.02))
    (cause,) = found.causes
    assert (cause.where.effect, cause.where.joint) == ("gravity", 1) and cause.changed is not None
    assert cause.changed.reference.value == 0.0
    assert cause.changed.now.low <= 0.02 <= cause.changed.now.high
    assert cause.changed.change == cause.changed.now
    *known, last = found.extended_data["extensions"]
    assert known == found.nominal_data["extensions"] and last["effect"] == "gravity"
    assert math.hypot(last["sine"], last["cosine"]) == pytest.approx(cause.changed.now.value)


@pytest.mark.long
@pytest.mark.slow
def test_two_changes_at_once_have_a_size_each() -> None:
    found = changes(now=BOTH)
    sizes = {each.where.effect: each.changed for each in found.causes}
    assert set(sizes) == {"joint_friction", "cover_stiffness"}
    for effect, true in (("joint_friction", 0.4 * WELL.dry), ("cover_stiffness", 0.5 * WELL.cover)):
        told = sizes[effect]
        assert told is not None and told.change.low <= true <= told.change.high
    gains = [each.gain.value for each in found.causes]
    assert gains == sorted(gains, reverse=True) and len(found.steps) == 3


# --- several recordings -----------------------------------------------------------------------------------------------


@lru_cache
def growing(order: tuple[int, ...] = (0, 1, 2), seed: int = 0) -> Diagnosis:
    """Three new recordings of 16 s, each drier than the one before, given in an order: the motion of the first of two
    references made again."""
    now = [recording(record(worn, motion=2, noise=k, seconds=16.0), f"{k}.pq") for k, worn in enumerate(GROWING)]
    then = [recording(record(WELL, motion=2 + k, noise=9 + k, seconds=16.0), f"then_{k}.pq") for k in range(2)]
    then = then if order[0] == 0 else then[::-1]
    return diagnose(finger(), [now[k] for k in order], reference=then, kinematics=3, seed=seed)


@pytest.mark.long
def test_several_recordings_show_how_it_grows() -> None:
    (cause,) = growing().causes
    assert cause.where.effect == "joint_friction" and cause.changed is not None
    by = cause.changed.by
    assert len(by) == 3 and by[0].high < by[1].low and by[1].high < by[2].low
    for own, worn in zip(by, GROWING, strict=True):
        grown = own.value - cause.changed.reference.value
        assert grown == pytest.approx(worn.dry - WELL.dry, abs=0.03 * WELL.dry)


# --- unseen recordings ------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize(
    ("test", "named"), repeated([(DRIER, ["joint_friction"]), (WELL, [])], 1), ids=["drier", "well"]
)
def test_a_test_recording_judges(test: Worn, named: list[str]) -> None:
    """A change that the test does not show is not named: the finger of that recording is well."""
    found = changes(now=DRIER, test=test)
    assert [each.where.effect for each in found.causes] == named
    assert found.tests == ("test.parquet",) and not found.held_out
    assert found.gain.value >= 0.0 and (found.gain.value > 0.3) == bool(named)
    if not named:
        assert "joint_friction" in {effect for each in found.uncertain for effect in names(each)}


# --- the command ------------------------------------------------------------------------------------------------------


def test_the_command_writes_what_has_changed(call: Call, tmp_path: Path) -> None:
    write_files(tmp_path, then=record(WELL, THEN), now=record(DRIER, OTHER))
    words = "diagnose finger.json now.parquet --reference then.parquet --kinematics 3 -o out"
    answer = call(*words.split())
    assert answer.status == 0, answer.err
    report = json.loads(Path("out/diagnosis.json").read_text(encoding="utf-8"))
    jsonschema.validate(report, SCHEMA)
    assert report["kind"] == "change" and report["references"] == ["then.parquet"]
    first = report["causes"][0]
    assert (first["effect"], first["number"]) == ("joint_friction", "coulomb")
    assert first["now"] / first["reference"] == pytest.approx(1.3, abs=0.05)
    assert first["now_interval"][0] < first["now"] < first["now_interval"][1]
    assert first["change"]["value"] == pytest.approx(first["now"] - first["reference"])
    for name in ("nominal.json", "extended.json"):
        assert call("check", f"out/{name}").status == 0
