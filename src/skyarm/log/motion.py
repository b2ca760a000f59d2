"""Motion of a vehicle over time: poses, joint positions, their predictions, and
distances between motions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skyarm.algebra.frames import continuous, unit_rows
from skyarm.records.arrays import Array, lengths
from skyarm.records.immutable import immutable


@immutable(eq=False)
class PoseSeries:
    """Poses of the base and positions of the joints over time.

    Attributes:
        time: (N,) s, not falling; of two rows at one time the later one holds from
            there on.
        position: (N, 3) m, world axes. quaternion: (N, 4) w x y z, base to world.
        joints: (N, n) rad or m. Rows of NaN are times without a known pose.
    """

    time: Array
    position: Array
    quaternion: Array
    joints: Array

    def at(self, time: Array) -> PoseSeries:
        """Interpolate the motion linearly at given times (s); NaN outside its time
        range.
        """
        # the last row begins no step: at its time the step before it is at its end
        rows = np.clip(
            np.searchsorted(self.time, time, "right") - 1, 0, max(len(self.time) - 2, 0)
        )
        after = np.minimum(rows + 1, len(self.time) - 1)
        step = self.time[after] - self.time[rows]
        share = np.where(
            step > 0.0, (time - self.time[rows]) / np.where(step > 0.0, step, 1.0), 1.0
        )[:, None]
        # outside the motion nothing is known, so nothing is extrapolated
        outside = (time < self.time[0]) | (time > self.time[-1])

        def interpolate(values: Array) -> Array:
            # the row itself at its own time, whatever follows it
            mixed = np.where(
                share > 0.0,
                values[rows] + share * (values[after] - values[rows]),
                values[rows],
            )
            mixed[outside] = np.nan
            return np.asarray(mixed)

        return PoseSeries(
            time=time,
            position=interpolate(self.position),
            # linear interpolation shortens a quaternion
            quaternion=unit_rows(interpolate(continuous(self.quaternion))),
            joints=interpolate(self.joints),
        )


@immutable(eq=False)
class PredictedMotion:
    """Motions predicted by a vehicle model and by constant velocity, reset to the
    measured state at the same instants.

    Attributes:
        model: of a vehicle's model under the recorded commands.
        held: with the velocity and rate that were measured when it was set back.
        begins: (K,) s, instants at which both are set back, rising.
    """

    model: PoseSeries
    held: PoseSeries
    begins: Array


# a row of NaN behind each part keeps two flights from being joined by a line
def join_motions(motions: Sequence[PoseSeries]) -> PoseSeries:
    """Join successive motions to one, with unknown poses (NaN) between them."""
    parts = {
        name: list[Array]() for name in ("time", "position", "quaternion", "joints")
    }
    for motion in motions:
        for name, pieces in parts.items():
            values: Array = getattr(motion, name)
            # a row of NaN after each motion breaks a drawn line there
            pieces += [
                values,
                (
                    values[-1:]
                    if name == "time"
                    else np.full((1, values.shape[1]), np.nan)
                ),
            ]
    return PoseSeries(
        **{name: np.concatenate(pieces) for name, pieces in parts.items()}
    )


def distance_between(one: PoseSeries, other: PoseSeries) -> tuple[Array, Array]:
    """Distance (m) and rotation angle (rad) between the bases of two motions, (K,)
    each, at the same times.
    """
    apart = lengths(one.position - other.position)
    # q and -q are one attitude
    same = np.abs((one.quaternion * other.quaternion).sum(axis=1))
    return apart, 2.0 * np.arccos(np.minimum(same, 1.0))
