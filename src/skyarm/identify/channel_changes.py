"""Changes of a flight's channels that each undo one kind of fault in logging: axes,
signs, units, orders and clocks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations, permutations, product
from typing import Any

import numpy as np

from skyarm.algebra import Quaternion, Vec3
from skyarm.algebra.frames import to_our_attitude, turn_vectors
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.series import attitude_at, in_turned_axes
from skyarm.identify.log_checks import COMMANDS, IMU, RANGE, REFUSED, UNIT
from skyarm.identify.logged_commands import highest_speeds
from skyarm.records.arrays import Array, float_array, lengths
from skyarm.records.files import shipped_tables
from skyarm.records.immutable import positional
from skyarm.vehicle import Rotor, Vehicle

FAULTS: Sequence[Mapping[str, Any]] = shipped_tables(__file__)["fault"]
"""Faults that are alike for all vehicles."""

PRICE_COLUMN, PRICE_AMOUNT, PRICE_WHOLE = 0.003, 0.02, 0.1
"""Costs: of each column that a change alters, of a change by any amount, and of a
change of all axes.

They are logarithms of residuals: a change by an amount must make them 2 % less in the
mean to be worth it. With half of them one turned sign is taken for two, and two
exchanged rotors for a reversed order; with twice of them the other way round (measured,
``test_isolate_fault``)."""

MAP = "map its columns, their signs or its frame in columns.toml"
CLOCK, LEAVE = "check the clocks", "leave it out, or take that of this flight"
ORDER_ROTORS = (
    "order the columns as the vehicle's rotors, or the rotors of the vehicle file as"
    " the columns"
)
ORDER_JOINTS = "order the columns as the vehicle's joints, and check their signs"

JOINTS = ("joint_positions", "joint_rates")
ROTOR_COMMANDS = "rotor commands"
"""Common name of all channels of rotor commands."""

Channels = Mapping[str, Channel]


@positional(eq=False)
class ChannelChange:
    """Change of a flight's channels that undoes one kind of fault in logging.

    Attributes:
        channel: channel at fault. words: text of what is wrong with it, by the amount.
            remedy: remedy in words.
        names: channels that are changed, those of them that the flight has.
        make: channels and amount of the fault -> those in their place.
        amounts: amounts that are tried. between: whether the best one may lie beside
            them.
        price: price in the cost. severity: severity of the fault.
    """

    channel: str
    words: str
    remedy: str
    names: tuple[str, ...]
    make: Callable[[Channels, float], Channels]
    amounts: tuple[float, ...] = (1.0,)
    between: bool = False
    price: float = 0.0
    severity: str = REFUSED

    @property
    def is_unit(self) -> bool:
        """True if the fault is another unit, rather than a scale of any size."""
        return self.remedy == UNIT and not self.between

    def of(self, flight: FlightData, amount: float) -> FlightData:
        """Flight after the correction of a logging fault of a given amount."""
        own = {name: flight[name] for name in self.names if name in flight}
        rest = {name: flight[name] for name in flight if name not in own}
        return replace(flight, channels={**rest, **self.make(own, amount)})


def by_rows(
    function: Callable[[Array, float], Array], own: Channels, amount: float
) -> Channels:
    """Channels with values transformed by a function of the values and the fault's
    amount.
    """
    return {
        name: replace(each, values=function(each.values, amount))
        for name, each in own.items()
    }


def by_time(
    function: Callable[[Array, float], Array], own: Channels, amount: float
) -> Channels:
    """Channels with sample times transformed by a function of the times and the fault's
    amount.
    """
    return {
        name: replace(each, time=function(each.time, amount))
        for name, each in own.items()
    }


def leave_out(own: Channels, amount: float) -> Channels:
    """Correction that removes faulty channels: returns an empty mapping in place of
    them.
    """
    return {}


def channel_changes(flight: FlightData, start: Vehicle) -> Iterator[ChannelChange]:
    """Yield candidate corrections of a flight's channels, to be tried as explanations
    of large residuals.
    """
    yield from _of_axes(flight)
    for words, meant in READINGS.items():
        yield ChannelChange(
            "quaternion", words, MAP, ("quaternion",), partial(by_rows, meant)
        )
    for row in FAULTS:
        channel = row["channel"]
        names = tuple(row.get("names", [channel]) or flight)
        if all(name in flight for name in names) or "together" not in row:
            yield ChannelChange(
                channel,
                row["words"],
                REMEDIES[row["remedy"]],
                names,
                MAKES[row["make"]],
                tuple(row.get("amounts", [1.0])),
                row.get("between", False),
                row.get("price", 0.0),
                row.get("severity", REFUSED),
            )
    yield from _of_rotors(flight, start.rotors)
    # words are formats of an amount
    yield from _of_joints(
        [joint.name.replace("{", "{{").replace("}", "}}") for joint in start.joints]
    )


def _map_columns(
    channel: str, words: str, remedy: str, names: tuple[str, ...], mapping: Array
) -> ChannelChange:
    """Candidate correction that maps the columns of channels by a matrix (k, k), with a
    price per moved column.
    """
    moved = int((mapping != np.eye(len(mapping))).any(axis=1).sum())
    make = partial(by_rows, lambda rows, _: rows @ mapping.T)
    return ChannelChange(
        channel, words, remedy, names, make, price=moved * PRICE_COLUMN
    )


def _straight(time: Array, _: float) -> Array:
    """Replace time stamps by evenly spaced times on the straight line fitted to
    them.
    """
    count = np.arange(time.size, dtype=float)
    return np.asarray(np.polyval(np.polyfit(count, time, 1), count))


def _in_world(own: Channels, _: float) -> Channels:
    """Rotate a velocity that was logged in base axes into world axes."""
    velocity, attitude = own["velocity"], own["quaternion"]
    values = turn_vectors(attitude_at(attitude, velocity.time), velocity.values)
    return {**own, "velocity": replace(velocity, values=values)}


def _ours(frame: str, world: str, attitude: Array, _: float) -> Array:
    """Attitudes (N, 4) in the library's convention, from those of another body frame
    and world frame.
    """
    w, x, y, z = attitude.T
    return np.stack([*to_our_attitude(w, x, y, z, frame, world)], axis=1)


READINGS: Mapping[str, Callable[[Array, float], Array]] = {
    "turns the other way: it looks inverse, from world to base": (
        lambda q, _: q * [1.0, -1.0, -1.0, -1.0]
    ),
    "looks like x, y, z, w read as w, x, y, z": lambda q, _: q[:, [3, 0, 1, 2]],
    "looks like w, x, y, z read as x, y, z, w": lambda q, _: q[:, [1, 2, 3, 0]],
    "looks like that of forward, right, down in north, east, down": partial(
        _ours, "FRD", "NED"
    ),
    "looks like that of forward, right, down": partial(_ours, "FRD", "z up"),
    "looks like that in north, east, down": partial(_ours, "FLU", "NED"),
}
"""Description -> quaternion that was meant, computed from the one that was read."""

REMEDIES = {"unit": UNIT, "map": MAP, "clock": CLOCK, "leave": LEAVE}
"""Key in the table of faults -> remedy."""

MAKES: Mapping[str, Callable[[Channels, float], Channels]] = {
    "rescaled": partial(by_rows, lambda rows, times: rows / times),
    "moved": partial(by_time, lambda time, late: time - 1e-3 * late),
    "stretched": partial(by_time, lambda time, times: time / times),
    "straight": partial(by_time, _straight),
    "in_world": _in_world,
    "left_out": leave_out,
}
"""Key in the table of faults -> function of the channels at fault and the amount."""


def _of_axes(flight: FlightData) -> Iterator[ChannelChange]:
    """Yield candidate corrections of sensor axes: permutations and sign changes."""
    plain, mean = np.eye(3), flight["accelerometer"].values.mean(axis=0)
    k = int(np.argmax(np.abs(mean)))
    thrust = math.copysign(1.0, mean[k]) * plain[k]
    upright = thrust[2] > 0.0
    along = (
        f"measures the thrust along {_axis(thrust)} rather than z, {mean[k]:.3g} m/s^2"
    )
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        mapping = np.diag(signs) @ plain[list(order)]
        moved = (mapping != plain).any(axis=1).sum()
        if not moved:
            continue
        words = _axes_words(mapping)
        # faults of wiring: axes that are exchanged, one sign, or a turn about an axis
        usual = (
            (mapping >= 0.0).all()
            or moved == 1
            or (moved == 2 and np.linalg.det(mapping) > 0.0)
        )
        if usual:
            yield _map_columns("gyro", words, MAP, ("gyro",), mapping)
        # in flight the force is up on the mean, so a mapping that turns it away is none
        if (mapping @ mean)[2] > 0.5 * np.linalg.norm(mean):
            yield _map_columns(
                "accelerometer",
                words if upright else along,
                MAP,
                ("accelerometer",),
                mapping,
            )
        if mapping[2, 2] and (usual or (mapping[:2] >= 0.0).all()):
            for names in (("velocity",), ("position",), ("position", "velocity")):
                yield _map_columns(names[0], words, MAP, names, mapping)
    yield from _of_base(thrust, along, "quaternion" in flight)


def _of_base(thrust: Array, along: str, attitude: bool) -> Iterator[ChannelChange]:
    """Yield candidate rotations of the base axes of several sensors, which put the
    measured thrust along z.
    """
    upright = bool(thrust[2] > 0.0)
    remedy = "turn the rotors of the vehicle file, or the IMU's axes"
    # a quarter turn for a thrust along x or y, half a turn about x for one along -z
    lift = (
        0.5 * math.pi * np.cross(thrust, [0.0, 0.0, 1.0])
        if thrust[2] >= 0.0
        else [math.pi, 0.0, 0.0]
    )
    make = partial(_base_turned, Quaternion.of_rotation_vector(Vec3(*lift)))
    turned = "axes look turned by {:.0f} deg about z"
    whole = (
        ROTOR_COMMANDS,
        "turn the vehicle as if it stood {:.0f} deg about z from its rotors' places",
    )
    board = "gyro", f"and accelerometer: {turned}"
    # a cross flown as a plus, and quarter turns of a board
    turns = [45.0, -45.0, 90.0, -90.0, 180.0]
    price = PRICE_WHOLE
    if not upright:
        words = (
            "axes look like forward, right, down or others, and the accelerometer"
            f" {along}: turned by {{:.0f}} deg"
        )
        whole = board = "gyro", f"{words} about z"
        turns = [0.0, 90.0, -90.0, 180.0]
        price = PRICE_COLUMN
    # without an attitude the board and the vehicle turn alike
    for (name, words), names in [(board, IMU)] * attitude + [
        (whole, (*IMU, "quaternion"))
    ]:
        yield ChannelChange(name, words, remedy, names, make, (*turns,), upright, price)
    if upright:
        yield ChannelChange(
            "quaternion",
            turned,
            MAP,
            ("quaternion",),
            make,
            (*turns,),
            True,
            PRICE_AMOUNT,
        )


def _base_turned(up: Quaternion, own: Channels, degrees: float) -> Channels:
    """Rotate channels in base axes by a quaternion that puts z up, then by an angle
    (deg) about z.
    """
    turn = Quaternion.of_rotation_vector(Vec3(0.0, 0.0, math.radians(degrees))) * up
    return {name: in_turned_axes(name, each, turn) for name, each in own.items()}


def _axis(row: Array) -> str:
    """Name of an axis with its sign, from a vector (3,) along it."""
    return ("-" if row.sum() < 0.0 else "") + "xyz"[int(np.argmax(np.abs(row)))]


def _axes_words(mapping: Array) -> str:
    """Description of the axis fault that a signed permutation (3, 3) corrects, such as
    swapped axes.
    """
    moved = [i for i in range(3) if mapping[i, i] != 1.0]
    which = " and ".join("xyz"[i] for i in moved)
    if np.count_nonzero(np.diag(mapping)) == 3:
        said = (
            f"the sign of {which} looks turned"
            if len(moved) == 1
            else f"the signs of {which} look turned"
        )
        return said + (
            ", as of forward, right, down (FRD) read as forward, left, up"
            if moved == [1, 2]
            else ""
        )
    if len(moved) == 2 and (mapping >= 0.0).all():
        return f"{which} look swapped"
    return (
        f"the axes look swapped or turned: {', '.join(map(_axis, mapping))} stand for"
        " x, y, z"
    )


def _of_rotors(flight: FlightData, rotors: Sequence[Rotor]) -> Iterator[ChannelChange]:
    """Yield candidate corrections of the order and range of rotor commands."""
    plain = tuple(range(len(rotors)))
    places = np.array([float_array(each.position) for each in rotors])
    # one above the other are told apart by their height
    mirrored = tuple(
        int(np.argmin(lengths(places - each * [1.0, -1.0, 1.0]))) for each in places
    )
    mirrored = mirrored if sorted(mirrored) == [*plain] else plain
    turned = [(plain[i:] + plain[:i])[::way] for i in plain for way in (1, -1)]
    wordings = {
        mirrored: "the rotors look mirrored, left for right",
        plain[::-1]: "the order of the rotors looks reversed",
    }
    every = [
        *_exchanges(plain),
        *turned,
        mirrored,
        # of six rotors there are 720 orders, each of which costs a search
        *(permutations(plain) if len(plain) <= 4 else ()),
    ]
    for order in dict.fromkeys(every):
        moved = [str(i + 1) for i in plain if order[i] != i]
        words = f"the rotors look ordered {', '.join(str(each + 1) for each in order)}"
        if len(moved) == 2:
            words = f"rotors {' and '.join(moved)} look exchanged"
        if moved:
            yield _map_columns(
                ROTOR_COMMANDS,
                wordings.get(order, words),
                ORDER_ROTORS,
                COMMANDS,
                np.eye(len(plain))[list(order)],
            )
    full = (
        highest_speeds(rotors)
        if "rotor_speed_commands" in flight
        else np.ones(len(plain))
    )
    if np.isfinite(full).all():
        words = "begin at {:.0f} % of the full signal: their range is another"
        lowered = partial(by_rows, partial(_less, 0.01 * full))
        # first amounts, chosen, as of zeros of joints below
        percent = (-15.0, -6.0, 6.0, 15.0)
        yield ChannelChange(
            ROTOR_COMMANDS, words, RANGE, COMMANDS, lowered, percent, True, PRICE_AMOUNT
        )


def _exchanges(plain: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Yield orders of rotors or joints in which two are exchanged."""
    for i, k in combinations(plain, 2):
        yield tuple(k if each == i else i if each == k else each for each in plain)


