"""Isolation of a fault of a flight: the change of one channel after which the model explains all sensors.

Of a sound flight, windows that the engine flies leave white noise in the row of every sensor. If they do not, each
change of a table is made in turn, and windows are fitted anew: axes, signs, units, orders, ranges and clocks of
channels, and channels left out. The change that makes the rows white is named. What no change mends is no fault of a
channel: that is said of the model.
"""

from __future__ import annotations

import dataclasses
import math
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import combinations, pairwise, permutations, product
from typing import TypeAlias

import numpy as np

from skyarm.algebra import Quaternion
from skyarm.algebra.frames import to_our_attitude, turn_vectors
from skyarm.flight_data.clocks import align_poses
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.series import attitude_at
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable
from skyarm.studies.identify.identify_windows import distinct_flights, moved_joints, unknowns_of_sensors
from skyarm.studies.identify.log_checks import RANGES, RARE, REFUSED, WARNED, Fault, check_log
from skyarm.studies.identify.logged_commands import commanded_speeds, flying_spans, highest_speeds
from skyarm.studies.identify.possible_numbers import LONGEST_DELAY
from skyarm.studies.identify.unknowns import USUAL_DELAY, unknowns_of, with_servos, without_tilts
from skyarm.studies.identify.window_errors import WindowErrors
from skyarm.studies.identify.window_fit import LEAST, TURNS, first_noise, fit_windows, student_quantile
from skyarm.studies.identify.windows import SENSORS, Windows, clock_step, on_clock
from skyarm.vehicle.vehicle_records import Rotor, Vehicle

Rows: TypeAlias = Mapping[tuple[str, int], float]
"""Sensor and column -> size of what the model leaves, over the sensor's own white noise."""

PUSHES = ("unexplained force", "unexplained torque")
"""Rows of the wrench that differs from window to window, over the size that it is thought to have before."""

Channels: TypeAlias = Mapping[str, Channel]


@immutable(kw_only=False)
class Left:
    """Residuals of each sensor after a fit to windows of a flight, over the sensor's own noise.

    Attributes:
        sizes: of the rows. unusual: sum of squares of the numbers' distances from the start, over what was known.
        delay: s, of the commands.
    """

    sizes: Rows
    unusual: float = 0.0
    delay: float = USUAL_DELAY

    @property
    def largest(self) -> float:
        """Largest residual of all rows, over the noise of its sensor."""
        return max(self.sizes.values())

    def cost(self, fine: float = 0.0) -> float:
        """Sum of the logarithms of the rows' sizes over the sensors' rows, and a price of unusual numbers.

        Args:
            fine: cost of a white row, over its size; else none counts as less than white.
        """
        count = sum(name not in PUSHES for name, _ in self.sizes)
        white = sum(math.log(max(size, 1.0)) + fine * min(size, 1.0) for size in self.sizes.values())
        return white / max(1, count) + UNUSUAL * self.unusual


ALARM, DOUBTFUL, ODD = 1.3, 3.0, 200.0
"""Times its own white noise beyond which a row is not explained; and beyond which the model is doubted; and the sum of
squares of the numbers' distances from the start beyond which they explain what no vehicle does.
"""

GAIN, CLEAR = 0.3, 0.1
"""Of the cost: least fall by which a change is named that does not make all white; and what it must be better by than
changes of other channels to be named alone.
"""

UNUSUAL, FINE = 0.003, 0.1
"""Costs of a number that is a standard deviation of what was known off, and of rows that are white, over their sizes.

The former tells of two changes that mend a flight as well the one after which the vehicle is the start's; the latter
tells amounts apart that all make white.
"""

QUICK, SOON, LAST = (12, 1), (12, 4), (60, TURNS)
"""Windows and turns of a first search for each change, of a second one for some, and of the last."""

SECOND, FINAL, HOPEFUL = 8, 4, 0.8
"""Changes that are searched for again, and once more; and share of the cost below which at once."""

SECONDS, LENGTH, SAMPLES = 30.0, 0.06, 12
"""s of a flight that are looked at; s of a window, and samples of the gyroscope in it, at least."""

