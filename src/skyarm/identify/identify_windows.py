"""Identification of a vehicle from short windows of its flights, by simulating each
window.

A fit to windows gives the information of what was measured. That of an unlogged pose
beside it follows from the slopes of the flown windows and a usual noise; of joints'
efforts that are known, their hat functions are no longer free.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from functools import partial

import numpy as np

from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.flight_data.quantities import GRAVITY
from skyarm.identify.identified_numbers import (
    APART,
    LAGS,
    NOT_SHOWN,
    Identified,
    Scale,
    at_starts,
    bound_number,
    condition_on_start,
    identified_numbers,
    scale_of,
)
from skyarm.identify.identified_parts import surroundings_with, vehicle_with
from skyarm.identify.logged_commands import (
    are_samples,
    as_samples,
    command_samples,
    commanded_speeds,
    sampling_period,
)
from skyarm.identify.unknowns import (
    Unknown,
    reported_of,
    require_searched,
    unknowns_of,
    with_servos,
    without_tilts,
)
from skyarm.identify.window_errors import WindowErrors
from skyarm.identify.window_fit import (
    WindowFit,
    first_noise,
    fit_windows,
    loose_with,
    reduce,
    variances_of,
)
from skyarm.identify.windows import Clocked, ClockedWindows, clock_step, on_clock
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable, positional
from skyarm.vehicle import Vehicle

FIRST, WHOLE, SLOW = 0.06, 0.25, 1.0
"""Lengths (s) of the first windows, whose problem is nearly linear, of the last ones,
and with commands below 40 Hz, of which some must lie in a window: ten at 10 Hz."""

FEW, SOME = 200, 60
"""Largest number of first windows, and number of full-length windows with which the
last search begins; chosen, for the time of its first turns."""

FEWEST = 4
"""Least number of windows."""

BRIEF, ALIKE = 4, ("joint_efforts", "joint_commands")
"""Least number of samples of a channel, chosen, and quantities that all flights must
contain or none."""

SAMPLES = 12
"""Least number of gyroscope samples in a window."""

FINEST, UNMOVED = 16, 0.05
"""Largest number of integration steps per sample, and change of the readings by halving
them, as a fraction of the noise."""

EARLIEST, EARLY = -0.75, -0.15
"""Range of the delay of held commands, in their periods, that shows them to be samples:
half a period and less, by their dead time."""

TURNING, LATE = 0.05, 0.005
"""Prior standard deviations of a gyroscope's bias (rad/s), 3 deg/s, and of a pose's
delay (s), beyond that which was aligned; chosen."""


@immutable(eq=False)
class SearchOptions:
    """Options of an identification: parts of the flights to use, and parameters to
    search.

    Attributes:
        curve: find a thrust curve of its own in place of the start's times a factor.
        drag_height: the rotors' hub drag acts at a height of its own.
        full_voltage: V, at which the start's thrust holds; 0 leaves the battery's
            voltage out.
        sections: (begin, end), s, of each flight that count; by default all in which
            the vehicle flies.
        known: numbers that are not searched, by name.
        gravity: m/s^2.
    """

    curve: bool = False
    drag_height: bool = False
    full_voltage: float = 0.0
    sections: Sequence[tuple[float, float]] = ()
    known: Mapping[str, float] = field(default_factory=dict)
    gravity: float = GRAVITY


USUAL = SearchOptions()


@positional(eq=False)
class WindowSearch:
    """Search for the vehicle parameters that windows of flights may identify.

    Attributes:
        flights: on one clock, with different names. start: vehicle before, with a servo
            on each servo joint.
        unknowns: unknowns to search. every: unknowns with the known ones. known: other
            numbers by name.
        driven: whether the effort of each joint is logged. servoed: whether a position
            servo moves it.
        slow: whether commands were logged below 40 Hz. sample: s, between readings of
            the gyroscope.
        gravity: m/s^2.
    """

    flights: Sequence[Clocked]
    start: Vehicle
    unknowns: Sequence[Unknown]
    every: Sequence[Unknown]
    known: Mapping[str, float]
    driven: Sequence[bool]
    servoed: Sequence[bool]
    slow: bool
    sample: float
    gravity: float

    @property
    def begin(self) -> Array:
        """Start values (P,) of the searched parameters; logarithms for positive
        ones.
        """
        return np.array([each.begin for each in self.unknowns])

    @property
    def first(self) -> float:
        """Length (s) of the short windows of the first fit."""
        return max(FIRST, SAMPLES * self.sample)

    @property
    def whole(self) -> float:
        """Length (s) of the full-length windows of the final fit."""
        return SLOW if self.slow else max(WHOLE, SAMPLES * self.sample)

    def errors(
        self,
        seconds: float,
        most: int = 0,
        before: WindowErrors | None = None,
        finer: int = 1,
    ) -> WindowErrors:
        """Residuals of flight windows of a given length (s), thinned evenly if there
        are more than a given number.

        Args:
            seconds: length of a window, s.
            most: windows; 0 for all.
            before: errors of other windows, whose plant in machine code serves these
                too.
            finer: least number of integration steps within a step of a new plant.

        Raises:
            ValueError: one line: there are hardly any windows.
        """
        windows = ClockedWindows(self.flights, self.start, seconds, most)
        if windows.count < FEWEST:
            names = ", ".join(each.name for each in self.flights)
            raise ValueError(
                f"{names}: {windows.count} of the {FEWEST} parts of {seconds:.3g} s"
                " that are needed lie in the air without a gap: fly longer"
            )
        if before is not None:
            return before.over(windows)
        return WindowErrors(
            windows,
            self.start,
            self.unknowns,
            self.known,
            self.driven,
            self.servoed,
            self.gravity,
            finer,
        )

    def scale(self, fit: WindowFit) -> Scale:
        """Linearise the reported parameters about an estimate."""
        return scale_of(fit, self.unknowns, reported_of(self.every), self.known)

    def hidden_lags(self) -> set[str]:
        """Names of the actuator lags that commands logged below 40 Hz cannot
        identify.
        """
        return set(LAGS) if self.slow else set()


def search_of(
    flights: Sequence[FlightData],
    start: Vehicle,
    options: SearchOptions = USUAL,
    *,
    sensors: Sequence[str] = (),
    coarse: float = 0.0,
) -> WindowSearch:
    """Set up the parameter search for flights; the arguments are those of
    :func:`identify_by_windows`.

    ``sensors`` are compared, as of :func:`on_clock`, in as many steps of the usual
    clock at once as fit into ``coarse``, s; all numbers are searched by them.
    """
    flights, start = distinct_flights(flights), without_tilts(start)
    step = clock_step(flights, start)
    # 1e-6, so that rounding takes no step away
    step *= max(1, math.floor(coarse / step + 1e-6))
    clocked = [
        on_clock(
            each,
            start,
            step,
            full_voltage=options.full_voltage,
            sections=options.sections,
            sensors=sensors,
        )
        for each in flights
    ]
    driven, servoed = moved_joints(flights, start)
    start = with_servos(start, servoed)
    every = unknowns_of(
        start,
        curve=options.curve,
        velocity=True,
        voltage=any(bool(np.ptp(each.voltage) > 0.0) for each in clocked),
        driven=driven,
        servoed=servoed,
        drag_height=options.drag_height,
        others=[each.name for each in flights[1:]],
    )
    has_places = any(
        name in each for each in flights for name in ("position", "velocity")
    )
    # changes of a channel are ranked by the same numbers with a pose and without it
    if not has_places and not sensors:
        # the drag of rotors shows in forces; that of the body, by the square of the
        # speed, would be that of any speed
        every = [each for each in every if not each.name.startswith("drag.area.")]
    every += unknowns_of_sensors(flights)
    given = options.known
    require_searched(given, every)
    unknowns = [each for each in every if each.name not in given]
    slow = any(sampling_period(commanded_speeds(each, start)) for each in flights)
    sample = max(1.0 / each["gyro"].rate for each in flights)
    return WindowSearch(
        clocked,
        start,
        unknowns,
        every,
        given,
        driven,
        servoed,
        slow,
        sample,
        options.gravity,
    )


def first_fits(
    search: WindowSearch, progress: Callable[[str], None] | None = None
) -> tuple[WindowErrors, WindowFit]:
    """Fit parameters to some full-length windows, after a nearly linear fit to shorter
    windows.

    Dry friction that bends within small rates needs integration steps that only the fit
    can tell: they are halved until that hardly moves what is flown (steps of a log were
    7 % off beside intervals of 0.02 %, where friction bends within 0.01 rad/s).

    Returns:
        Errors of the full-length windows, and the fit to them.
    """
    short = search.errors(search.first, FEW)
    near = fit_windows(short, search.begin, lasting=search.slow, progress=progress)
    some = search.errors(search.whole, SOME, short)
    fit_again = partial(fit_windows, lasting=search.slow, progress=progress)
    fit = fit_again(some, near.values, noise=near.noise, spread=near.spread)
    # dry friction alone bends within rates that steps may jump over
    while (
        any(each.name.endswith(".coulomb") for each in search.unknowns)
        and some.replay.substeps < FINEST
    ):
        finer = search.errors(search.whole, SOME, finer=2 * some.replay.substeps)
        # on the same samples, or placing them anew would pass for an effect of the
        # steps
        finer.samples, finer.taken = some.samples, some.taken
        moved = (finer.errors_at(fit.values, fit.states)[0] - fit.errors) / fit.noise[
            some.windows.owners
        ]
        if np.sqrt(np.mean(moved**2, axis=(0, 1))).max() < UNMOVED:
            break
        some = finer
        fit = fit_again(some, fit.values, noise=fit.noise, spread=fit.spread)
    return some, fit


def identify_by_windows(
    flights: Sequence[FlightData],
    start: Vehicle,
    options: SearchOptions = USUAL,
    progress: Callable[[str], None] | None = None,
) -> Identified:
    """Identify the parameters of a vehicle from flights whose clocks agree.

    Args:
        flights: flights with gyro, accelerometer and rotor commands; of an arm,
            positions of the joints.
        start: vehicle with what is known before.
        options: options of the search.
        progress: called with one line a turn of the search.

    Raises:
        ValueError: one line: flights that do not fit the vehicle, or nothing to
            identify, or SciPy is missing.
    """
    search = search_of(flights, start, options)
    some, near = first_fits(search, progress)
    if act_early(search, near, flights):
        # goes one deep, because samples do not act early a second time
        sampled = [as_samples(each) for each in flights]
        return replace(
            identify_by_windows(sampled, start, options, progress), sampled=True
        )
    errors = search.errors(search.whole, before=some)
    fit = fit_windows(
        errors,
        near.values,
        noise=near.noise,
        spread=near.spread,
        lasting=search.slow,
        progress=progress,
    )
    start = with_servos(start, search.servoed)
    unknowns = search.unknowns
    windows = errors.windows
    scale, unseen = search.scale(fit), search.hidden_lags()
    free, correlation = identified_numbers(
        fit, scale, search.sample, [each.name for each in search.flights]
    )
    numbers = [
        bound_number(each, of.least)
        for each, of in zip(free, scale.reported, strict=True)
    ]
    # what commands below 40 Hz cannot show goes back to the start; the dead time then
    # stands for all that is late
    numbers = [
        replace(each, reason=NOT_SHOWN) if each.name in unseen else each
        for each in numbers
    ]
    shares = np.array(
        [
            0.0 if before.is_known and not now.is_known else now.data_share
            for before, now in zip(free, numbers, strict=True)
        ]
    )
    # -inf: put back before all others, whatever the fit says of them
    shares[[each.name in unseen - {"delay"} for each in numbers]] = -math.inf
    # of a number of the vehicle and one around it that look alike, it is the vehicle
    # that stays as it was
    inside = {each.name for each in unknowns if each.in_vehicle}
    of_vehicle = [any(part in inside for part in each.parts) for each in scale.reported]
    groups = [
        [i for i, each in enumerate(of_vehicle) if each is first]
        for first in (True, False)
    ]
    conditioned = condition_on_start(
        fit.values, fit.curvature, scale.rows, scale.off, scale.before, shares, groups
    )
    for k, other in conditioned.beside.items():
        numbers[k] = replace(numbers[k], reason=f"{APART}{numbers[other].name}")
    plain = at_starts(
        errors.numbers(conditioned.values),
        scale,
        conditioned.replaced,
        [each.name for each in unknowns],
        {k: each.value for k, each in enumerate(numbers) if each.is_known},
        errors.numbers(fit.values),
    )
    explained, deviation = explained_shares(errors, fit)
    names = [each.name for each in scale.reported]
    costs = costs_of_absent(errors, fit, scale.rows) if fit.settled else {}
    return Identified(
        numbers=tuple(numbers),
        correlation=correlation,
        vehicle=vehicle_with(start, plain, checked=True),
        surroundings=surroundings_with(plain),
        explained=explained,
        deviation=deviation,
        settled=fit.settled,
        seconds=windows.count * windows.length * windows.step,
        searched=plain,
        period=search.sample,
        absent={
            channel: dict(zip(names, ratios.tolist(), strict=True))
            for channel, ratios in costs.items()
        },
        counted=tuple(
            bool((windows.owners == i).any()) for i in range(len(search.flights))
        ),
    )


def act_early(
    search: WindowSearch, fit: WindowFit, flights: Sequence[FlightData]
) -> bool:
    """True if held commands would act before they come, by half their period: they are
    samples of a faster loop's.
    """
    names = [each.name for each in search.unknowns]
    if "delay" not in names or search.slow or any(map(are_samples, flights)):
        return False
    # the slowest commands count
    period = max(
        1.0 / command_samples(commanded_speeds(each, search.start)).rate
        for each in flights
    )
    return EARLIEST * period < float(fit.values[names.index("delay")]) < EARLY * period


def distinct_flights(flights: Sequence[FlightData]) -> list[FlightData]:
    """Recorded flights, renamed apart, less quantities of few samples and positions
    that lack an attitude.

    Raises:
        ValueError: one line: there is no flight, or one lacks a quantity that decides
            how another is flown.
    """
    if not flights:
        raise ValueError("flights: must be one or more")
    names = [each.name for each in flights]
    distinct = list[FlightData]()
    for i, flight in enumerate(flights):
        name = (
            flight.name if names.count(flight.name) == 1 else f"{flight.name} ({i + 1})"
        )
        # without an attitude no thrust says where the vehicle goes
        out = () if "quaternion" in flight else ("position", "velocity")
        channels = {
            each: flight[each]
            for each in flight
            if each not in out and flight[each].time.size >= BRIEF
        }
        distinct.append(replace(flight, name=name, channels=channels))
    for quantity in ALIKE:
        there = [each.name for each in distinct if quantity in each]
        lacking = [each.name for each in distinct if quantity not in each]
        if there and lacking:
            raise ValueError(
                f"{lacking[0]}: {quantity}: is not in this flight, and is in"
                f" {there[0]}: identify them apart"
            )
    return distinct


def moved_joints(
    flights: Sequence[FlightData], start: Vehicle
) -> tuple[list[bool], list[bool]]:
    """Two flags per joint: its efforts are logged; only the setpoints of its position
    servo are.
    """

    def logged(quantity: str, joint: int) -> bool:
        # a column of zeros is that of a joint which nothing drives by it
        return any(
            quantity in each and bool(np.any(each[quantity].values[:, joint]))
            for each in flights
        )

    driven = [logged("joint_efforts", i) for i in range(start.n)]
    return driven, [
        not torque and logged("joint_commands", i) for i, torque in enumerate(driven)
    ]


def unknowns_of_sensors(flights: Sequence[FlightData]) -> list[Unknown]:
    """Unknowns of the sensors: bias of the gyroscope, and delay of a measured pose."""
    names = [f"gyro_bias.{axis}" for axis in "xyz"]
    unknowns = [
        Unknown(name=each, unit="rad/s", start=0.0, spread=TURNING, in_vehicle=False)
        for each in names
    ]
    if any("quaternion" in each for each in flights):
        unknowns.append(
            Unknown(
                name="pose_delay", unit="s", start=0.0, spread=LATE, in_vehicle=False
            )
        )
    return unknowns


def explained_shares(
    errors: WindowErrors, fit: WindowFit
) -> tuple[dict[str, float], dict[str, float]]:
    """Fraction of each sensor axis' variance that the model explains, and standard
    deviation of its errors.
    """
    names = {"gyro": "rate", "accelerometer": "specific_force"}
    windows = errors.windows
    white = first_noise(errors)[windows.owners] ** 2
    at = windows.begins + np.arange(windows.length)[:, None]
    explained, deviation = dict[str, float](), dict[str, float]()
    for i, (sensor, column) in enumerate(errors.rows):
        if sensor in names:
            name = f"{names[sensor]}.{'xyz'[column]}"
        elif sensor == "joint_positions":
            name = f"{errors.start.links[column].joint.name}.position"
        else:
            continue
        there = fit.counted[:, :, i].astype(float)
        noise = float((there * white[:, i]).sum())
        left = float((there * fit.errors[:, :, i] ** 2).sum())
        bends = float(
            (
                _without_lines(errors.samples[sensor].values[at, column], there) ** 2
            ).sum()
        )
        if max(bends, left) > noise:  # else the row does not move
            # the larger of both below, so that no share is under 0
            explained[name] = 1.0 - max(left - noise, 0.0) / max(
                bends - noise, left - noise
            )
        deviation[name] = math.sqrt(left / max(there.sum(), 1.0))
    return explained, deviation


def _without_lines(rows: Array, there: Array) -> Array:
    """Subtract a straight line from the samples (steps, windows) of each window; 0
    where the mask ``there`` is 0.
    """
    count = np.maximum(there.sum(axis=0), 1.0)
    time = np.arange(len(rows), dtype=float)[:, None] * there
    time = there * (time - time.sum(axis=0) / count)
    rows = there * (rows - (there * rows).sum(axis=0) / count)
    slope = (time * rows).sum(axis=0) / np.maximum((time**2).sum(axis=0), 1e-300)
    return np.asarray(rows - time * slope)


NOISE, PERIOD = {"position": 0.001, "quaternion": 0.002}, 0.01
"""Noise (m, rad) and sampling time (s) assumed for a pose that is not measured: those
of motion capture."""

KNOWN = 1e-3
"""Fraction of the prior information that an effort keeps if it is not logged:
practically none."""


def costs_of_absent(
    errors: WindowErrors, fit: WindowFit, rows: Array
) -> dict[str, Array]:
    """Ratios (K,) of confidence intervals without a channel to those with it, by the
    name of each unlogged channel.

    Args:
        errors: errors of all windows.
        fit: fit to them.
        rows: (K, P) slopes of the reported numbers in the searched ones.
    """
    prior = np.array([each.spread for each in errors.unknowns])
    loose = loose_with(errors, fit.spread)

    # no outliers: of a channel that is not there no error says anything, only slopes
    def widths(errors: WindowErrors, noise: Array, loose: Array) -> Array:
        _, _, normal = errors.normal(fit.values, fit.states, noise, outlier=math.inf)
        total = reduce(normal, fit.states.beside, loose, prior).total
        return np.sqrt(variances_of(rows, np.asarray(np.linalg.inv(total))))

    absent = [
        name
        for name in NOISE
        if not any(name in each.channels for each in errors.windows.flights)
    ]
    if "quaternion" not in absent and any(
        "velocity" in each.channels for each in errors.windows.flights
    ):
        # a position tells nothing beyond the velocity but where the flight was
        absent = []
    if not absent and not errors.unlogged:
        return {}
    costs, measured = dict[str, Array](), widths(errors, fit.noise, loose)
    if absent:
        # a copy, as the windows of the fit keep their own flights
        windows = copy.copy(errors.windows)
        windows.flights = [_with_pose(each, absent) for each in windows.flights]
        more = errors.over(windows)
        more.take_samples(fit.values)
        usual = np.array([[NOISE.get(name, 1.0) for name, _ in more.rows]])
        noise = np.repeat(usual, len(fit.noise), axis=0)
        noise[:, [more.rows.index(row) for row in errors.rows]] = fit.noise
        costs["pose" if "quaternion" in absent else "position"] = measured / widths(
            more, noise, loose
        )
    if errors.unlogged:
        effort_knots = np.array([name == "hats" for name, _ in errors.free])
        costs["joint_efforts"] = measured / widths(
            errors, fit.noise, np.where(effort_knots, KNOWN * loose, loose)
        )
    return costs


def _with_pose(flight: Clocked, absent: list[str]) -> Clocked:
    """Flight with placeholder samples of unlogged channels, of which only the presence
    matters.
    """
    time = np.arange(flight.begin, flight.edges[-1], PERIOD)
    rows = {
        "position": np.zeros((time.size, 3)),
        "quaternion": np.tile([1.0, 0.0, 0.0, 0.0], (time.size, 1)),
    }
    more = {
        name: Channel(time=time, values=rows[name], source="absent") for name in absent
    }
    return replace(flight, channels={**flight.channels, **more})
