"""Pause of the path governor: error bounds beyond which the reference's time slows, down to a stop."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

from skyarm.algebra.scalars import Scalar, clip, divide, minimum
from skyarm.records.coerce import RecordError, concrete
from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit


@dataclass(frozen=True, kw_only=True, slots=True)
class PathPause:
    """Bounds of a pause; within them the reference keeps its rate.

    Attributes:
        error: m, of the tip from where the law is led; at twice that the reference stands still.
        thrust: share of its largest thrust that a rotor may be asked for; at 1 the reference stands still.
        acceleration: 1/s, the largest change of the rate.
    """

    error: Annotated[Scalar, Unit("m", "of the tip", low=0.0, infinite=True)] = math.inf
    thrust: Annotated[Scalar, Unit("", "share of a rotor's largest", low=0.0, infinite=True)] = math.inf
    acceleration: Annotated[Scalar, Unit("1/s", "largest change of the rate", low=0.0, strict=True)] = 0.5

    def __post_init__(self) -> None:
        accept_fields(self, "reference.governor.pause")
        for name in ("error", "thrust"):
            if concrete(getattr(self, name)) and getattr(self, name) == 0.0:
                raise RecordError(f"reference.governor.pause.{name} = 0: must be above 0")
        if concrete(self.thrust) and 1.0 <= self.thrust < math.inf:
            raise RecordError(f"reference.governor.pause.thrust = {self.thrust!r}: must be below 1, or infinite")

    @property
    def is_active(self) -> bool:
        """True if it bounds anything."""
        return not all(isinstance(each, float) and math.isinf(each) for each in (self.error, self.thrust))

    def rate(self, error: Any, thrust: Any) -> Any:
        """The rate that the reference's time is to have, 0 to 1.

        Args:
            error: m, of the tip.
            thrust: the largest share of a rotor.
        """
        found: Any = 1.0
        if not (isinstance(self.error, float) and math.isinf(self.error)):
            found = minimum(found, 2.0 - divide(error, self.error))
        if not (isinstance(self.thrust, float) and math.isinf(self.thrust)):
            found = minimum(found, divide(1.0 - thrust, 1.0 - self.thrust))
        return clip(found, 0.0, 1.0)