FEWEST, RATES, COARSE = 4, (20.0, 1e4), 4e-3
"""Windows; Hz, of a gyroscope whose windows are flown; s, of a step at most in a first search."""

LEFT_OUT, CHANGED, FREE, WHOLE = 0.35, 0.003, 0.02, 0.1
"""Prices of a channel left out, of each column that a change moves, of one by any amount, and of such of all clocks or
axes.
"""

LATE = 0.05
"""s, by which a pose is late that is reported although it is aligned."""

MAP, UNIT = "map its columns, their signs or its frame in columns.toml", "state its unit in columns.toml"
SHIFTED = "stamps are off by {:+.0f} ms, + is late"
CLOCK, LEAVE = "check the clocks", "leave it out, or take that of this flight"
ORDER = "order the columns as the vehicle's rotors, or the rotors of the vehicle file as the columns"
JOINT = "order the columns as the vehicle's joints, and check their signs"

IMU, POSE = ("gyro", "accelerometer"), ("position", "quaternion", "velocity")
SPEEDS, JOINTS = ("rotor_speed_commands", "rotor_commands"), ("joint_positions", "joint_rates")
WORLD: Sequence[tuple[str, ...]] = (("velocity",), ("position",), ("position", "velocity"))
ROTORS = "rotor commands"
"""Name of the channel, whichever it is."""

BESIDE = {
    "gyro": ("gyro", "quaternion"),
    "quaternion": ("gyro", *POSE),
    "position": POSE,
    "velocity": ("position", "velocity"),
    "joint_rates": JOINTS,
}
"""Channel -> sensors of which a row is not explained if it is at fault; others may spoil any."""

OFF = (0.65, 0.8, 0.92, 1.09, 1.25, 1.5)
SHIFTS = (-0.2, -0.05, 0.05, 0.2)
"""Factors of a scale, and s of a shift, from which the best one is looked for."""


@immutable(kw_only=False, eq=False)
class Change:
    """Change of a flight's channels that undoes one kind of fault in logging.

    Attributes:
        channel: at fault. words: what is wrong with it, by the amount. remedy: in words.
        names: channels that are changed, those of them that the flight has.
        make: channels and amount -> those in their place.
        amounts: that are tried. between: whether the best one may lie beside them.
        shown: amount -> number in the words.
        price: in the cost. severe: whether the fault spoils the vehicle's numbers.
    """

    channel: str
    words: str
    remedy: str
    names: tuple[str, ...]
    make: Callable[[Channels, float], Channels]
    amounts: tuple[float, ...] = (1.0,)
    between: bool = False
    shown: Callable[[float], float] = float
    price: float = 0.0
    severe: bool = True

    def of(self, flight: FlightData, amount: float) -> FlightData:
        """Flight after the change."""
        own = {name: flight[name] for name in self.names if name in flight}
        rest = {name: flight[name] for name in flight if name not in own}
        return dataclasses.replace(flight, channels={**rest, **self.make(own, amount)})


def by_rows(function: Callable[[Array, float], Array], own: Channels, amount: float) -> Channels:
    """Channels with other values, each by a function of them and the amount."""
    return {name: dataclasses.replace(each, values=function(each.values, amount)) for name, each in own.items()}


def by_time(function: Callable[[Array, float], Array], own: Channels, amount: float) -> Channels:
    """Channels with other times, likewise."""
    return {name: dataclasses.replace(each, time=function(each.time, amount)) for name, each in own.items()}


def column_map(mapping: Array) -> Callable[[Channels, float], Channels]:
    """Change of the values by a map (k, k) of their columns."""
    return partial(by_rows, lambda rows, _: rows @ mapping.T)


SCALED = partial(by_rows, lambda rows, factor: rows * factor)
MOVED = partial(by_time, lambda time, late: time - late)
STRETCHED = partial(by_time, lambda time, factor: time * factor)


def _left_out(own: Channels, amount: float) -> Channels:
    return {}


