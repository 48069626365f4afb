"""How a friction law is added where the description has none."""

from __future__ import annotations

from collections.abc import Mapping

from tendonfmu.arrays import Data
from tendonfmu.diagnosis.effects.candidate import Column, Variant
from tendonfmu.diagnosis.effects.description_edit import ABSENT, Edit, magnitudes_of
from tendonfmu.estimate import get_number
from tendonfmu.model import DEFAULTS

# ordinary Coulomb friction: share of the tendon force, N·m in a joint, N·m per N of load
_ORDINARY = {"edge_friction": 0.02, "pulley_friction": 0.02, "friction": 0.005, "load_friction": 1e-4}
_SLOW_SHARE = 0.3  # of the Coulomb friction: viscous friction at 100 times the threshold of motion


def absent_law(data: Data, path: str, shape: Mapping[str, float]) -> Variant:
    """Return the law at a path as a variant: Coulomb and viscous friction, both at least 0."""
    kind = path.rsplit(".", 1)[1].split("[")[0]
    coulomb = _ORDINARY[kind]
    speed = 100 * DEFAULTS[f"velocity_threshold.{'tendon' if path.startswith('tendons') else 'joint'}"]
    columns = (
        Column({f"{path}.coulomb": 1.0}, 1, coulomb),
        Column({f"{path}.viscous": 1.0}, 1, _SLOW_SHARE * coulomb / speed),
    )
    return Variant(data, shape, columns, (Edit(ABSENT, path),))


def law_shares(data: Data, path: str) -> dict[str, float]:
    """Return the direction in which all magnitudes of the law at a path grow by the same share."""
    law = get_number(data, path)
    shares: dict[str, float] = {}
    for side in ("",) if law.get("positive") is None else ("positive", "negative"):
        at = f"{path}.{side}" if side else path
        coulomb, drop, viscous = magnitudes_of(law[side] if side else law)
        shares[f"{at}.coulomb"] = coulomb
        shares |= {f"{at}.static": drop} if drop else {}
        shares |= {f"{at}.viscous": viscous} if viscous else {}
    return shares
