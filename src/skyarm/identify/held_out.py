"""Prediction of held-out flights: errors of the identified vehicle, of the start
vehicle and of constant velocity.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from itertools import islice, product

import numpy as np

from skyarm.algebra import Quaternion, Vec3
from skyarm.flight_data.flight_data import FlightData
from skyarm.flight_data.series import rotations_between
from skyarm.identify.held_out_errors import (
    CURVE,
    HOLD,
    IDENTIFIED,
    ORDER,
    PAST,
    SHORTEST,
    START,
    HeldOut,
    HorizonErrors,
    OneStep,
)
from skyarm.identify.identified_numbers import Identified
from skyarm.identify.identified_parts import surroundings_with
from skyarm.identify.identify_windows import USUAL, SearchOptions, distinct_flights
from skyarm.identify.logged_commands import slowest_lag
from skyarm.identify.open_loop import (
    FIELDS,
    NONE,
    SLOPE,
    BaseStates,
    OpenLoopPredictor,
    no_poses,
    places_of,
    window_states,
)
from skyarm.identify.unknowns import THRUST
from skyarm.identify.window_errors import NormalEquations, WindowErrors, WindowStates
from skyarm.identify.window_fit import (
    Reduced,
    first_noise,
    loose_with,
    new_noise,
    new_spread,
    reduce,
    student_quantile,
)
from skyarm.identify.windows import ClockedWindows, clock_step, on_clock
from skyarm.records.arrays import Array, IntArray, Mask
from skyarm.records.immutable import positional
from skyarm.vehicle import Vehicle

APART = 0.1
"""Time (s) between the starts of two predictions; chosen, as nearer ones tell much the
same."""

LEARNT, ONCE = 300, 2000
"""Largest number of predictions in the fitted flights that determine how a past counts,
and of one-step predictions; chosen, for the time that they take."""

PASTS, MEMORIES = (0.1, 0.35), (0.0, 0.1, 1.0)
"""Candidate durations (s) of the past that shows the unexplained part, and candidate
decay times (s) of its variable fraction; chosen, and few, as each pair is flown."""

SMOOTHED = ((), ("position", "velocity"), ("quaternion", "rate"), FIELDS)
"""Candidate sets of state fields that are taken from the window of the past, where
smoothing measures them better."""

WORSE = 1.01
"""Ratio of the error with the past to that without up to which both count as equal,
chosen."""

FAR = 0.2
"""Shortest horizon (s) for the choice, if there is one; below it the error is mostly
measurement noise."""

LASTING = 3.0
"""Time (s) over which the mean unexplained wrench is taken to last. A fit leaves no
mean in its own flights, so they cannot show it; in others battery, wind and trim may
differ."""

ROUNDS = 4
"""Number of iterations of the estimate of sensor noise and wrench spread, chosen; the
spread is estimated from the second on."""


def predict_held_out(
    found: Identified,
    start: Vehicle,
    flights: Sequence[FlightData],
    options: SearchOptions = USUAL,
    *,
    seen: Sequence[FlightData] = (),
    horizons: Sequence[float] = CURVE,
) -> HeldOut:
    """Predict flights from their commands by the identified vehicle, the start vehicle
    and constant velocity.

    Where flights of the fit with poses are given, the identified vehicle predicts once
    more, from what a window of a flight's past tells of the state and of the wrench
    that the commands do not explain, and weighted beside holding as those flights show
    is best. The start vehicle flies with the delays and offsets that were thought of
    before the fit.

    Args:
        found: identified vehicle and surroundings.
        start: vehicle before.
        flights: flights to predict.
        options: options of the search; its sections are those of the flights of the
            fit.
        seen: flights of the fit.
        horizons: s.

    Raises:
        ValueError: one line: no flight is long enough for a prediction.
    """
    flights = distinct_flights(flights)
    seen = distinct_flights(seen) if seen else []
    step = clock_step([*flights, *seen], start)
    # every horizon is then a whole number of steps; 1e-9, so that rounding adds none
    step = SHORTEST / math.ceil(SHORTEST / step - 1e-9)
    posed = [i for i, each in enumerate(flights) if not no_poses(each)]
    learnt = [each for each in seen if posed and not no_poses(each)]
    every = [*flights, *learnt]
    count = len(flights)
    clocks = [
        on_clock(
            each,
            start,
            step,
            full_voltage=options.full_voltage,
            sections=options.sections if i >= count else (),
        )
        for i, each in enumerate(every)
    ]
    thrusts = [found.surroundings.thrust] * count
    thrusts += [
        found.searched.get(f"{THRUST}{each.name}", found.surroundings.thrust)
        for each in learnt
    ]
    before = surroundings_with(
        {**{each.name: each.start for each in found.numbers}, **options.known}
    )
    identified = OpenLoopPredictor(
        found.vehicle, found.surroundings, every, clocks, options.gravity, thrusts
    )
    at_start = OpenLoopPredictor(
        start, before, flights, clocks[:count], options.gravity
    )
    # all predictors begin at the same instants, where the slower rotors are known, too
    slower = max((found.vehicle, start), key=slowest_lag)

    def begins(which: Collection[int], behind: float, apart: float) -> list[IntArray]:
        """Start steps of predictions in some flights, ``apart`` s apart, from
        ``behind`` s into each usable part on.
        """
        rows = [
            places_of(each, slower, max(1, round(apart / step)), behind)
            for each in clocks
        ]
        return [each if i in which else each[:0] for i, each in enumerate(rows)]

    # all predictors from the same instants on, of those that have a past if there are
    # any
    ahead = posed or range(count)
    past = None
    begun = begins(ahead, max(PASTS) if learnt else 0.0, APART)
    of_fit = thin_places(begins(range(count, len(every)), max(PASTS), APART), LEARNT)
    windows = identified.windows(begun)
    if (
        learnt
        and any(map(len, of_fit))
        and (identified.left(windows.windows) * step > max(horizons)).any()
    ):
        past = learn_from_past(identified, identified.windows(of_fit), horizons)
    else:
        begun = begins(ahead, 0.0, APART)
        windows = identified.windows(begun)
    names = tuple(each.name for each in flights)
    # 1e-9 s is rounding
    if identified.left(windows.windows).max(initial=0) * step < min(horizons) - 1e-9:
        raise ValueError(
            f"{', '.join(names)}: no stretch is long enough for a prediction"
        )
    ends = ends_of(identified, windows, horizons, identified.begins(windows.windows))
    errors = {
        IDENTIFIED: [errors_of(each, WHOLE) for each in ends],
        HOLD: [errors_of(each, NOTHING) for each in ends],
    }
    if past is not None:
        ends = ends_of(identified, windows, horizons, *past.begins(identified, windows))
        errors[PAST] = [
            errors_of(each, shares)
            for each, shares in zip(ends, past.shares, strict=True)
        ]
    windows = at_start.windows(begun[:count])
    ends = ends_of(at_start, windows, horizons, at_start.begins(windows.windows))
    errors[START] = [errors_of(each, WHOLE) for each in ends]
    once = thin_places(begins(range(count), 0.0, step), ONCE)
    period, one_step, spread = one_step_errors(identified, once)
    _, one_step_before, _ = one_step_errors(at_start, once[:count])
    if not posed:
        errors = {
            name: [
                replace(each, position=math.nan, velocity=math.nan, attitude=math.nan)
                for each in rows
            ]
            for name, rows in errors.items()
        }
    return HeldOut(
        flights=names,
        period=period,
        horizons=tuple(horizons),
        errors={name: errors[name] for name in ORDER if name in errors},
        one_step={IDENTIFIED: one_step, START: one_step_before, HOLD: spread},
        has_poses=bool(posed),
        notes=_notes(flights, start),
    )


def thin_places(places: Sequence[IntArray], most: int) -> list[IntArray]:
    """Thin out the start steps of predictions in several flights evenly, to about a
    given number.
    """
    every = -(-sum(map(len, places)) // most)
    return [each[:: max(1, every)] for each in places]


def _notes(flights: Sequence[FlightData], start: Vehicle) -> tuple[str, ...]:
    """Notes on partly measured poses and on the joint motion of predicted flights."""
    notes = []
    for flight in flights:
        if note := no_poses(flight):
            notes.append(f"{flight.name}: {note}")
        elif "velocity" not in flight:
            words = (
                f"the velocity is the slope of the position over {SLOPE:g} s, of begins"
                f" over the {SLOPE:g} s before"
            )
            notes.append(f"{flight.name}: {words}")
        elif "position" not in flight:
            notes.append(f"{flight.name}: the position is the sum of the velocity")
    if start.n:
        notes.append(
            "The motion of the joints is given as measured; over a few periods its"
            " noise is most of an error."
        )
    return tuple(notes)


PARTS = ("position", "velocity", "attitude", "rate")
"""Fields of a state whose prediction errors are reported."""

WHOLE, NOTHING = (np.array([[part], [0.0]]) * np.ones(3) for part in (1.0, 0.0))
"""Weights of a prediction by the model alone, and by holding the state."""


@positional(eq=False)
class Ends:
    """Predicted and measured states one horizon after K start instants, relative to a
    constant-velocity prediction.

    Attributes:
        horizon: s.
        off: (4, 2, K, 3) of position, velocity, attitude (rotation vector, base axes)
            and rate: by the model, and by rest at the begin's pose.
        measured: (4, K, 3).
    """

    horizon: float
    off: Array
    measured: Array


def ends_of(
    loop: OpenLoopPredictor,
    errors: WindowErrors,
    horizons: Sequence[float],
    begins: BaseStates,
    pushes: Callable[[float], Array] | None = None,
) -> list[Ends]:
    """Predict the base states at several horizons (s) after the starts of windows.

    The arguments are those of :meth:`OpenLoopPredictor.ahead`.
    Predictions that leave what is usable before their end are none.
    """
    windows = errors.windows
    step = windows.step
    left = loop.left(windows)
    ends = [round(each / step) for each in horizons]
    last = max((k for k in ends if (left >= k).any()), default=0)
    flown = {
        k: states
        for k, states in enumerate(islice(loop.ahead(errors, begins, pushes), last + 1))
        if k in ends
    }
    still = replace(begins, velocity=0.0 * begins.velocity, rate=0.0 * begins.rate)
    predictions = []
    for horizon, k in zip(horizons, ends, strict=True):
        rows = np.flatnonzero(left >= k)
        steady = begins.at(rows).at_even_rates(k * step)
        # windows that end before are read at their end here, and left out with rows
        measured = loop.measured_at(windows, np.minimum(k, left))
        every = (flown.get(k, still), still, measured)
        *off, there = (_difference(steady, each.at(rows)) for each in every)
        # of a horizon that no part is long enough for there are no rows
        predictions.append(Ends(horizon, np.stack(off, axis=1), there))
    return predictions


def _difference(first: BaseStates, second: BaseStates) -> Array:
    """Differences (4, K, 3) between two sets of base states: position, velocity,
    attitude and rate.
    """
    return np.stack(
        [
            second.position - first.position,
            second.velocity - first.velocity,
            rotations_between(first.quaternion, second.quaternion),
            second.rate - first.rate,
        ]
    )


def errors_of(ends: Ends, shares: Array) -> HorizonErrors:
    """Root mean square errors of the model's prediction combined with a base at rest,
    weights (2, 3) or (4, 2, 3).
    """
    predicted = (ends.off * shares[..., None, :]).sum(axis=1)
    left = ends.measured - predicted
    # rotation vectors do not subtract: of attitudes the turn between both counts
    turn = PARTS.index("attitude")
    left[turn] = rotations_between(
        *(_attitudes(each[turn]) for each in (predicted, ends.measured))
    )
    count = left.shape[1]
    sizes = [math.sqrt((rows**2).sum() / count) if count else math.nan for rows in left]
    return HorizonErrors(
        horizon=ends.horizon, begins=count, **dict(zip(PARTS, sizes, strict=True))
    )


def _attitudes(turns: Array) -> Array:
    """Unit quaternions (K, 4) of rotation vectors (K, 3)."""
    return np.stack(list(Quaternion.of_rotation_vector(Vec3(*turns.T))), axis=1)


def shares_of(ends: Ends) -> Array:
    """Least-squares weights (4, 2, 3) of the model and of a base at rest in a
    prediction (Bates and Granger 1969).

    A controller keeps a vehicle where a model alone, from a state that is known a
    little wrong, departs from it; the longer the horizon, the less of the model's
    prediction counts. Flights must be those of the fit, not the predicted. All of the
    model counts over a horizon that no part is long enough for.
    """
    if not ends.measured.shape[1]:
        return np.stack([WHOLE] * len(PARTS))
    student_quantile()  # whose one-line error names the cure where SciPy is missing
    from scipy.optimize import lsq_linear

    # over a few samples all parts are within the noise: beyond 0 to 1 they would only
    # fit that
    sizes = np.linalg.norm(ends.off, axis=2) + 1e-300
    shares = np.empty_like(sizes)
    for i, j in np.ndindex(len(sizes), 3):
        # columns of length 1, and bounds likewise: free of units; with two unknowns
        # bvls ends at the exact optimum
        size = sizes[i, :, j]
        shares[i, :, j] = (
            lsq_linear(
                ends.off[i, :, :, j].T / size,
                ends.measured[i, :, j],
                (0.0, size),
                "bvls",
            ).x
            / size
        )
    return np.asarray(shares)


@positional(eq=False)
class PastWeight:
    """Settings of a prediction that uses the flight before it, such as how long
    estimated disturbances last.

    Attributes:
        seconds: s, of the window before each begin that tells the unexplained wrench.
        noise: (flights, sensor axes) of the sensors. spread: (6,) of the wrench, N and
            N m.
        smoothed: fields of the state with which predictions begin that are the
            window's; others are as measured.
        memory: s, in which what is beside the wrench's mean over :data:`LASTING` fades;
            0 leaves it out.
        shares: over each horizon, of the model and of rest beside holding, as of
            :func:`shares_of`.
    """

    seconds: float
    noise: Array
    spread: Array
    smoothed: tuple[str, ...]
    memory: float
    shares: Sequence[Array]

    def begins(
        self, loop: OpenLoopPredictor, errors: WindowErrors
    ) -> tuple[BaseStates, Callable[[float], Array]]:
        """Base states at the starts of windows, and the expected unexplained wrench
        over time (s) since then.
        """
        state, wrench = end_of_past(loop, errors, self.seconds, self.noise, self.spread)
        begins = _replace_fields(loop.begins(errors.windows), state, self.smoothed)
        return begins, fading(wrench, errors.windows, self.memory)


def _replace_fields(
    states: BaseStates, others: BaseStates, names: Sequence[str]
) -> BaseStates:
    """Replace some fields of base states by those of others."""
    return replace(states, **{name: getattr(others, name) for name in names})


def learn_from_past(
    loop: OpenLoopPredictor, errors: WindowErrors, horizons: Sequence[float]
) -> PastWeight:
    """Choose how predictions use a flight's past, by position and attitude errors in
    the identification flights.

    What makes neither of them larger than without a past goes before what does.

    Args:
        loop: open loop of all flights.
        errors: errors of windows in the flights of the fit.
        horizons: s.
    """
    chosen = list[PastWeight]()
    least = (True, math.inf)
    without = [
        errors_of(each, WHOLE)
        for each in ends_of(loop, errors, horizons, loop.begins(errors.windows))
    ]
    for seconds in PASTS:
        before = past_windows(loop, errors.windows, seconds)
        noise, spread = noises_of(before, loop.begins(before.windows))
        state, wrench = end_of_past(loop, errors, seconds, noise, spread)
        for smoothed, memory in product(SMOOTHED, MEMORIES):
            begins = _replace_fields(loop.begins(errors.windows), state, smoothed)
            ends = ends_of(
                loop, errors, horizons, begins, fading(wrench, errors.windows, memory)
            )
            shares = [shares_of(each) for each in ends]
            rows = [
                errors_of(each, share) for each, share in zip(ends, shares, strict=True)
            ]
            counted = [
                pair for pair in zip(rows, without, strict=True) if pair[0].begins
            ]
            far = [pair for pair in counted if pair[0].horizon >= FAR] or counted
            good = [
                a.position <= WORSE * b.position and a.attitude <= WORSE * b.attitude
                for a, b in far
            ]
            score = (
                not all(good),
                sum(
                    # logarithms weigh a tenth of either error alike, whatever its unit;
                    # that of no error would be infinite
                    math.log(max(each.position * each.attitude, 1e-300))
                    for each, _ in far
                ),
            )
            if score < least:
                chosen = [PastWeight(seconds, noise, spread, smoothed, memory, shares)]
                least = score
    return chosen[0]


def past_windows(
    loop: OpenLoopPredictor, windows: ClockedWindows, seconds: float
) -> WindowErrors:
    """Windows of a given length (s) that end where other windows begin."""
    places = (
        windows.begins - windows.firsts[windows.owners] - round(seconds / windows.step)
    )
    return loop.windows(
        [places[windows.owners == i] for i in range(len(windows.flights))], seconds
    )


def noises_of(before: WindowErrors, begins: BaseStates) -> tuple[Array, Array]:
    """Maximum-likelihood noise (flights, sensor axes) and spread (6,) of the
    unexplained wrench.

    A row that no window has keeps what differences of its samples tell; flights without
    windows take the noise of the others.
    """
    states = window_states(begins)
    spread = before.push
    noise = first_noise(before)
    for turn in range(ROUNDS):
        errors, there, normal, reduced, states = _turn(before, states, noise, spread)
        noise = new_noise(before, errors, there, noise, normal, reduced.inverse)
        # in the first turn the noise is that of the samples alone, not of residuals
        if turn:
            spread = new_spread(before, states, spread, reduced.inverse)
    own = np.isin(np.arange(len(noise)), before.windows.owners)
    measured = there.any(axis=(0, 1))
    # flights to predict may have no window: their sensors are those of the fit; the
    # least of these, as 1 stands where a flight lacks the sensor
    noise[np.ix_(~own, measured)] = noise[np.ix_(own, measured)].min(axis=0)
    return noise, spread


def _turn(
    before: WindowErrors, states: WindowStates, noise: Array, spread: Array
) -> tuple[Array, Mask, NormalEquations, Reduced, WindowStates]:
    """One Gauss-Newton step in initial states and unexplained wrenches of windows, with
    known vehicle parameters.

    Returns:
        Residuals and mask (steps, W, sensor axes), the equations at the given states,
        the same reduced to the windows' own unknowns, and the states after the step.
    """
    errors, there, normal = before.normal(NONE, states, noise)
    reduced = reduce(normal, states.beside, loose_with(before, spread), NONE)
    return errors, there, normal, reduced, states.moved_by(-reduced.shift)


def end_of_past(
    loop: OpenLoopPredictor,
    errors: WindowErrors,
    seconds: float,
    noise: Array,
    spread: Array,
) -> tuple[BaseStates, Array]:
    """Base states at the starts of windows and unexplained wrenches (W, 6), estimated
    from data before each start.
    """
    before = past_windows(loop, errors.windows, seconds)
    states = window_states(loop.begins(before.windows))
    # noise and spread are known here, unlike in noises_of; two turns are chosen
    for _ in range(2):
        *_, states = _turn(before, states, noise, spread)
    begins = BaseStates(*(states.parts[name] for name in FIELDS))
    *_, last = islice(
        loop.ahead(before, begins, lambda _: states.beside), before.windows.length + 1
    )
    return last, states.beside


def fading(
    wrench: Array, windows: ClockedWindows, memory: float
) -> Callable[[float], Array]:
    """Function that predicts the unexplained wrench (W, 6) a time (s) after the starts
    of windows: decay to a mean.

    Args:
        wrench: (W, 6), estimated at the begins.
        windows: windows that begin there; the mean is of those before, of the same
            flight.
        memory: s.
    """
    # a mean whose weights fade with the time before, made window by window
    lasting, counts = wrench.copy(), np.ones((len(wrench), 1))
    for j in range(1, len(wrench)):
        if windows.owners[j] == windows.owners[j - 1]:
            left = math.exp(
                -(windows.begins[j] - windows.begins[j - 1]) * windows.step / LASTING
            )
            lasting[j] += left * lasting[j - 1]
            counts[j] += left * counts[j - 1]
    lasting /= counts
    return lambda t: (
        lasting + (math.exp(-t / memory) if memory else 0.0) * (wrench - lasting)
    )


def one_step_errors(
    loop: OpenLoopPredictor, places: Sequence[IntArray]
) -> tuple[float, OneStep, OneStep]:
    """Accelerometer period (s), errors of mean accelerations predicted over one period,
    and spread of measured ones.
    """
    count = loop.averaged
    # a sample's mean is of the period before it: of two periods one is flown whole
    whole = loop.left(loop.windows(places).windows) >= 2 * count
    each_of = np.split(whole, np.cumsum([len(each) for each in places])[:-1])
    places = [each[long] for each, long in zip(places, each_of, strict=True)]
    errors = loop.windows(places, 2 * count * loop.flights[0].step)
    windows = errors.windows
    begins = loop.begins(windows)
    residuals, there = errors.errors_at(NONE, window_states(begins))
    column = errors.rows.index(("accelerometer", 0))
    counted, left = there[:, :, column], residuals[:, :, column : column + 3]
    at = windows.begins + np.arange(windows.length)[:, None]
    force = errors.samples["accelerometer"].values[at]
    *_, last = islice(loop.ahead(errors, begins), count + 1)
    period = count * windows.step
    turned = (
        loop.measured_at(windows, count).rate - loop.measured_at(windows, 0).rate
    ) / period
    off = turned - (last.rate - begins.rate) / period
    model = OneStep(
        specific_force=_length(left[counted]), angular_acceleration=_length(off)
    )
    rows = [each - each.mean(axis=0) for each in (force[counted], turned)]
    return (
        period,
        model,
        OneStep(specific_force=_length(rows[0]), angular_acceleration=_length(rows[1])),
    )


def _length(rows: Array) -> float:
    """Root mean square length of the vectors in the rows of an array."""
    return math.sqrt(float((rows**2).sum(axis=1).mean()))