def _straight(time: Array, _: float) -> Array:
    """Evenly spaced times in place of stamps, on the straight line through them."""
    count = np.arange(time.size, dtype=float)
    return np.asarray(np.polyval(np.polyfit(count, time, 1), count))


def _in_world(own: Channels, _: float) -> Channels:
    """Velocity in world axes from that in base axes."""
    velocity, attitude = own["velocity"], own["quaternion"]
    values = turn_vectors(attitude_at(attitude, velocity.time), velocity.values)
    return {**own, "velocity": dataclasses.replace(velocity, values=values)}


def _about(axis: Sequence[float], degrees: float) -> Quaternion:
    half = math.radians(0.5 * degrees)
    return Quaternion(math.cos(half), *(math.sin(half) * each for each in axis))


def _base_turned(up: Quaternion, own: Channels, degrees: float) -> Channels:
    """Channels in base axes that are turned: by a quaternion that puts z up, then about z."""
    turn, found = _about((0.0, 0.0, 1.0), degrees) * up, dict[str, Channel]()
    w, x, y, z = turn
    for name, each in own.items():
        if name == "quaternion":
            values = np.stack(list(Quaternion(*each.values.T) * Quaternion(w, -x, -y, -z)), axis=1)
        else:
            values = turn_vectors(np.tile([w, x, y, z], (len(each.values), 1)), each.values)
        found[name] = dataclasses.replace(each, values=values)
    return found


def table(flight: FlightData, start: Vehicle) -> Iterator[Change]:
    """Yield the changes of channels among which the cause of a flight's residuals is looked for."""
    yield from _of_axes(flight)
    for words, meant in READINGS.items():
        yield Change("quaternion", words, MAP, ("quaternion",), partial(by_rows, meant))
    for name, unit, factor in UNITS:
        yield Change(name, f"it looks like {unit}", UNIT, (name,), SCALED, (factor,))
    for name in ("gyro", "accelerometer", "velocity", "position"):
        words, over = "is {:.4g} times what fits", partial(operator.truediv, 1.0)
        yield Change(name, words, UNIT, (name,), SCALED, OFF, True, over, FREE)
    if "quaternion" in flight:
        yield Change("velocity", "is in axes of the base", MAP, ("velocity", "quaternion"), _in_world)
    speed = (0.5, *OFF, 2.0)
    words, over = "runs {:.3g} times as fast", partial(operator.truediv, 1.0)
    yield Change("time", words, CLOCK, tuple(flight), STRETCHED, speed, True, over, WHOLE)
    yield Change(
        "pose", "stamps are late by more or less than even ones", CLOCK, POSE, partial(by_time, _straight), severe=False
    )
    kept = [("pose", POSE, 1.0), ("velocity", ("velocity",), 0.5), ("joint_rates", ("joint_rates",), 0.5)]
    for name, names, part in [*kept, ("joint_efforts", ("joint_efforts",), 1.0)]:
        words = "does not belong to this flight"
        yield Change(name, words, LEAVE, names, _left_out, price=part * LEFT_OUT)
    late = {"pose": POSE, "velocity": ("velocity",), ROTORS: SPEEDS, "joint_positions": JOINTS}
    for name, names in late.items():
        yield Change(name, SHIFTED, CLOCK, names, MOVED, SHIFTS, True, partial(operator.mul, 1e3), FREE)
    yield from _of_rotors(flight, start.rotors)
    yield from _of_joints([link.joint.name for link in start.links])


def _ours(frame: str, world: str, attitude: Array, _: float) -> Array:
    """Attitudes (N, 4) from those of a base in a world of other axes."""
    w, x, y, z = attitude.T
    return np.stack([*to_our_attitude(w, x, y, z, frame, world)], axis=1)


READINGS: Mapping[str, Callable[[Array, float], Array]] = {
    "turns the other way: it looks inverse, from world to base": lambda q, _: q * [1.0, -1.0, -1.0, -1.0],
    "looks like x, y, z, w read as w, x, y, z": lambda q, _: q[:, [3, 0, 1, 2]],
    "looks like w, x, y, z read as x, y, z, w": lambda q, _: q[:, [1, 2, 3, 0]],
    "looks like that of forward, right, down in north, east, down": partial(_ours, "FRD", "NED"),
    "looks like that of forward, right, down": partial(_ours, "FRD", "z up"),
    "looks like that in north, east, down": partial(_ours, "FLU", "NED"),
}
"""Words -> quaternion that was meant, from the one that was read."""

