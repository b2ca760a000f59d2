"""Isolation of a logging fault: the correction of one channel after which the model
explains all sensors.

Of a sound flight, windows that the engine flies leave white noise in the row of every
sensor. If they do not, each change of a table is made in turn, and windows are fitted
anew: axes, signs, units, orders, ranges and clocks of channels, and channels left out.
The change that makes the rows white is named. What no change mends is no fault of a
channel: that is said of the model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, partial
from itertools import pairwise, product
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from skyarm.flight_data.clocks import POSE, align_poses
from skyarm.flight_data.flight_data import FlightData
from skyarm.identify.channel_changes import (
    CLOCK,
    JOINTS,
    MAP,
    ORDER_ROTORS,
    ROTOR_COMMANDS,
    ChannelChange,
    channel_changes,
    leave_out,
)
from skyarm.identify.identify_windows import SearchOptions, search_of
from skyarm.identify.log_checks import (
    RANGES,
    RARE,
    REFUSED,
    WARNED,
    Found,
    LogFault,
    check_log,
    faults_of,
)
from skyarm.identify.logged_commands import commanded_speeds, flying_spans
from skyarm.identify.possible_numbers import LONGEST_DELAY
from skyarm.identify.unknowns import USUAL_DELAY
from skyarm.identify.window_errors import WindowErrors
from skyarm.identify.window_fit import (
    LEAST,
    TURNS,
    first_noise,
    fit_windows,
    student_quantile,
)
from skyarm.identify.windows import SENSORS
from skyarm.records.immutable import positional
from skyarm.vehicle import Vehicle

Rows = Mapping[tuple[str, int], float]
"""Sensor and column -> RMS residual of the model over the sensor's white noise."""

PUSHES = ("unexplained force", "unexplained torque")
"""Rows of the window-dependent wrench, over its prior size."""


@positional
class Left:
    """Residuals of each sensor after a fit to windows of a flight, relative to the
    sensor's noise.

    Attributes:
        sizes: sizes of the rows. unusual: sum of squares of the numbers' distances from
            the start, over what was known.
        delay: s, of the commands.
    """

    sizes: Rows
    unusual: float = 0.0
    delay: float = USUAL_DELAY

    @property
    def largest(self) -> float:
        """Largest relative residual of all sensor axes and unexplained wrench
        components.
        """
        return max(self.sizes.values())

    def cost(self, fine: float = 0.0) -> float:
        """Cost of a fit: mean logarithm of the relative residuals, and a penalty for
        unusual parameters.

        Args:
            fine: cost of a white row, over its size; else none counts as less than
                white.
        """
        count = sum(name not in PUSHES for name, _ in self.sizes)
        white = sum(
            math.log(max(size, 1.0)) + fine * min(size, 1.0)
            for size in self.sizes.values()
        )
        return white / max(1, count) + UNUSUAL * self.unusual


ALARM, DOUBTFUL, ODD = 1.3, 3.0, 200.0
"""Thresholds: residual over white noise above which a row is unexplained; the same
above which the model is doubted; and squared distance of the parameters from the start
above which they describe no plausible vehicle."""

GAIN, AHEAD = 0.3, 0.1
"""Thresholds of the cost: least decrease of a reported change that does not make all
residuals white, and least advantage over another unit of a unit that is reported alone;
and that over changes of other channels."""

EVIDENCE, NEARER = 0.9, 0.25
"""Largest ratios to those before the correction: of the residual by which a fault is
named, and of the squared distance of an odd vehicle from its start, whose oddness a
gust in feedback may cause as well."""

UNUSUAL, FINE = 0.003, 0.1
"""Costs of a parameter one prior standard deviation off, and of white residuals, each
over its size.

The former tells of two changes that mend a flight as well the one after which the
vehicle is the start's; the latter tells amounts apart that all make white.
"""

QUICK, SOON, LAST = (12, 1), (12, 4), (60, TURNS)
"""Windows and iterations of a first search for each change, of a second one for some,
and of the last."""

SECOND, FINAL, HOPEFUL, HALVES = 8, 4, 0.8, 5
"""Number of changes searched a second and a third time; fraction of the cost below
which a change is searched at once; number of halvings of the distance to the next
amount."""

