"""A tendon's spring that is off, or the gain of its force sensor.

Positions show by how much more a tendon stretches than described under its measured force. A softer spring does this,
and so does a true force that is larger than the measured one. Only the latter scales the torque, by the same share.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.base import Base, find_base
from tendonfmu.diagnosis.effects import CALIBRATION, Place, Term, by_name
from tendonfmu.diagnosis.effects.mechanism import data_number
from tendonfmu.diagnosis.extension_fit import FitSettings
from tendonfmu.diagnosis.inputs import Input
from tendonfmu.diagnosis.kinematic_causes import KinematicCauses, find_kinematic_causes
from tendonfmu.diagnosis.result import Cause, CausePlace, Diagnosis
from tendonfmu.diagnosis.selection import CERTAIN, rms_gain
from tendonfmu.diagnosis.tendon_equation import SPRING, Off
from tendonfmu.model import extended_row, extension_rows

GAIN = by_name("force_gain")
OF_GAIN = (GAIN.name, CALIBRATION)
SAME = 0.5  # of the gain that positions show: how far that of the torque may be from it
ROUNDS = 3  # springs that are not linear show a gain only nearly


@dataclass(frozen=True)
class Beginning:
    """What a search begins with: the description with kinematics that are right, and a fitted base."""

    given: Input
    kinematic: KinematicCauses
    base: Base
    gains: Mapping[int, float] = field(default_factory=dict)  # true force over the measured one, less 1, by tendon

    @classmethod
    def of(
        cls, given: Input, settings: FitSettings, least_gain: float, seed: int, gains: Mapping[int, float] | None = None
    ) -> Beginning:
        """Find what is off in the kinematics, and fit a base; `gains` are those that explain springs."""
        gains = gains or {}
        softened = _softened(given, gains)
        kinematic = find_kinematic_causes(softened, least_gain, seed)
        corrected = kinematic.corrected(softened)
        terms = [(Term(GAIN, Place(tendon=i), {}, (gain,)),) for i, gain in gains.items()]
        base = find_base(corrected.finger, corrected.reference or corrected.whole, settings, least_gain, terms)
        return cls(corrected, kinematic, base, gains)

    def with_gains(self, given: Input, settings: FitSettings, least_gain: float, seed: int) -> Beginning:
        """Take each spring that is off as the gain of its force sensor where the torque is off by as much."""
        chosen = self
        for off in self.kinematic.off:
            if off.where.effect != SPRING or off.where.tendon is None or self.kinematic.is_change:
                continue
            gain = _gain_of(given, off, chosen.gains, least_gain, seed)
            if gain is None:
                continue
            other = Beginning.of(given, settings, least_gain, seed, {**chosen.gains, off.where.tendon: gain})
            if other._explains_more(chosen, off.where.tendon, least_gain):
                chosen = other
        return chosen

    def _explains_more(self, other: Beginning, tendon: int, least_gain: float) -> bool:
        """Return whether the torque confirms the gain at a tendon."""
        before, after = (each.base.left_unseen(each.base.model) for each in (other, self))
        gain, error = rms_gain(before, after)
        fitted = (extended_row(self.base.model.data, GAIN.name, Place(tendon=tendon)) or {}).get("correction", 0.0)
        shown = self.gains[tendon]
        return gain >= least_gain and gain > CERTAIN * error and abs(fitted - shown) <= SAME * abs(shown)

    # --- what is reported ---

    def is_confirmed(self, diagnosis: Diagnosis) -> bool:
        """Return whether all gains are among the causes that unseen data confirm."""
        named = {place.tendon for cause in diagnosis.causes if cause.effect in OF_GAIN for place in cause.places}
        return set(self.gains) <= named

    def in_diagnosis(self, diagnosis: Diagnosis) -> Diagnosis:
        """Return the diagnosis with the kinematic causes, and with the springs that gains only seem to soften."""
        causes = tuple(self._with_springs(cause, diagnosis.extended_data) for cause in diagnosis.causes)
        return self.kinematic.in_diagnosis(replace(diagnosis, causes=causes))

    def _with_springs(self, cause: Cause, extended: Data) -> Cause:
        def whole(place: CausePlace) -> CausePlace:
            if cause.effect not in OF_GAIN or place.tendon not in self.gains:
                return place
            path = f"tendons[{place.tendon}].stiffness"
            return replace(place, parameters={**place.parameters, path: (data_number(extended, path), "N/m")})

        return replace(cause, places=tuple(map(whole, cause.places)))


def _gain_of(given: Input, off: Off, others: Mapping[int, float], least_gain: float, seed: int) -> float | None:
    """Return the gain that makes the described spring of a tendon right; None if none does."""
    gain, spring = 0.0, off.number
    for _ in range(ROUNDS):
        gain = (1.0 + gain) * spring.described / spring.value - 1.0
        softened = _softened(given, {**others, off.where.tendon or 1: gain})
        found = find_kinematic_causes(softened, least_gain, seed)
        if off.where not in {each.where for each in found.off}:
            return gain
        spring = found.known[off.where].number
    return None


def _softened(given: Input, gains: Mapping[int, float]) -> Input:
    """Return the input with the springs that tendons seem to have, where each force is measured too small by a gain."""
    finger, values = given.finger, dict[str, float]()
    for tendon, gain in gains.items():
        values[f"tendons[{tendon}].stiffness"] = finger.data["tendons"][tendon - 1]["stiffness"] / (1.0 + gain)
        for k, row in enumerate(extension_rows(finger.data), start=1):
            if (row["effect"], row.get("tendon")) == (SPRING, tendon):
                values[f"extensions[{k}].hardening"] = row["hardening"] / (1.0 + gain)
    return given.of_finger(finger.replace(values)) if gains else given