DEGREE = math.pi / 180.0
UNITS = (
    ("gyro", "deg/s", DEGREE),
    ("gyro", "rad/s read as deg/s", 1.0 / DEGREE),
    ("gyro", "mrad/s", 1e-3),
    ("velocity", "mm/s", 1e-3),
    ("velocity", "cm/s", 1e-2),
    ("position", "mm", 1e-3),
    ("position", "cm", 1e-2),
    ("joint_rates", "deg/s", DEGREE),
    ("joint_efforts", "N mm", 1e-3),
    ("joint_efforts", "kN m", 1e3),
)
"""Channel, unit that it may have, and the factor to SI."""


def _of_axes(flight: FlightData) -> Iterator[Change]:
    """Yield changes of the axes of sensors."""
    mean = flight["accelerometer"].values.mean(axis=0)
    k = int(np.argmax(np.abs(mean)))
    sign, plain = (-1.0 if mean[k] < 0.0 else 1.0), np.eye(3)
    along = f"measures the thrust along {'-' if sign < 0.0 else ''}{'xyz'[k]} rather than z, {mean[k]:.3g} m/s^2"
    upright = k == 2 and sign > 0.0
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        mapping = np.diag(signs) @ plain[list(order)]
        moved = int((mapping != plain).any(axis=1).sum())
        if not moved:
            continue
        words, price, make = _axes_words(mapping), moved * CHANGED, column_map(mapping)
        swapped = (mapping >= 0.0).all()
        usual = swapped or moved == 1 or (moved == 2 and np.linalg.det(mapping) > 0.0)
        if usual:
            yield Change("gyro", words, MAP, ("gyro",), make, price=price)
        if (mapping @ mean)[2] > 0.5 * np.linalg.norm(mean):
            yield Change("accelerometer", words if upright else along, MAP, ("accelerometer",), make, price=price)
        if mapping[2, 2] and (usual or (mapping[:2] >= 0.0).all()):
            for names in WORLD:
                yield Change(names[0], words, MAP, names, make, price=price)
    axis = plain[2 if upright else 0 if k == 2 else 1 if k == 0 else 0]
    up = _about(axis, 0.0 if upright else 180.0 if k == 2 else 90.0 * sign * (-1.0 if k == 0 else 1.0))
    turns = (45.0, -45.0, 90.0, -90.0, 180.0) if upright else (0.0, 90.0, -90.0, 180.0)
    wrong = (
        f"axes look like forward, right, down or others, and the accelerometer {along}: turned by {{:.0f}} deg about z"
    )
    stood = "turn the vehicle as if it stood {:.0f} deg about z from its rotors' places"
    of_all = (ROTORS, stood) if upright else ("gyro", wrong)
    of_imu = ("gyro", "and accelerometer: axes look turned by {:.0f} deg about z") if upright else ("gyro", wrong)
    remedy = "turn the rotors of the vehicle file, or the IMU's axes"
    price = WHOLE if upright else CHANGED
    # without an attitude the board and the vehicle turn alike
    every = [(of_imu, IMU)] * ("quaternion" in flight) + [(of_all, (*IMU, "quaternion"))]
    for (name, words), names in every:
        yield Change(name, words, remedy, names, partial(_base_turned, up), turns, upright, price=price)
    if upright:
        words = "axes look turned by {:.0f} deg about z"
        yield Change("quaternion", words, MAP, ("quaternion",), partial(_base_turned, up), turns, True, price=FREE)


