"""The world of a flight as it is filmed: where its bodies are at the frames, and the forces of contact."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from skyarm.contact import Contact
from skyarm.drawing.carried_poses import CarriedPoses, logged_poses
from skyarm.drawing.moving_poses import moving_poses
from skyarm.drawing.touch_arrows import TouchArrow, touch_arrows
from skyarm.drawing.world_shapes import PATCH
from skyarm.film.read_log import continuous, end_of, read
from skyarm.log.flight_log import Log
from skyarm.vehicle.vehicle_records import Vehicle

Array = npt.NDArray[np.float64]

NOTHING: Array = np.zeros((0, 0))
"""What a log has of what there is not."""

WIDEST = 6.0
"""m of way beyond which the patch of a plane grows no more."""


def patch_about(tip: Array) -> float:
    """Half the width of the patch that stands for a plane, m: a metre more than the tip goes, up to a point."""
    finite = tip[np.isfinite(tip).all(axis=1)]
    way = float(np.ptp(finite, axis=0).max()) if len(finite) else 0.0
    return PATCH + 0.5 * min(way, WIDEST)


def carried_at(log: Log, contacts: Sequence[Contact], times: Array) -> CarriedPoses:
    """Free objects and mechanisms at the frames."""
    count = log.object_quaternion.shape[1] // 4
    turns = [continuous(log.object_quaternion[:, 4 * i : 4 * i + 4]) for i in range(count)]
    turned = np.concatenate([read(log.time, each, times) for each in turns], axis=1) if turns else NOTHING
    places, coordinates = (
        read(log.time, each, times) if each.size else NOTHING for each in (log.object_position, log.mechanism_position)
    )
    return logged_poses(contacts, places, turned, coordinates)


def touches_at(
    log: Log, vehicle: Vehicle, contacts: Sequence[Contact], times: Array, carried: CarriedPoses
) -> Iterator[TouchArrow]:
    """Contact forces at the frames, at the places that the bodies have then."""
    if not log.contact_force.size:
        return
    begin = 0
    where = (read(log.time, each, times) for each in (log.position, continuous(log.quaternion), log.joints))
    poses = moving_poses(vehicle, *where)
    for contact in contacts:
        end = begin + contact.logged_pairs
        force = read(log.time, log.contact_force[:, begin:end], times)
        force = np.where(times[:, None] < end_of(log), force, 0.0)
        yield from touch_arrows(contact, vehicle, poses, times, force, carried)
        begin = end
