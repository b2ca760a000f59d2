"""Isolation of faults of axes, rotors, attitudes and clocks: the change after which all laws between channels hold.

A law fails if the channels as they are explain little of what a linear map of them explains. Candidates are signed
permutations of the axes, other readings of the quaternion, other orders of the rotors, and a turned frame. Of channels
that disagree, the one is named that a third channel contradicts, too (structured residuals: J. Gertler, Fault Detection
and Diagnosis in Engineering Systems, 1998).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import permutations
from typing import TypeAlias

import numpy as np

from skyarm.flight_data.clocks import clock_offset
from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.records.arrays import Array
from skyarm.studies.identify.channel_scales import REFUSED, Found, scale_of_forces, scale_of_rates, scale_of_velocity
from skyarm.studies.identify.data_compatibility import (
    Law,
    best_order,
    best_turn,
    effort_law,
    force_law,
    joint_law,
    rate_law,
    rotor_law,
    rotor_orders,
    signed_permutations,
    slope_law,
    tilt_law,
)
from skyarm.studies.identify.logged_commands import commanded_speeds
from skyarm.studies.identify.stretches import stretches_of
from skyarm.vehicle.vehicle_records import Rotor, Vehicle

Incompatible: TypeAlias = tuple[str, str, str, bool]
"""Channel, finding, remedy, and whether it spoils the numbers."""

FAILS, HOLDS = 0.6, 0.8
"""Scores below which a law fails, and from which on a candidate is believed."""

LATE = 0.05
"""s, lag of a channel that is reported."""

ROTORS = "rotor commands"
"""Name of the channel, whichever it is."""

MAP = "map its columns, their signs or its frame in columns.toml"

ORDER = "order the columns as the vehicle's rotors, or the rotors of the vehicle file as the columns"

READINGS: Mapping[str, Callable[[Array], Array]] = {
    "turns the other way: it looks inverse, from world to base": lambda q: q * [1.0, -1.0, -1.0, -1.0],
    "looks like x, y, z, w read as w, x, y, z": lambda q: q[:, [3, 0, 1, 2]],
    "looks like w, x, y, z read as x, y, z, w": lambda q: q[:, [1, 2, 3, 0]],
}
"""Words -> quaternion that was meant, from the one that was read."""


def incompatible_channels(flight: FlightData, start: Vehicle) -> Iterator[Incompatible]:
    """Yield the channels of a flight in the air that do not fit to the others or to the vehicle."""
    found = list(_incompatible_motion(flight, start))
    yield from found
    if not any(severe for *_, severe in found):  # the joints' dynamics needs rotors and rates
        yield from _joint_order(flight, start)


def _incompatible_motion(flight: FlightData, start: Vehicle) -> Iterator[Incompatible]:
    """Yield the channels of base and rotors that do not fit to the others or to the vehicle."""
    gyro = flight["gyro"]
    speeds = commanded_speeds(flight, start)
    joints = flight["joint_positions"] if start.n else None
    turning = rotor_law(gyro, speeds, start, joints)
    rates = rate_law(gyro, flight["quaternion"]) if "quaternion" in flight else None
    upside = _upside(flight["accelerometer"])
    if rates is not None and not _holds(rates):
        yield from _rates_and_attitude(flight, rates, turning, upside)
    elif turning is not None and not _holds(turning):
        yield from _rotors_and_rates(turning, rates, start, upside)
    elif upside:
        yield "accelerometer", upside, MAP, True
    else:
        if rates is not None:
            yield from _scales(scale_of_rates(flight, rates))
        if turning is not None:
            yield from _misplaced_rotors(turning, start.rotors)
        yield from _tilt_and_velocity(flight)
        yield from _forces(flight)
        yield from _scales(scale_of_velocity(flight))
        yield from _scales(scale_of_forces(flight))
    yield from _late_channels(flight, rates, turning)


def _scales(found: Iterator[Found]) -> Iterator[Incompatible]:
    for severity, channel, finding, remedy in found:
        yield channel, finding, remedy, severity == REFUSED


def _holds(law: Law, axes: Array | None = None) -> bool:
    return law.score(law.nominal, axes) >= FAILS


def _upside(accelerometer: Channel) -> str:
    """Words for an accelerometer that does not measure the thrust along z; empty if it does."""
    mean = accelerometer.values.mean(axis=0)
    along = mean / max(float(np.linalg.norm(mean)), 1e-9)
    if along[2] > 0.5:
        return ""
    k = int(np.argmax(np.abs(along)))
    axis = ("-" if along[k] < 0.0 else "") + "xyz"[k]
    return f"measures the thrust along {axis} rather than z, {mean[k]:.3g} m/s^2 on the mean"


FORWARD_RIGHT_DOWN = np.diag([1.0, -1.0, -1.0])


def _axes_words(mapping: Array) -> str:
    """Words for the axes that a signed permutation puts right: of each true axis the one that was read."""
    size = len(mapping)
    names = "xyz"[:size]
    changed = [i for i in range(size) if mapping[i, i] != 1.0]
    moved = [i for i in changed if mapping[i, i] == 0.0]
    if not moved:
        which = " and ".join(names[i] for i in changed)
        said = f"the sign of {which} looks turned" if len(changed) == 1 else f"the signs of {which} look turned"
        if size == 3 and changed == [1, 2]:
            said += ", as of forward, right, down (FRD) read as forward, left, up"
        return said
    read = ", ".join(
        ("-" if mapping[i].sum() < 0.0 else "") + names[int(np.argmax(np.abs(mapping[i])))] for i in range(size)
    )
    if len(moved) == 2 and all(mapping[i].sum() > 0.0 for i in range(size)):
        return f"{names[moved[0]]} and {names[moved[1]]} look swapped"
    return f"the axes look swapped or turned: {read} stand for {', '.join(names)}"


def _best_axes(law: Law, *others: Law) -> tuple[Array, float]:
    """Signed permutation of the inputs of a law that explains it best, and its score; the smallest change first."""
    best, top = np.eye(len(law.nominal)), -1.0
    for each in signed_permutations(len(law.nominal)):
        score = min([law.score(each @ law.nominal), *(other.score(other.nominal, each) for other in others)])
        if score > top + 0.02:
            best, top = each, score
    return best, top


def _rates_and_attitude(flight: FlightData, rates: Law, turning: Law | None, upside: str) -> Iterator[Incompatible]:
    """Yield the culprit of a gyro and an attitude that do not fit."""
    axes, score = _best_axes(rates)
    judge = turning if turning is not None and turning.visible.any() else None
    gyro_fits = judge is not None and _holds(judge)
    repaired = judge is not None and judge.score(judge.nominal, axes) >= HOLDS
    reading = _best_reading(flight, rates)
    if reading and (gyro_fits or not repaired):
        yield "quaternion", reading, "state order or inverse in columns.toml", True
    elif score >= HOLDS and not gyro_fits:
        beside = f", and the accelerometer {upside}" if upside else ""
        yield "gyro", _axes_words(axes) + " against the quaternion" + beside, MAP, True
    else:
        correlation = float(rates.shares(rates.nominal).mean())
        why = f"{_axes_words(axes)} against it" if score >= HOLDS else f"correlation {correlation:.2f}"
        finding = f"does not fit to the gyro: {why}"
        yield "quaternion", finding, "state frame, order and world in columns.toml", True


def _best_reading(flight: FlightData, rates: Law) -> str:
    """Words for the reading of the quaternion that fits to the gyro and to the velocity; empty if none does."""
    gyro, attitude = flight["gyro"], flight["quaternion"]
    found, best = "", rates.score(rates.nominal) + 0.2
    for words, meant in READINGS.items():
        other = Channel(time=attitude.time, values=meant(attitude.values), source=attitude.source)
        law = rate_law(gyro, other)
        score = law.score(law.nominal) if law is not None else 0.0
        tilt = tilt_law(other, flight["velocity"]) if "velocity" in flight else None
        if tilt is not None:
            score = min(score, tilt.score(tilt.nominal))
        if score > max(best, HOLDS):
            found, best = words, score
    return found


def _rotors_and_rates(turning: Law, rates: Law | None, start: Vehicle, upside: str) -> Iterator[Incompatible]:
    """Yield the culprit of rotors and rates that do not fit: the rotors, or the gyro if no attitude confirms it."""
    confirmed = rates is not None and bool(rates.visible.any())
    order, order_score = best_order(turning)
    axes = list(signed_permutations())
    axes_scores = [turning.score(turning.nominal, each) for each in axes]
    k = int(np.argmax(np.array(axes_scores) - 0.01 * np.arange(len(axes)) / len(axes)))
    down = next(i for i, each in enumerate(axes) if np.array_equal(each, FORWARD_RIGHT_DOWN))
    if upside and axes_scores[down] >= HOLDS:
        k = down
    angle, angle_score = best_turn(turning)
    if upside and axes_scores[k] >= HOLDS:
        yield "gyro", f"{_axes_words(axes[k])} against the rotors, and the accelerometer {upside}", MAP, True
    elif not confirmed and order_score >= max(HOLDS, axes_scores[k] - 0.05) and not _is_simple(axes[k]):
        also = f", or of the gyro {_axes_words(axes[k])}" if axes_scores[k] >= order_score - 0.1 else ""
        finding = f"{_order_words(order, start.rotors)} against the rotation that they cause{also}"
        yield ROTORS, finding, ORDER, True
    elif not confirmed and axes_scores[k] >= max(HOLDS, order_score - 0.02):
        also = f", or {_order_words(order, start.rotors)}" if order_score >= axes_scores[k] - 0.1 else ""
        yield "gyro", _axes_words(axes[k]) + f" against the rotors{also}", f"{MAP}; or {ORDER}" if also else MAP, True
    elif order_score >= HOLDS and order_score >= angle_score - 0.02:
        finding = f"{_order_words(order, start.rotors)} against the rotation that they cause"
        yield ROTORS, finding, ORDER, True
    elif angle_score >= HOLDS:
        yield turned_words(angle)
    else:
        finding = f"do not turn vehicle '{start.name}' as measured: correlation {turning.score(turning.nominal):.2f}"
        yield ROTORS, finding, "check order, signs and places of the rotors", True


def _is_simple(mapping: Array) -> bool:
    """True for one turned sign, or an exchange of two axes: mistakes of a mapping of columns."""
    return int((np.diag(mapping) != 1.0).sum()) == 1 or bool((mapping >= 0.0).all())


TURNED, BETTER = 25.0, 0.1
"""deg, turn of the rotors about z that is reported; and what the score must gain by a turn or another order."""

FEW = 4
"""Rotors of which an exchange of any two makes the law fail."""


def _misplaced_rotors(turning: Law, rotors: Sequence[Rotor]) -> Iterator[Incompatible]:
    """Yield rotors that stand turned about z or in another order, by less than makes a law fail."""
    plain = turning.score(turning.nominal)
    angle, score = best_turn(turning)
    order, order_score = best_order(turning)
    if abs(np.degrees(angle)) >= TURNED and score > max(plain + BETTER, order_score):
        yield turned_words(angle)
    elif order_score > max(plain + BETTER, HOLDS) and len(order) > FEW:
        finding = f"{_order_words(order, rotors)} against the rotation that they cause"
        yield ROTORS, finding, ORDER, True


def turned_words(angle: float) -> Incompatible:
    """Finding of rotors that turn the vehicle as if it stood at an angle (rad) to them."""
    finding = f"turn the vehicle as if it stood {np.degrees(angle):.0f} deg about z from its rotors' places"
    return ROTORS, finding, "turn the rotors of the vehicle file, or the IMU's axes", True


def _order_words(order: Sequence[int], rotors: Sequence[Rotor]) -> str:
    """Words for an order of the columns: the places at which each rotor of the vehicle stands."""
    count = len(order)
    moved = [i for i in range(count) if order[i] != i]
    mirrored = [_mirror_image(i, rotors) for i in range(count)]
    if list(order) == mirrored:
        return "the rotors look mirrored, left for right"
    if list(order) == list(range(count))[::-1]:
        return "the order of the rotors looks reversed"
    if len(moved) == 2:
        return f"rotors {moved[0] + 1} and {moved[1] + 1} look exchanged"
    back = list(np.argsort(order) + 1)
    return f"the rotors look ordered {', '.join(str(each) for each in back)}"


def _mirror_image(i: int, rotors: Sequence[Rotor]) -> int:
    """Number of the rotor that stands where another one's mirror image across the plane of symmetry would."""
    x, y = float(rotors[i].position.x), float(rotors[i].position.y)
    off = [np.hypot(float(each.position.x) - x, float(each.position.y) + y) for each in rotors]
    return int(np.argmin(off))


