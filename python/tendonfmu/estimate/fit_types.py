"""The report of a fit as JSON has it, "tendonfmu-fit-1"."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypedDict

from tendonfmu.json_types import Count, Index, Number, Schema, Size, Values
from tendonfmu.recordings import Nis, RecordingEntry, RoutingEntry, Whiteness

if TYPE_CHECKING:
    from typing_extensions import NotRequired


class FittedNumber(TypedDict):
    path: str
    unit: str
    start: float
    value: float
    standard_error: Size | None
    # Whether the standard error is at most 30 % of the value and half of what was known before.
    identified: bool
    at_bound: Annotated[str, Schema(enum=["lower", "upper"])] | None
    reason: (
        Annotated[str, Schema(enum=["side", "working_point", "slow", "noise", "combination", "never_moves", "kept"])]
        | None
    )
    explanation: str | None
    advice: str | None  # Motion, load or option that would identify the number.


class Correlation(TypedDict):
    paths: list[str]  # Paths of the unknowns: .drop is static - coulomb, .rate is 1/stribeck_velocity.
    standard_errors: list[Size | None]  # Standard errors of the unknowns.
    matrix: list[list[Annotated[float, Schema(minimum=-1.001, maximum=1.001)]]]


class GivenNumbers(TypedDict):
    """What became of the numbers that the fit was given."""

    start: Annotated[str, Schema(enum=["guessed", "estimated"])]  # estimated: they are the prior.
    kept: bool  # Whether all of them are kept, because fitted ones need not do better.
    moved: Count  # Values that moved by more than their standard error.
    stayed: list[str]  # Paths of the others.
    paragraph: str  # The same in words, with the reasons.


class MemoryEntry(TypedDict):
    angles: str  # Source of the joint angles that the numbers were fitted to.
    left: Values  # N.m by joint; rms without a learning bias, with these angles.
    left_delivered: Values  # N.m by joint; the same with the kinematics of the delivered finger.
    left_out: list[str]  # Paths of the numbers that the motion does not show.


class Identified(TypedDict):
    count: Count
    of: Index


class ResidualRms(TypedDict):
    """N.m by joint, before the bias learns from the sample."""

    rms: Values
    start_rms: Values
    bias_only_rms: Values
    model_only_rms: Values
    torque_rms: Values


class Comparison(RecordingEntry):
    """A recording to compare with, and its residuals as those of the training."""

    label: str
    rms: NotRequired[Values]
    start_rms: NotRequired[Values]
    bias_only_rms: NotRequired[Values]
    model_only_rms: NotRequired[Values]
    torque_rms: NotRequired[Values]


class Residual(TypedDict):
    train: ResidualRms
    held_out: ResidualRms | None
    comparisons: list[Comparison]


class Effective(TypedDict):
    """By joint: samples trained on, and the number of independent samples that they are worth."""

    samples: list[float]
    worth: list[float]


class Innovations(TypedDict):
    nis: Nis
    whiteness: Whiteness
    effective: Effective


class FitReport(TypedDict):
    """Report of `tendonfmu fit --report`. SI units; null stands for a value that is not a number."""

    format: Literal["tendonfmu-fit-1"]
    finger: str  # Name of the finger.
    method: Annotated[str, Schema(enum=["batch", "ekf"])]
    converged: bool
    finished: Literal[True]
    iterations: Count
    passes: Count  # Passes over the data, coarse ones included.
    seconds: Size  # s; time of the estimation.
    cost: Number  # Half the sum of the squared standardised innovations, plus the part of the prior.
    options: Mapping[str, Any]
    warnings: list[str]
    recordings: Annotated[list[RecordingEntry], Schema(minItems=1)]
    parameters: Annotated[list[FittedNumber], Schema(minItems=1)]
    correlation: Correlation
    routing: NotRequired[RoutingEntry | None]
    given_numbers: NotRequired[GivenNumbers]
    memory: NotRequired[MemoryEntry | None]  # How friction that remembers (presliding) was fitted; null without it.
    identified: Identified
    residual: Residual
    innovations: Innovations
