"""Replay of a measured flight next to the motion that its vehicle's model predicts from
the recorded commands.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from skyarm.log.motion import PoseSeries, PredictedMotion, distance_between
from skyarm.records.arrays import Array
from skyarm.records.immutable import positional
from skyarm.vehicle import Vehicle
from skyarm.view.picture.viser_sink import segments
from skyarm.view.studio.clock import Clock

RATE = 100
"""Rate (Hz) of stored pictures, more than a screen shows at any speed."""

SHOWN, CURVE = 20.0, 300
"""Number of horizons in a plot, and of points of its curves; fewer would hide returns
to the measured state."""

HORIZONS = (0.05, 5.0)
"""Shortest and longest horizon (s) of the page's slider."""

Predict = Callable[[float], PredictedMotion]
"""Function from a horizon (s) to the predicted motion, which restarts at the measured
state after each horizon."""


@positional
class PredictionError:
    """Error of a predicted motion against the measured flight at one instant.

    Attributes:
        time: s from the start of the flight.
        position: m. attitude: rad. NaN where nothing is predicted.
    """

    time: float
    position: float
    attitude: float


@positional
class ErrorCurves:
    """Errors of one prediction of a replay, for its live plots.

    Attributes:
        title: name of the prediction. replay: its replay. errors: (2, steps) position,
            m, and attitude, rad.
    """

    title: str
    replay: PredictionReplay
    errors: Callable[[], Array]

    def recent(self, seconds: float) -> Sequence[PredictionError]:
        """Errors of the last seconds, or of a few prediction horizons if these are
        shorter.
        """
        now = self.replay.tick
        errors = self.errors()
        count = round(min(seconds, SHOWN * self.replay.horizon) * RATE)
        every = -(-count // CURVE)
        # at multiples of the step, so that the curve stands still while it moves on
        rows = range(-(-max(0, now - count) // every) * every, now + 1, every)
        return [PredictionError(k / RATE, *errors[:, k].tolist()) for k in rows]


class PredictionReplay(Clock):
    """Playback of a measured flight and its prediction, both fully computed in advance.

    Args:
        title: name of the flight.
        vehicle: vehicle whose model predicts.
        measured: motion of the flight, at least RATE's period long.
        predict: the model's motion over any horizon.
        horizon: s, first one.
        warning: faults of the flight in words; empty without any.

    Attributes:
        predict: as given.
        measured, model: (steps,) motions at the pictures, on the flight's own clock.
        errors, held_errors: (2, steps) position, m, and attitude, rad, of the model,
            and of held velocity and rate.
        age: (steps,) s since the model was set back to the measured state.
    """

    def __init__(
        self,
        title: str,
        vehicle: Vehicle,
        measured: PoseSeries,
        predict: Predict,
        horizon: float,
        warning: str = "",
    ) -> None:
        super().__init__()
        self.title = title
        self.vehicle = vehicle
        self.predict = predict
        self.warning = warning
        start, end = float(measured.time[0]), float(measured.time[-1])
        # the last one may lie a rounding error behind the end
        self._times = np.minimum(
            start + np.arange(int((end - start) * RATE + 1e-6) + 1) / RATE, end
        )
        self.measured = measured.at(self._times)
        self.furthest = self.steps - 1
        self.show(self.predict(horizon), horizon)

    @property
    def rate(self) -> int:
        """Pictures per second (Hz) of the replay."""
        return RATE

    @property
    def steps(self) -> int:
        """Number of pictures of the replay."""
        return len(self._times)

    def show(self, predicted: PredictedMotion, horizon: float) -> None:
        """Replace the prediction by one with another horizon (s)."""
        self.horizon = horizon
        self.model = predicted.model.at(self._times)
        constant = predicted.held.at(self._times)
        self.errors = np.stack(distance_between(self.model, self.measured))
        self.held_errors = np.stack(distance_between(constant, self.measured))
        before = np.searchsorted(predicted.begins, self._times, "right") - 1
        # a picture before the first begin has index -1, which reads the NaN
        age = self._times - np.concatenate([predicted.begins, [np.nan]])[before]
        self.age: Array = np.where(np.isfinite(self.errors[0]), age, np.nan)

    @property
    def curves(self) -> tuple[ErrorCurves, ErrorCurves]:
        """Errors of two predictions for plots: of the model, and of constant velocity
        and rate.
        """
        return ErrorCurves("model", self, lambda: self.errors), ErrorCurves(
            "held", self, lambda: self.held_errors
        )

    def trails(self, seconds: float) -> tuple[Array, Array]:
        """Line segments (m) of the base's latest path, (N, 2, 3) each: measured, and
        predicted between resets.
        """
        rows = np.arange(max(0, self.tick - round(seconds * RATE)), self.tick + 1)
        measured = segments(self.measured.position[rows])
        # within one prediction the age rises, and falls where the next one begins
        own = np.diff(self.age[rows]) > 0.0
        return measured, segments(self.model.position[rows])[own]

    def advance(self, seconds: float) -> None:
        """Advance the replay by an elapsed wall-clock time (s); restart at the end."""
        if self.playing and self.at_end:
            self.go(0)
        super().advance(seconds)

    def reset(self) -> None:
        """Restart playback from the first frame."""
        super().reset()
        self.furthest = self.steps - 1


def mean_error(errors: Array) -> tuple[float, float]:
    """Root mean square errors in position (m) and attitude (rad) over the predicted
    instants; NaN without any.
    """
    finite = errors[:, np.isfinite(errors).all(axis=0)]
    position, attitude = (
        np.sqrt((finite**2).mean(axis=1)).tolist() if finite.size else (np.nan, np.nan)
    )
    return position, attitude