SECONDS, FLOWN, COARSE = 30.0, (20.0, 1e4), 4e-3
"""Duration (s) of a flight that is examined; range of gyroscope rates (Hz) whose
windows are simulated; longest step (s) of a first search.
"""

SHIFTED = "stamps are off by {:+.0f} ms, + is late"
"""Finding of a delay beyond any loop's; the same as of shifted stamps in
channel_changes.toml."""

LATE_POSE = 0.05
"""Delay (s) of a pose above which it is reported although it is aligned."""

BESIDE = {
    "gyro": ("gyro", "quaternion"),
    "quaternion": ("gyro", *POSE),
    "position": POSE,
    "velocity": ("position", "velocity"),
    "joint_rates": JOINTS,
}
"""Channel -> sensors that may be unexplained if it is at fault; other channels may
spoil any."""


class TriedChange(NamedTuple):
    """Tried correction of a channel: its amount, the residuals after it, and its
    cost.
    """

    cost: float
    change: ChannelChange
    amount: float
    left: Left


Flights = tuple[FlightData, FlightData]
"""Flight as it is stamped, and the same with its poses aligned to the gyroscope's
clock."""

Trial = Callable[[ChannelChange, float, tuple[int, int]], list[TriedChange]]
"""Function (change, amount, windows and iterations) -> residuals; empty where it cannot
be simulated."""


def find_faults(
    flight: FlightData, start: Vehicle, *, isolate: bool = True
) -> tuple[LogFault, ...]:
    """Find the faults of a measured flight, those that make it unusable first.

    Args:
        flight: measured.
        start: vehicle that its numbers will be identified for: rotors, joints and data
            sheet.
        isolate: look for the change of a channel that mends what the model does not
            explain: some ten seconds.
    """
    faults = check_log(flight, start)
    # a channel that is missing or in another unit would let no model fit
    if not any(each.severity == REFUSED for each in faults):
        faults += faults_of(
            flight.file,
            _isolate(flight, start, [each.channel for each in faults], isolate),
        )
    return tuple(sorted(faults, key=lambda each: each.severity != REFUSED))


def _isolate(
    flight: FlightData, start: Vehicle, faulty: Sequence[str], search: bool
) -> Iterator[Found]:
    """Yield faults found by a model fit: delayed poses, and residuals that the model
    does not explain.
    """
    try:
        student_quantile()
    except ValueError:  # of a page or a studio, which do not need it
        return
    aligned, clock = align_poses(flight)
    # a second before, or the section would lose SETTLING at its begin once more
    begin = flying_spans(commanded_speeds(flight, start), start)[0][0] - 1.0
    flights = (
        flight.section(begin, begin + SECONDS),
        aligned.section(begin, begin + SECONDS),
    )
    verdicts = list(_verdict(flights, start, faulty, search))
    if (
        clock is not None
        and abs(clock.offset) - clock.offset_error > LATE_POSE
        and "pose" not in [row[1] for row in verdicts]
    ):
        way = "late" if clock.offset < 0.0 else "early"
        off = 1e3 * abs(clock.offset)
        finding = (
            f"is {off:.0f} ± {1e3 * clock.offset_error:.0f} ms {way} against the gyro"
        )
        yield (
            WARNED,
            "quaternion",
            finding,
            "identify aligns it (skyarm.flight_data.clocks.align_poses)",
        )
    yield from verdicts