def _axes_words(mapping: Array) -> str:
    """Words for the axes that a signed permutation (3, 3) puts right: of each true axis the one that was read."""
    moved = [i for i in range(3) if mapping[i, i] != 1.0]
    if np.count_nonzero(np.diag(mapping)) == 3:
        which = " and ".join("xyz"[i] for i in moved)
        said = f"the sign of {which} looks turned" if len(moved) == 1 else f"the signs of {which} look turned"
        return said + (", as of forward, right, down (FRD) read as forward, left, up" if moved == [1, 2] else "")
    if len(moved) == 2 and (mapping >= 0.0).all():
        return " and ".join("xyz"[i] for i in moved) + " look swapped"
    read = ", ".join(("-" if row.sum() < 0.0 else "") + "xyz"[int(np.argmax(np.abs(row)))] for row in mapping)
    return f"the axes look swapped or turned: {read} stand for x, y, z"


def _of_rotors(flight: FlightData, rotors: Sequence[Rotor]) -> Iterator[Change]:
    """Yield other orders and another range of the rotors' commands."""
    plain = tuple(range(len(rotors)))
    places = np.array([[float(each.position.x), float(each.position.y)] for each in rotors])
    mirrored = tuple(int(np.argmin(np.hypot(*(places - [x, -y]).T))) for x, y in places)
    turned = [(plain[i:] + plain[:i])[::way] for i in plain for way in (1, -1)]
    every = [*_exchanges(plain), *turned, mirrored, *(permutations(plain) if len(plain) <= 4 else ())]
    for order in dict.fromkeys(every):
        moved = [i for i in plain if order[i] != i]
        if not moved:
            continue
        words = f"the rotors look ordered {', '.join(str(each + 1) for each in order)}"
        if order == plain[::-1]:
            words = "the order of the rotors looks reversed"
        elif order == mirrored:
            words = "the rotors look mirrored, left for right"
        elif len(moved) == 2:
            words = f"rotors {moved[0] + 1} and {moved[1] + 1} look exchanged"
        make = column_map(np.eye(len(plain))[list(order)])
        yield Change(ROTORS, words, ORDER, SPEEDS, make, price=CHANGED * len(moved))
    full = highest_speeds(rotors) if "rotor_speed_commands" in flight else np.ones(len(plain))
    if np.isfinite(full).all():
        raised = partial(by_rows, partial(_less, full))
        words = "begin at {:.0f} % of the full signal: their range is another"
        remedy, shares = "state low and high in columns.toml", (-0.15, -0.06, 0.06, 0.15)
        yield Change(ROTORS, words, remedy, SPEEDS, raised, shares, True, partial(operator.mul, 1e2), FREE)