def _tilt_and_velocity(flight: FlightData) -> Iterator[Incompatible]:
    """Yield an attitude whose tilt does not explain the change of its velocity."""
    if "velocity" not in flight or "quaternion" not in flight:
        return
    law = tilt_law(flight["quaternion"], flight["velocity"])
    if law is None or _holds(law):
        yield from _position_and_velocity(flight)
        return
    axes, score = _best_axes(law)
    words = f"{_axes_words(axes)} against the tilt" if score >= HOLDS else "does not follow the tilt of the attitude"
    yield "velocity", words, "state world of velocity and quaternion in columns.toml", True


def _position_and_velocity(flight: FlightData) -> Iterator[Incompatible]:
    """Yield a position whose slopes are not the velocity."""
    if "position" not in flight:
        return
    law = slope_law(flight["velocity"], flight["position"])
    if law is None or _holds(law):
        return
    axes, score = _best_axes(law)
    words = f"{_axes_words(axes)} against the velocity" if score >= HOLDS else "its slopes are not the velocity"
    yield "position", words, "state world of position and velocity in columns.toml", False


def _forces(flight: FlightData) -> Iterator[Incompatible]:
    """Yield an accelerometer whose axes differ from those of the attitude."""
    if "velocity" not in flight or "quaternion" not in flight:
        return
    law = force_law(flight["accelerometer"], flight["quaternion"], flight["velocity"])
    if law is None or _holds(law):
        return
    axes, score = _best_axes(law)
    if score >= HOLDS:
        yield "accelerometer", f"{_axes_words(axes)} against velocity and attitude", MAP, True