def _verdict(
    flights: Flights, start: Vehicle, faulty: Sequence[str], search: bool
) -> Iterator[Found]:
    """Yield the channel fault that explains the residuals, otherwise a warning that the
    model does not explain them.
    """
    left = Leavings(start)
    # without windows there is nothing to explain, and no fault
    before = left.rows(flights[1], *LAST) or Left({})
    sizes = {
        name: max(size for (of, _), size in before.sizes.items() if of == name)
        for name, _ in before.sizes
    }
    # what is wrong with a faulty channel is said already, and leaves its residual
    bad = [
        name
        for name in sorted(sizes, key=lambda name: -sizes[name])
        if sizes[name] >= ALARM and name not in faulty
    ]
    # the delay is searched, so late commands leave white rows and show in it alone
    if not bad and abs(before.delay) > LONGEST_DELAY:
        finding = SHIFTED.format(-1e3 * (before.delay - USUAL_DELAY))
        yield (
            REFUSED,
            ROTOR_COMMANDS,
            f"{finding}: they act {1e3 * before.delay:.0f} ms after they are stamped",
            CLOCK,
        )
    elif bad or before.unusual > ODD:
        if best := _best_changes(left, flights, start, before) if search else []:
            yield _name_fault(best, before, flights[1])
        elif bad and sizes[bad[0]] >= DOUBTFUL:
            noises = [
                f"{name} ({sizes[name]:.2g} times its noise)"
                for name in bad
                if name not in PUSHES
            ]
            pushes = [
                f"an {name} {sizes[name]:.2g} times what is usual"
                for name in bad
                if name in PUSHES
            ]
            parts = [f"does not explain {', '.join(noises)}"] if noises else []
            parts += [f"leaves {' and '.join(pushes)}"] if pushes else []
            finding = " and ".join(parts)
            if sizes[bad[0]] == math.inf:
                finding = "flies to infinity under the commands"
            remedy = "skyarm show FLIGHT --vehicle FILE looks for the cause"
            if search:
                remedy = (
                    "no change of a channel mends it: check the vehicle file; numbers"
                    " may be wrong by as much"
                )
            yield WARNED, "model", finding, remedy


def _name_fault(best: Sequence[TriedChange], before: Left, flight: FlightData) -> Found:
    """Describe the fault that a channel correction undoes, an equally good alternative,
    and the effect.
    """
    change, left = best[0].change, best[0].left
    rows = before.sizes
    after = left.sizes
    row = _telling_row(before, left)
    residual = f"the {row[0]}" if row[0] in PUSHES else f"the residual of {row[0]}"
    if rows[row] == math.inf:
        effect = "the motion under the commands is no number without this change"
    elif _is_certain(change, flight) and not _has_evidence(before, left):
        most = float(np.abs(flight["gyro"].values).max())
        effect = f"readings of up to {most:.3g} rad/s are beyond those of any gyroscope"
    elif before.unusual > ODD and rows[row] < ALARM:
        effect = (
            f"the start vehicle is {math.sqrt(before.unusual):.0f} standard deviations"
            " from what fits else"
        )
    elif row in after:
        effect = (
            f"{residual} falls from {rows[row]:.3g} times its noise to {after[row]:.2g}"
        )
    else:
        others = f"all others are at most {left.largest:.2g}"
        effect = (
            f"{residual} is {rows[row]:.3g} times its noise, and without it {others}"
        )
    words = [
        f"{each.change.channel}: {each.change.words.format(each.amount)}"
        for each in best
    ]
    finding = ", or ".join(words).removeprefix(f"{change.channel}: ")
    return change.severity, change.channel, f"{finding}: {effect}", change.remedy


def _telling_row(before: Left, after: Left) -> tuple[str, int]:
    """Row of a sensor whose residual a correction lowers most, among those that are not
    explained before it.
    """
    rows = before.sizes
    loud = [row for row in rows if row[0] not in PUSHES and rows[row] >= ALARM] or list(
        rows
    )
    # a row that the change leaves out counts as only just explained; 1e-3 bounds the
    # ratio of one that is left without error
    return max(loud, key=lambda row: rows[row] / max(after.sizes.get(row, ALARM), 1e-3))


def _has_evidence(before: Left, after: Left) -> bool:
    """True if what a fault would be named by falls: a residual, or the distance of an
    odd vehicle from the start.
    """
    row = _telling_row(before, after)
    if before.unusual > ODD and before.sizes[row] < ALARM:
        return after.unusual < NEARER * before.unusual
    return after.sizes.get(row, 0.0) < EVIDENCE * before.sizes[row]