def _exchanges(plain: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Yield orders of rotors or joints in which two are exchanged."""
    for i, k in combinations(plain, 2):
        yield tuple(k if each == i else i if each == k else each for each in plain)


def _of_joints(names: Sequence[str]) -> Iterator[Change]:
    """Yield other orders, signs and zeros of the joints' channels."""
    plain = np.eye(len(names))
    groups = [JOINTS, ("joint_rates",), ("joint_efforts",)]
    for order in _exchanges(range(len(names))):
        words = " and ".join(names[i] for i in range(len(names)) if order[i] != i) + " look swapped"
        for group in groups:
            yield Change(group[0], words, JOINT, group, column_map(plain[list(order)]), price=2.0 * CHANGED)
    for turned in [[i] for i in range(len(names))] + [[*range(len(names))]] * (len(names) > 1):
        signs = np.where(np.isin(np.arange(len(names)), turned), -1.0, 1.0)
        words = f"the sign of {' and '.join(names[i] for i in turned)} looks turned"
        for group in groups:
            yield Change(group[0], words, JOINT, group, column_map(np.diag(signs)), price=CHANGED * len(turned))
    for i, name in enumerate(names):
        moved = partial(by_rows, partial(_less, plain[i]))
        words, zeros = f"zero of {name} is off by {{:.3g}}", (-0.5, -0.15, 0.15, 0.5)
        yield Change("joint_positions", words, JOINT, ("joint_positions",), moved, zeros, True, price=FREE)


def _less(unit: Array, rows: Array, amount: float) -> Array:
    """Samples (N, k) less a constant offset of some columns."""
    return rows - amount * unit


def find_faults(flight: FlightData, start: Vehicle, *, isolate: bool = True) -> tuple[Fault, ...]:
    """Faults of a measured flight, the refused first.

    Args:
        flight: measured.
        start: vehicle that its numbers will be identified for: rotors, joints and data sheet.
        isolate: look for the change of a channel that mends what the model does not explain: some ten seconds.
    """
    found = check_log(flight, start)
    if not any(each.severity == REFUSED for each in found):
        found += _isolate(flight, start, [each.channel for each in found], isolate)
    return tuple(sorted(found, key=lambda each: each.severity != REFUSED))


def _isolate(flight: FlightData, start: Vehicle, told: Sequence[str], search: bool) -> list[Fault]:
    """Fault of one channel that explains what the model leaves of a flight, else that the model does not explain it."""
    try:
        student_quantile()
    except ValueError:  # of a page or a studio, which do not need it
        return []
    stamped, (flight, clock) = flight, align_poses(flight)
    spans = flying_spans(commanded_speeds(flight, start), start)
    if spans:
        stamped, flight = (each.section(spans[0][0] - 1.0, spans[0][0] - 1.0 + SECONDS) for each in (stamped, flight))
    fault = partial(Fault, file=flight.file)
    late = []
    if clock is not None and abs(clock.offset) - clock.offset_error > LATE:
        way, off = ("late" if clock.offset < 0.0 else "early"), 1e3 * abs(clock.offset)
        finding = f"is {off:.0f} ± {1e3 * clock.offset_error:.0f} ms {way} against the gyro"
        remedy = "identify aligns it (skyarm.flight_data.clocks.align_poses)"
        late = [fault(severity=WARNED, channel="quaternion", finding=finding, remedy=remedy)]
    left = Leavings(start)
    before = left.rows(flight, *LAST) or Left({})
    rows = before.sizes
    sizes = {name: max(size for (of, _), size in rows.items() if of == name) for name, _ in rows}
    bad = sorted((name for name in sizes if sizes[name] >= ALARM and name not in told), key=lambda name: -sizes[name])
    odd = before.unusual > ODD
    if not bad and abs(before.delay) > LONGEST_DELAY:
        finding = SHIFTED.format(-1e3 * (before.delay - USUAL_DELAY))
        finding += f": they act {1e3 * before.delay:.0f} ms after they are stamped"
        return [*late, fault(severity=REFUSED, channel=ROTORS, finding=finding, remedy=CLOCK)]
    if not bad and not odd:
        return late
    best = _best_changes(left, (stamped, flight), start, before) if search else []
    if not best and not (bad and DOUBTFUL <= sizes[bad[0]] < math.inf):
        return late
    if not best:
        finding = f"does not explain {', '.join(f'{name} ({sizes[name]:.2g} times its noise)' for name in bad)}"
        remedy = "no change of a channel mends it: check the vehicle file, and expect no more of its numbers"
        remedy = remedy if search else "skyarm show FLIGHT --vehicle FILE looks for the cause"
        return [*late, fault(severity=WARNED, channel="model", finding=finding, remedy=remedy)]
    words = [change.words.format(change.shown(amount)) for _, change, amount, _ in best]
    others = "".join(f", or {each[1].channel}: {said}" for each, said in zip(best[1:], words[1:], strict=True))
    _, change, _, left_over = best[0]
    after = left_over.sizes
    loud = [row for row in rows if row[0] not in PUSHES and rows[row] >= ALARM] or list(rows)
    row = max(loud, key=lambda row: rows[row] / max(after.get(row, ALARM), 1e-3))
    residual = row[0] if row[0] in PUSHES else f"residual of {row[0]}"
    falls = f"falls from {rows[row]:.3g} times its noise to {after.get(row, 0.0):.2g}"
    if row not in after:
        falls = f"is {rows[row]:.3g} times its noise, and without it all others are at most {max(after.values()):.2g}"
    if odd and rows[row] < ALARM:
        residual, falls = "start vehicle", f"is {math.sqrt(before.unusual):.0f} standard deviations from what fits else"
    if rows[row] == math.inf:
        residual, falls = "motion", "under the commands is no number without this change"
    finding = f"{words[0]}{others}: the {residual} {falls}"
    severity = REFUSED if change.severe else WARNED
    named = fault(severity=severity, channel=change.channel, finding=finding, remedy=change.remedy)
    return [named] if change.channel == "pose" else [*late, named]


Flights: TypeAlias = tuple[FlightData, FlightData]
"""Flight as it is stamped, and with its poses on the clock of the gyro."""

Tried: TypeAlias = tuple[float, Change, float, Left]
"""Cost with the price, change, amount and what it leaves."""


def _best_changes(left: Leavings, flights: Flights, start: Vehicle, before: Left) -> list[Tried]:
    """Changes that mend a flight, the best first; beside it one of another channel that mends it as well."""
    flight = flights[1]
    bad = {name for (name, _), size in before.sizes.items() if size >= ALARM}
    bad, tried, finals = bad or {name for name, _ in before.sizes}, list[Tried](), list[Tried]()
    how = QUICK if bad - {*PUSHES} else SOON
    hopeful = HOPEFUL * (left.rows(flight, *how) or before).cost()
    # units, signs and exchanges first, channels that are left out last
    every = [*table(flight, start)]
    for change in sorted(every, key=lambda each: (each.make is _left_out, each.between, each.price)):
        # nothing but an attitude tells a wrong rate from what it would push
        around = BESIDE.get(change.names[0] if len(change.names) < 3 and "quaternion" in flight else "", bad)
        if not bad & {*around} or not any(name in flight for name in change.names):
            continue
        for amount in change.amounts:
            tried += (now := _try_change(left, flights, change, amount, how))
            # an attitude tells axes of sensors from an order of rotors: no other change would do as well
            sure = "quaternion" in flight or change.remedy not in (MAP, ORDER)
            if now and now[0][0] < hopeful and sure and not change.between and change.make is not _left_out:
                hopeful = now[0][0]
                finals += (done := _try_change(left, flights, change, amount, LAST))
                if done and done[0][3].largest < ALARM:
                    return done
    again = list[Tried]()
    for _, change, amount, _ in _each_best(tried)[:SECOND]:
        between = _best_amount(left, flights, change, amount) if change.between else amount
        again += _try_change(left, flights, change, between, SOON)
    for _, change, amount, _ in _each_best(again)[:FINAL]:
        if not any(each[1] is change for each in finals):
            finals += _try_change(left, flights, change, amount, LAST)
    # a change must be worth its price, too, unless no gyro reads what this one did
    most = math.inf if _beyond_range(flight) else before.cost()
    worth = [each for each in finals if each[0] < most - (0.0 if each[3].largest < ALARM else GAIN)]
    best = sorted(worth, key=operator.itemgetter(0))
    rivals = [each for each in best[1:] if each[1].channel != best[0][1].channel and each[0] < best[0][0] + CLEAR]
    named = [*best[:1], *rivals[:1]]
    # nothing but an attitude tells them apart
    return named if "quaternion" in flight else sorted(named, key=lambda each: every.index(each[1]))


def _each_best(tried: Sequence[Tried]) -> list[Tried]:
    """Best amount of each change, the best change first."""
    best = dict[int, Tried]()
    for each in sorted(tried, key=operator.itemgetter(0)):
        best.setdefault(id(each[1]), each)
    return [*best.values()]


def _try_change(left: Leavings, flights: Flights, change: Change, amount: float, how: tuple[int, int]) -> list[Tried]:
    """Change by an amount with what it leaves; nothing where it cannot be flown."""
    stamped, aligned = flights
    # a wrong rate puts the clock of the poses off as well
    turned = change.channel in ("gyro", "quaternion") and stamped is not aligned
    changed = align_poses(change.of(stamped, amount))[0] if turned else change.of(aligned, amount)
    found = None if _beyond_range(changed) else left.rows(changed, *how)
    return [(found.cost() + change.price, change, amount, found)] if found else []


def _beyond_range(flight: FlightData) -> bool:
    """True if more than some samples of the gyro are beyond what any reads: it is of another unit."""
    return bool((np.abs(flight["gyro"].values) > RANGES["gyro"]).any(axis=1).mean() >= RARE)


def _best_amount(left: Leavings, flights: Flights, change: Change, amount: float) -> float:
    """Best amount of a change within those that are tried, from one of them by halves of the distance to the next."""
    amounts, costs = sorted(change.amounts), dict[float, float]()

    def cost(amount: float) -> float:
        if amount not in costs:
            tried = _try_change(left, flights, change, amount, SOON)
            costs[amount] = tried[0][3].cost(FINE) if tried else math.inf
        return costs[amount]

    step = 0.5 * min(b - a for a, b in pairwise(amounts))
    for _ in range(4):
        near = (amount, amount + step, amount - step)
        amount = min((each for each in near if amounts[0] <= each <= amounts[-1]), key=cost)
        step *= 0.5
    return amount


class Leavings:
    """Residuals of each sensor in windows of a vehicle's flights, with one plant for all flights of a kind.

    Args:
        start: vehicle before.
    """

    def __init__(self, start: Vehicle) -> None:
        self._start, self._plants = without_tilts(start), dict[tuple[object, ...], WindowErrors]()

    def rows(self, flight: FlightData, most: int, turns: int) -> Left | None:
        """Residuals after a fit of some turns to some windows of a flight; None where it has too few windows.

        Sizes are infinite of a flight whose motion under its commands is no number.
        """
        (flight,) = distinct_flights([flight])
        rate = flight["gyro"].rate
        if not RATES[0] <= rate <= RATES[1]:
            return None
        try:
            usual = clock_step([flight], self._start)
            step = usual * (1 if most >= LAST[0] else max(1, math.floor(COARSE / usual + 1e-6)))
            driven, servoed = moved_joints([flight], self._start)
            start = with_servos(self._start, servoed)
            windows = Windows(
                [on_clock(flight, start, step, sensors=SENSORS)], start, max(LENGTH, SAMPLES / rate), most
            )
            if windows.count < FEWEST:
                return None
            every = unknowns_of(start, curve=False, velocity=True, voltage=False, driven=driven, servoed=servoed)
            every += unknowns_of_sensors([flight])
            kind = (round(step, 9), *driven, *servoed, *(each.name for each in every))
            if kind in self._plants:
                errors = self._plants[kind].over(windows)
            else:
                errors = WindowErrors(windows, start, every, {}, driven, servoed, flight.gravity)
                self._plants[kind] = errors
        except (ValueError, np.linalg.LinAlgError):
            return None
        adrift = Left(dict.fromkeys(errors.rows, math.inf))
        try:
            with np.errstate(all="ignore"):
                fit = fit_windows(errors, np.array([each.begin for each in every]), turns=turns)
        except (ValueError, np.linalg.LinAlgError):
            return adrift
        white = first_noise(errors)[0]
        for j, (name, column) in enumerate(errors.rows):
            if name == "accelerometer":  # no log tells whether a sample is a mean, or when within its period it is
                change = 1.4826 * float(np.median(np.abs(np.diff(flight[name].values[:, column]))))
                white[j] = math.sqrt(white[j] ** 2 + max(0.0, change**2 - 2.0 * white[j] ** 2) / 12.0)
        # a mean of several samples is quieter than one
        means = np.array([math.sqrt(max(1.0, step * flight[name].rate)) for name, _ in errors.rows])
        least = np.array([LEAST[name] for name, _ in errors.rows])
        sizes = fit.noise[0] / np.maximum(white / means, least)
        keys = [*errors.rows, *((name, axis) for name in PUSHES for axis in range(3))]
        sizes = np.concatenate([sizes, fit.spread / errors.push])
        if not np.isfinite(sizes).all():
            return adrift
        off = [(value - each.begin) / each.spread for value, each in zip(fit.values, every, strict=True)]
        delay = float(fit.values[[each.name for each in every].index("delay")])
        return Left(dict(zip(keys, sizes.tolist(), strict=True)), float(np.square(off).sum()), delay)