def _late_channels(flight: FlightData, rates: Law | None, turning: Law | None) -> Iterator[Incompatible]:
    """Yield channels whose clocks are apart."""
    if rates is not None and rates.visible.any() and abs(rates.lag) > 0.5 * LATE:
        try:
            found = clock_offset(flight, "quaternion")
        except ValueError:  # the motion does not show it
            found = None
        if found is not None and abs(found.offset) - found.offset_error > LATE:
            way = "late" if found.offset < 0.0 else "early"
            finding = f"is {1e3 * abs(found.offset):.0f} ± {1e3 * found.offset_error:.0f} ms {way} against the gyro"
            yield "quaternion", finding, "identify aligns it (skyarm.flight_data.clocks.align_poses)", False
    if turning is not None and turning.visible.any() and abs(turning.lag) > LATE:
        ms = 1e3 * turning.lag
        words = "act {:.0f} ms late, beside the rotors' lag" if ms > 0.0 else "are {:.0f} ms behind the rotation"
        yield ROTORS, words.format(abs(ms)), "check the clock of commands and gyro", True


MOST = 3
"""Joints of which all orders are tried."""


def _joint_order(flight: FlightData, start: Vehicle) -> Iterator[Incompatible]:
    """Yield joints whose positions follow the commands or efforts of others, or against their own."""
    if not start.n:
        return
    remedy = "order the columns as the vehicle's joints, and check their signs"
    positions = flight["joint_positions"]
    if "joint_rates" in flight:
        slopes = slope_law(flight["joint_rates"], positions)
        if slopes is not None and not _holds(slopes):
            for words in joint_words(slopes, start):
                yield "joint_rates", f"{words} against the slopes of joint_positions", remedy, True
            return
    if "joint_commands" in flight:
        law = joint_law(flight["joint_commands"], positions)
        if law is not None and not _holds(law) and _follows(law):
            for words in joint_words(law, start):
                yield "joint_positions", f"{words} against the commands", remedy, True
    elif "joint_efforts" in flight:
        for words in _words_of_efforts(flight, start):
            yield "joint_positions", f"{words} against the efforts", remedy, True