def _best_changes(
    left: Leavings, flights: Flights, start: Vehicle, before: Left
) -> list[TriedChange]:
    """Best correction of a flight's channels, followed by an equally good correction of
    another channel, if any.
    """
    flight = flights[1]
    trial = partial(_try_change, left, flights)
    cost = attrgetter("cost")
    attitude = "quaternion" in flight
    every = [*channel_changes(flight, start)]
    bad = {name for (name, _), size in before.sizes.items() if size >= ALARM} or {
        name for name, _ in before.sizes
    }
    how = QUICK if bad - {*PUSHES} else SOON
    hopeful = HOPEFUL * (left.rows(flight, *how) or before).cost()
    tried, again, finals = list[TriedChange](), list[TriedChange](), list[TriedChange]()
    # units, signs and exchanges first, channels that are left out last
    for change in sorted(every, key=attrgetter("price")):
        # nothing but an attitude tells a wrong rate from what it would push
        around = BESIDE.get(
            change.names[0] if len(change.names) < 3 and attitude else "", bad
        )
        if not bad & {*around} or not any(name in flight for name in change.names):
            continue
        # an attitude tells axes of sensors from an order of rotors: no other change
        # would do as well
        sure = (
            (attitude or change.remedy not in (MAP, ORDER_ROTORS))
            and not change.between
            and change.make is not leave_out
        )
        for amount in change.amounts:
            tried += (now := trial(change, amount, how))
            if sure and now and now[0].cost < hopeful:
                hopeful = now[0].cost
                finals += (done := trial(change, amount, LAST))
                if (
                    done
                    and done[0].left.largest < ALARM
                    and _has_evidence(before, done[0].left)
                ):
                    return done
    ranked = _each_best(tried)
    # a turn hardly tells a flight without a channel from one with it
    out = [each for each in ranked[SECOND:] if each.change.make is leave_out]
    for _, change, amount, _ in [*ranked[:SECOND], *out]:
        again += trial(
            change,
            _best_amount(trial, change, amount) if change.between else amount,
            SOON,
        )
    for _, change, amount, _ in _each_best(again)[:FINAL]:
        if change not in [each.change for each in finals]:
            finals += trial(change, amount, LAST)
    # a change must be worth its price, too
    most = before.cost()
    worth = [
        each
        for each in finals
        if _is_certain(each.change, flight)
        or (
            each.cost < most - (0.0 if each.left.largest < ALARM else GAIN)
            and _has_evidence(before, each.left)
        )
    ]
    # without the channel at fault all else is explained; less to explain is left of a
    # wrong model, too
    best = sorted(
        (
            each
            for each in worth
            if each.change.make is not leave_out or each.left.largest < ALARM
        ),
        key=cost,
    )
    # units of a channel are rivals up to a gain: without an attitude other moments of
    # inertia fit another unit, too
    rivals = [
        each
        for each in best[1:]
        if (
            each.change.channel != best[0].change.channel
            and each.cost < best[0].cost + AHEAD
        )
        or (
            each.change.is_unit
            and best[0].change.is_unit
            and each.cost < best[0].cost + GAIN
        )
    ]
    named = [*best[:1], *rivals[:1]]
    # nothing but an attitude tells them apart
    return (
        named if attitude else sorted(named, key=lambda each: every.index(each.change))
    )


def _is_certain(change: ChannelChange, flight: FlightData) -> bool:
    """True for a unit of the gyroscope if its readings are beyond any: no residual need
    fall to show that.
    """
    return change.channel == "gyro" and change.is_unit and _beyond_range(flight)


def _each_best(tried: Sequence[TriedChange]) -> list[TriedChange]:
    """Each tried correction of a log at the size that leaves the least error; the best
    correction first.
    """
    best = dict[ChannelChange, TriedChange]()
    for each in sorted(tried, key=attrgetter("cost")):
        best.setdefault(each.change, each)
    return [*best.values()]


def _try_change(
    left: Leavings,
    flights: Flights,
    change: ChannelChange,
    amount: float,
    how: tuple[int, int],
) -> list[TriedChange]:
    """Try a correction of a given amount; empty if the corrected flight cannot be
    simulated.
    """
    stamped, aligned = flights
    # a wrong rate puts the clock of the poses off as well
    turned = change.channel in ("gyro", "quaternion")
    changed = (
        align_poses(change.of(stamped, amount))[0]
        if turned
        else change.of(aligned, amount)
    )
    leavings = None if _beyond_range(changed) else left.rows(changed, *how)
    return (
        [TriedChange(leavings.cost() + change.price, change, amount, leavings)]
        if leavings
        else []
    )