def _of_joints(names: Sequence[str]) -> Iterator[ChannelChange]:
    """Yield candidate corrections of the order, signs and zeros of joint channels."""
    plain, every = np.eye(len(names)), range(len(names))
    maps = dict[str, Array]()
    for order in _exchanges(every):
        maps[
            f"{' and '.join(names[i] for i in every if order[i] != i)} look swapped"
        ] = plain[list(order)]
    for turned in [[i] for i in every] + [[*every]] * (len(names) > 1):
        signs = np.where(np.isin(every, turned), -1.0, 1.0)
        maps[f"the sign of {' and '.join(names[i] for i in turned)} looks turned"] = (
            np.diag(signs)
        )
    for words, mapping in maps.items():
        for group in (JOINTS, ("joint_rates",), ("joint_efforts",)):
            yield _map_columns(group[0], words, ORDER_JOINTS, group, mapping)
    for name, column in zip(names, plain, strict=True):
        moved = partial(by_rows, partial(_less, column))
        # first amounts, chosen; the best of them is refined between its neighbours
        zeros = (-0.5, -0.15, 0.15, 0.5)
        words = f"zero of {name} is off by {{:.3g}}"
        yield ChannelChange(
            "joint_positions",
            words,
            ORDER_JOINTS,
            ("joint_positions",),
            moved,
            zeros,
            True,
            PRICE_AMOUNT,
        )


def _less(unit: Array, rows: Array, amount: float) -> Array:
    """Subtract a constant offset from some columns of samples (N, k)."""
    return rows - amount * unit