FOLLOWED = 0.4
"""Least size of the joints' motion over that of their commands; a law may use setpoints of a servo as torques."""


def _follows(law: Law) -> bool:
    """True if the joints that move go about as far as commanded."""
    gains = law.gains[law.visible]
    return bool(((gains > FOLLOWED) & (gains < 1.0 / FOLLOWED)).all())


ENOUGH = 10.0
"""s, of a flight whose efforts are compared with the joints' motion."""


def _words_of_efforts(flight: FlightData, start: Vehicle) -> Iterator[str]:
    """Yield words for the order and signs of the joints under which the efforts explain their accelerations."""
    begin = flight["joint_efforts"].time[0]
    try:
        stretch = max(stretches_of(flight.section(begin, begin + ENOUGH), start), key=lambda each: each.size)
    except ValueError:  # of a flight that cannot be cut the fit says so
        return
    law = effort_law(stretch, start)
    # joint by joint: of two that are exchanged the proximal one may well follow the other's efforts
    if law is None or (law.shares(law.nominal)[law.visible] >= FAILS).all():
        return
    count = start.n
    names = [link.joint.name for link in start.links]
    best, top = "" if _holds(law) else "do not follow", HOLDS
    for order in _joint_orders(count):
        for turned in (), *((i,) for i in range(count)), tuple(range(count)):
            signs = np.where(np.isin(np.arange(count), turned), -1.0, 1.0)
            rows = {name: getattr(stretch, name)[:, list(order)] * signs for name in ("joints", "joint_rates")}
            law = effort_law(dataclasses.replace(stretch, **rows), start)
            score = 0.0 if law is None or not law.visible.any() else law.score(law.nominal)
            if score > top + 0.02:
                best, top = " and ".join(_joint_changes(order, signs, names)), score
    if best:
        yield best


