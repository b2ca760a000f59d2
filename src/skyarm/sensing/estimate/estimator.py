"""Interface of estimators, which turn the sensors' readings into the measurement of the
control law.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from skyarm.algebra import Scalar
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.actuators.drive import Drive
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree
from skyarm.sensing.measurement import Measurement
from skyarm.sensing.sensor import Sensor
from skyarm.vehicle import Vehicle

FULL_STATE = "state"
"""Name of the reading of every scenario: the full state with the noise of
``[sensors]``."""


class Estimator:
    """Base class of estimators, which compute the measurement of the control law from
    all sensor readings.

    A subclass is a frozen dataclass of numbers with pure, traceable functions.
    """

    __slots__ = ()

    registered_as = "estimator"

    reads_state: ClassVar[bool] = True
    """False if the measurement does not follow from the full state, so that laws
    predict over no delay of that."""

    @property
    def on_board(self) -> Any:
        """Estimator that an exported C file contains; None if the exported law receives
        the full state instead.
        """
        return None

    def believing(self, vehicle: Vehicle, gravity: Scalar) -> Estimator:
        """Estimator that uses the given nominal vehicle and gravity (m/s^2) as its
        model.

        The loop steps what this returns.
        """
        return self

    def placing(self, sensors: Mapping[str, Sensor]) -> Estimator:
        """Estimator with the places and angles of the sensors (by name), unless its own
        table states them.
        """
        return self

    def require_sensors(
        self, sensors: Mapping[str, Sensor], rate: float, vehicle: Vehicle
    ) -> None:
        """Refuse sensors that the estimator cannot use.

        Args:
            sensors: all but the full state, by name.
            rate: control periods a second.
            vehicle: nominal one, of the controller's model.

        Raises:
            ValueError: one line with field, value and what is allowed.
        """

    def require_torques(self, vehicle: str, drives: Mapping[str, Drive]) -> None:
        """Refuse joint drives whose efforts the estimator cannot predict; ``vehicle``
        is the name in the message.
        """

    def start(self, vehicle: Vehicle) -> Tree:
        """Initial internal state, a dataclass or tuple of scalars; ``vehicle`` is the
        controller's model.
        """
        return ()

    def step(
        self, memory: Any, readings: Mapping[str, Any], command: Command, dt: float
    ) -> tuple[Tree, Measurement]:
        """Return the next internal state and the measurement of the control law, once
        per control period.

        Args:
            memory: internal state after the last period.
            readings: arrived readings by the sensor's name; a slow sensor's reading
                stays until its next.
            command: the one that acts now.
            dt: control period, s.
        """
        raise NotImplementedError(f"{type(self).__name__} must define step()")


@immutable
class PassThrough(Estimator):
    """Estimator that passes the full-state reading to the control law unchanged."""

    def step(
        self, memory: Any, readings: Mapping[str, Any], command: Command, dt: float
    ) -> tuple[Tree, Measurement]:
        """Return the full-state reading as the measurement, and the internal state
        unchanged.
        """
        return memory, readings[FULL_STATE]


PASS_THROUGH = PassThrough()