def _beyond_range(flight: FlightData) -> bool:
    """True if too many gyroscope samples exceed any sensor's range, which indicates
    another unit.
    """
    return bool(
        (np.abs(flight["gyro"].values) > RANGES["gyro"]).any(axis=1).mean() >= RARE
    )


def _best_amount(trial: Trial, change: ChannelChange, amount: float) -> float:
    """Best amount of a correction, refined from a tried amount by halving the distance
    to its neighbours.

    The distance is the larger one of both sides, so that no amount lies out of reach of
    the one that is next to it.
    """
    amounts = sorted(change.amounts)

    @cache
    def cost(amount: float) -> float:
        tried = trial(change, amount, SOON)
        return tried[0].left.cost(FINE) if tried else math.inf

    step = 0.5 * max(b - a for a, b in pairwise(amounts) if amount in (a, b))
    for _ in range(HALVES):
        near = (amount, amount + step, amount - step)
        amount = min(
            (each for each in near if amounts[0] <= each <= amounts[-1]), key=cost
        )
        step *= 0.5
    return amount


class Leavings:
    """Evaluator of sensor residuals in windows of flights, with one compiled plant per
    kind of flight.

    Args:
        start: vehicle before.
    """

    def __init__(self, start: Vehicle) -> None:
        self._start = start
        self._plants = dict[tuple[object, ...], WindowErrors]()

    def rows(self, flight: FlightData, most: int, turns: int) -> Left | None:
        """Relative residuals after some iterations of a fit to some windows of a
        flight; None with too few windows.

        Sizes are infinite of a flight whose motion under its commands is no number.
        """
        if not FLOWN[0] <= flight["gyro"].rate <= FLOWN[1]:
            return None
        try:
            search = search_of(
                [flight],
                self._start,
                SearchOptions(gravity=flight.gravity),
                sensors=SENSORS,
                # a first search only ranks changes, so longer steps do
                coarse=COARSE if most < LAST[0] else 0.0,
            )
            step = search.flights[0].step
            names = (each.name for each in search.unknowns)
            kind = (round(step, 9), *search.driven, *search.servoed, *names)
            # flights with the same unknowns and step fly on one compiled plant
            errors = search.errors(search.first, most, self._plants.get(kind))
            self._plants[kind] = errors
        # a change may leave a flight that no window fits: it is no candidate then
        except (ValueError, np.linalg.LinAlgError):
            return None
        adrift = Left(dict.fromkeys(errors.rows, math.inf))
        try:
            # overflow is an answer here, and told by what is not finite below
            with np.errstate(all="ignore"):
                fit = fit_windows(errors, search.begin, turns=turns)
        except (ValueError, np.linalg.LinAlgError):
            return adrift
        sizes = dict(
            zip(
                product(PUSHES, range(3)),
                (fit.spread / errors.push).tolist(),
                strict=True,
            )
        )
        rows = zip(
            errors.rows,
            fit.noise[0].tolist(),
            first_noise(errors)[0].tolist(),
            strict=True,
        )
        for (name, column), noise, white in rows:
            channel = flight[name]
            square = white**2
            # no log tells whether a sample is a mean, or when within its period it is:
            # anywhere within it, the variance is a twelfth of the square of a step
            if name == "accelerometer":
                change = 1.4826 * float(
                    np.median(np.abs(np.diff(channel.values[:, column])))
                )
                square += max(0.0, change**2 - 2.0 * square) / 12.0
            # a mean of several samples is quieter than one
            usual = math.sqrt(square / max(1.0, step * channel.rate))
            sizes[name, column] = noise / max(usual, LEAST[name])
        if not all(map(math.isfinite, sizes.values())):
            return adrift
        off = [
            (value - each.begin) / each.spread
            for value, each in zip(fit.values, search.unknowns, strict=True)
        ]
        delay = float(fit.values[errors.names.index("delay")])
        return Left(sizes, float(np.square(off).sum()), delay)