def _joint_orders(count: int) -> Sequence[tuple[int, ...]]:
    """Orders of joints that are tried: all of a few, else exchanges of two."""
    if count <= MOST:
        return list(permutations(range(count)))
    return [each for each in rotor_orders(count) if sum(a != b for a, b in enumerate(each)) <= 2]


def _joint_changes(order: Sequence[int], signs: Array, names: Sequence[str]) -> Iterator[str]:
    """Yield words for an exchange and for turned signs of joints."""
    moved = [names[i] for i in range(len(names)) if order[i] != i]
    turned = [names[i] for i in range(len(names)) if signs[i] < 0.0]
    if moved:
        yield f"{' and '.join(moved)} look swapped"
    if turned:
        yield f"the sign of {' and '.join(turned)} looks turned"


def joint_words(law: Law, start: Vehicle) -> Iterator[str]:
    """Yield words for the exchange or sign of joints that explains a law between joints."""
    best, top = None, -1.0
    for order in _joint_orders(start.n):
        shares = law.shares(law.nominal[list(order)])
        signs = np.where((shares < 0.0) & law.visible, -1.0, 1.0)
        score = float(np.abs(shares)[law.visible].mean())
        if score > top + 0.05:
            best, top = (order, signs), score
    if best is None or top < HOLDS:
        yield "do not follow"
    else:
        yield from _joint_changes(*best, [link.joint.name for link in start.links])
