"""A log read at other instants than its own."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from skyarm.log.flight_log import Log

Array = npt.NDArray[np.float64]


def end_of(log: Log) -> float:
    """When the last control period of a flight is over, s."""
    return float(log.time[-1] + (log.time[1] - log.time[0] if log.time.size > 1 else 0.0))


def read(time: Array, values: Array, times: Array) -> Array:
    """Columns (N, k) at other instants, (F, k)."""
    columns = [np.interp(times, time, column) for column in values.T]
    return np.stack(columns, axis=1) if columns else np.zeros((len(times), 0))


def continuous(quaternion: Array) -> Array:
    """The same attitudes with signs that do not jump, so that they can be read between two instants."""
    same = np.einsum("ni,ni->n", quaternion[1:], quaternion[:-1]) >= 0.0
    sign = np.concatenate([[1.0], np.cumprod(np.where(same, 1.0, -1.0))])
    return np.asarray(quaternion * sign[:, None], dtype=float)
