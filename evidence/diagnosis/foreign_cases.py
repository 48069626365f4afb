"""Numbered cases of fingers that share no code with the product; seen.py runs them beside those by seed."""

from __future__ import annotations

from evidence.diagnosis.case import Case
from evidence.fingers import foreign
from evidence.fingers.families import module_of
from evidence.judge import SYNONYMS, Truth

VISIBLE = 0.1  # of the residual's variance: README of the recorded cases

# Effects that refitting the description's own numbers takes up, so that less than VISIBLE of the residual's variance is
# left to see. Not naming them is right, naming them is right too; a wrong name counts as false as anywhere.
ABSORBED = (
    "inertia",  # slow motion: a share of a mN·m, within the friction's own misfit (README of the recorded cases)
    "force_gain",  # a gain scales the friction of its tendon, and so do the laws (README of the recorded cases)
    "asymmetric_friction",  # the slow bias takes the mean of both directions (README of the recorded cases)
    "moment_arm",  # co-contraction makes it a nearly constant torque (README of the recorded cases)
    "force_offset",  # a constant torque and a constant angle: the bias and the covers' rest angles take them
)


def is_outside(truth: foreign.Truth) -> bool:
    """Whether what is hidden is on no list."""
    return truth.hidden.startswith("unknown")


def is_absorbed(truth: foreign.Truth) -> bool:
    return truth.hidden in ABSORBED or (truth.survives is not None and truth.survives < VISIBLE)


def truth_of(truth: foreign.Truth) -> Truth:
    """What counts. Presliding is right in every case: no simulator's friction jumps as the paper's laws do; and what is
    on no list may look like a contact."""
    listed = truth.hidden != "none" and not is_outside(truth)
    return Truth(
        effects=(truth.hidden,) if listed else (),
        joint=truth.joint,
        tendon=truth.tendon,
        allowed=(*truth.also, "contact") if is_outside(truth) else truth.also,
        neutral=("presliding", "unknown"),
        synonyms=SYNONYMS,
        visible=not is_absorbed(truth),
    )


def make(family: str, number: int, train: float = foreign.TRAIN_SECONDS, test: float = foreign.TEST_SECONDS) -> Case:
    """The case of that number, whose seed is its own; joint angles are left unused. Recorded ones are what they are."""
    module = module_of(family)
    made = module.make(number) if family == "recorded" else module.make(number, train, test)
    truth = made.truth
    return Case(
        family,
        made.nominal,
        [made.train],
        truths=(truth_of(truth),),
        test=[made.test],
        facts={
            "family": family,
            "hidden": {"effect": truth.hidden, "joint": truth.joint, "tendon": truth.tendon},
            "hidden_rms": truth.rms,
            "visible_rms": None,
        },
    )
