"""A flight as it is filmed: its log read at the instants of the frames."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.algebra import Vec3
from skyarm.contact import Contact
from skyarm.files import shown
from skyarm.log.flight_log import Log
from skyarm.reference.tip_motion import TipPush
from skyarm.vehicle.vehicle_records import Vehicle
from skyarm.view.figures.flight_facts import flight_labels, wanted_push
from skyarm.view.film.film_settings import FilmSettings
from skyarm.view.scene.poses import body_poses
from skyarm.view.scene.shapes import Shape, Solid
from skyarm.view.scene.vehicle_shapes import payload_shape
from skyarm.view.scene.world_shapes import (
    PATCH,
    CarriedPoses,
    TouchArrow,
    ground_height,
    logged_poses,
    point_shapes,
    touch_arrows,
    world_shapes,
)

Array = npt.NDArray[np.float64]
Color = tuple[float, float, float]

COLORS: tuple[Color, ...] = (
    (0.835, 0.369, 0.0),
    (0.0, 0.447, 0.698),
    (0.0, 0.620, 0.451),
    (0.8, 0.475, 0.655),
    (0.45, 0.35, 0.75),
    (0.35, 0.35, 0.35),
)
"""Red, green, blue from 0 to 1 by the flight's place; the first four are Okabe and Ito's, told apart by colour-blind
eyes."""

MOST_FLIGHTS = len(COLORS)


READ = (
    "position",
    "joints",
    "position_reference",
    "joints_reference",
    "tip",
    "tip_reference",
    "wind_force",
    "air_velocity",
    "tilts",
)
"""Arrays of a log that a film reads as they are."""

WIDEST = 6.0
"""m of way beyond which the patch of a plane grows no more."""


@dataclass(frozen=True, kw_only=True)
class FilmedFlight:
    """One flight at F instants; world axes, SI units, radians.

    Attributes:
        label: name in the picture. color: of the vehicle, its trail and its curve.
        vehicle: the plant's.
        position (F, 3), quaternion (F, 4) wxyz, joints (F, n): of the plant.
        desired_position (F, 3), desired_quaternion (F, 4), desired_joints (F, n): the continuous reference, level.
        tip, desired_tip: (F, 3) m. force: (F, 3) N of the wind. air: (F, 3) m/s, velocity of the air.
        error: (F,) m, distance of the tip from its reference; across the believed normal while it shall press.
        error_time, error_curve: (N,) s and m, the same at every control instant.
        contact: (F,) N, sum of all normal forces on the vehicle, or of its grips; None without a world.
        contact_curve, wanted_curve: (N,) N, the same, and the force that the reference asks for; the second one None
            where it asks for none.
        tilts: (F, rotors that tilt) rad; without columns where none does.
        loads: payloads that are taken or left on the way, where they are held and lie.
        surfaces: of the world, but for its ground. ground: height of that, m. points: marks of what may touch them.
        touches: contact forces.
        end: s; from then on the vehicle stays where it was. lost: why it ended early, in words; empty for a whole
            flight.
    """

    label: str
    color: Color
    vehicle: Vehicle
    position: Array
    quaternion: Array
    joints: Array
    tilts: Array
    desired_position: Array
    desired_quaternion: Array
    desired_joints: Array
    tip: Array
    desired_tip: Array
    force: Array
    air: Array
    error: Array
    error_time: Array
    error_curve: Array
    end: float
    lost: str
    loads: tuple[Solid, ...] = ()
    surfaces: tuple[Solid, ...] = ()
    contact: Array | None = None
    contact_curve: Array | None = None
    wanted_curve: Array | None = None
    ground: float = 0.0
    points: tuple[Shape, ...] = ()
    touches: tuple[TouchArrow, ...] = ()


def frame_times(logs: Sequence[Log], settings: FilmSettings) -> Array:
    """Instants of the frames, s of flight, up to the end of the longest flight.

    Raises:
        ValueError: a log has no instants, or none is left of them all.
    """
    for log in logs:
        if not log.time.size:
            raise ValueError(f"log = {log.info.get('scenario')!r}: must hold at least one control instant to be filmed")
    longest = max(map(end_of, logs))
    stop = longest if settings.stop is None else min(settings.stop, longest)
    count = round((stop - settings.start) * settings.fps / settings.speed)
    if count < 1:
        raise ValueError(f"start = {settings.start:g}: must leave at least one frame before the end, {stop:g} s")
    return np.asarray(settings.start + np.arange(count) * (settings.speed / settings.fps), dtype=float)


def film_flights(logs: Sequence[Log], times: Array, labels: Sequence[str] | None = None) -> list[FilmedFlight]:
    """Flights as they are filmed, each with its name and colour.

    Raises:
        ValueError: too many flights or labels, or a log that does not tell its vehicle.
    """
    if not 1 <= len(logs) <= MOST_FLIGHTS:
        raise ValueError(f"flights = {len(logs)}: must be from 1 to {MOST_FLIGHTS} in one film")
    names = flight_labels(logs) if labels is None else list(labels)
    if len(names) != len(logs):
        raise ValueError(f"labels = {shown(names)}: must be as many as the flights, {len(logs)}")
    return [film_flight(log, name, color, times) for log, name, color in zip(logs, names, COLORS, strict=False)]


def _contact(log: Log) -> Array | None:
    """Sum of the normal forces on the vehicle, or where nothing touches, of its grips, N; None without a world."""
    if not log.contact_force.size:
        return None
    found: Array = np.asarray(log.contact_force.sum(axis=1))
    return np.asarray(log.gripper_force.sum(axis=1)) if log.gripper_force.size and not found.any() else found


def film_flight(log: Log, label: str, color: Color, times: Array) -> FilmedFlight:
    """Read a log at the instants of the frames, linearly between its own; after its end it stays as it was.

    Raises:
        ValueError: the log does not tell its vehicle.
    """
    scenario = log.scenario
    vehicle, contacts = scenario.plant.vehicle, scenario.worlds
    carried = carried_at(log, contacts, times)
    now = {name: read(log.time, getattr(log, name), times) for name in READ}
    yaw = read(log.time, np.unwrap(log.yaw_reference)[:, None], times)[:, 0]
    quaternion = read(log.time, continuous(log.quaternion), times)
    poses = body_poses(vehicle, now["position"], quaternion, now["joints"])
    push, whole = getattr(scenario.reference, "push", None), log.status == "completed"
    error, contact = _error(log, push), _contact(log)
    return FilmedFlight(
        label=label,
        color=color,
        vehicle=vehicle,
        position=now["position"],
        quaternion=quaternion,
        joints=now["joints"],
        tilts=now["tilts"],
        desired_position=now["position_reference"],
        desired_quaternion=np.stack([np.cos(yaw / 2), 0 * yaw, 0 * yaw, np.sin(yaw / 2)], axis=1),
        desired_joints=now["joints_reference"],
        tip=now["tip"],
        desired_tip=now["tip_reference"],
        force=now["wind_force"],
        air=now["air_velocity"],
        error=read(log.time, error[:, None], times)[:, 0],
        error_time=log.time,
        error_curve=error,
        contact=None if contact is None else read(log.time, contact[:, None], times)[:, 0],
        contact_curve=contact,
        wanted_curve=wanted_push(log),
        end=end_of(log) if whole else float(log.time[-1]),
        lost="" if whole else log.status.replace("_", " "),
        loads=tuple(_loads(log, vehicle, scenario.payloads, poses, times)),
        surfaces=world_shapes(contacts, times, np.mean(now["tip_reference"], axis=0), patch_about(now["tip"]), carried),
        ground=ground_height(contacts),
        points=point_shapes(contacts, vehicle),
        touches=tuple(_touches(log, vehicle, contacts, poses, times, carried)),
    )


def _error(log: Log, push: TipPush | None) -> Array:
    """Distance of the tip from its reference (N,), m; across the believed normal while it shall press."""
    away = log.tip - log.tip_reference
    if push is not None:
        away = np.stack(list(push.across(Vec3(*away.T), log.time, Vec3(*log.tip.T))), axis=1)
    return np.asarray(np.linalg.norm(away, axis=1))


def _loads(
    log: Log, vehicle: Vehicle, payloads: Sequence[Any], poses: Mapping[int, tuple[Array, Array]], times: Array
) -> Iterator[Solid]:
    """Payloads that are held at some frames, where they are taken, held and left.

    One on a cord is left out: a log does not keep its place.
    """
    instants = np.clip(np.searchsorted(log.time, times, side="right") - 1, 0, log.time.size - 1)
    for i, (payload, masses) in enumerate(zip(payloads, log.payload_mass.T, strict=False)):
        (held,) = np.nonzero(masses[instants] > 0.0)
        if not payload.rigid or not held.size:
            continue
        # the last frame at which it was held, and before the first that one
        at = held[np.maximum(np.searchsorted(held, np.arange(len(times)), side="right") - 1, 0)]
        shape = payload_shape(vehicle, float(payload.mass), payload.frame, payload.com)
        R, p = poses[shape.body]
        yield Solid(replace(shape, name=f"payload{i + 1}"), (p + R @ np.array(shape.position))[at], R[at])


def patch_about(tip: Array) -> float:
    """Half the width of the patch that stands for a plane, m: a metre more than the tip goes, up to a point."""
    finite = tip[np.isfinite(tip).all(axis=1)]
    way = float(np.ptp(finite, axis=0).max()) if len(finite) else 0.0
    return PATCH + 0.5 * min(way, WIDEST)


def carried_at(log: Log, contacts: Sequence[Contact], times: Array) -> CarriedPoses:
    """Free objects and mechanisms at the frames."""
    turns = [continuous(each) for each in np.split(log.object_quaternion, log.object_quaternion.shape[1] // 4 or 1, 1)]
    kept = log.object_position, np.concatenate(turns, axis=1), log.mechanism_position
    return logged_poses(contacts, *(read(log.time, each, times) for each in kept))


def _touches(
    log: Log,
    vehicle: Vehicle,
    contacts: Sequence[Contact],
    poses: Mapping[int, tuple[Array, Array]],
    times: Array,
    carried: CarriedPoses,
) -> Iterator[TouchArrow]:
    """Contact forces at the frames, at the places that the bodies have then."""
    begin = 0
    for contact in contacts if log.contact_force.size else ():
        end = begin + contact.logged_pairs
        force = read(log.time, log.contact_force[:, begin:end], times)
        force = np.where(times[:, None] < end_of(log), force, 0.0)
        yield from touch_arrows(contact, vehicle, poses, times, force, carried)
        begin = end


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
    sign = np.concatenate([[1.0], np.cumprod(np.where(same, 1.0, -1.0))])[: len(quaternion)]
    return np.asarray(quaternion * sign[:, None], dtype=float)
