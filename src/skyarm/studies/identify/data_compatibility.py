"""Compatibility of a flight's channels: rates against attitude, attitude against velocity, rotors against rotation.

Each law compares two signals (N, k) that are equal up to noise if axes, signs and clocks are right. The multiple
correlation of each row says how much of it any linear map explains; a candidate map is judged by the share of that
which it explains (data compatibility: V. Klein, E. A. Morelli, Aircraft System Identification, 2006, chapter 10).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import permutations, product

import numpy as np

from skyarm.algebra.frames import to_base, turn_vectors
from skyarm.dynamics.actuators.rotor import push
from skyarm.dynamics.array_front import mass_matrix
from skyarm.flight_data.clocks import rotation_steps
from skyarm.flight_data.flight_data import Channel
from skyarm.flight_data.quantities import GRAVITY
from skyarm.flight_data.series import attitude_at, common_span, integral_of, means_of, middle, thin_samples
from skyarm.records.arrays import Array, Mask
from skyarm.records.immutable import immutable
from skyarm.studies.identify.identified_parts import Surroundings
from skyarm.studies.identify.logged_commands import highest_speeds, time_constants
from skyarm.studies.identify.motion_model import Stretch, predict
from skyarm.studies.identify.required_flight import wrench_of_pushes
from skyarm.studies.identify.rotor_lag import lag_response
from skyarm.studies.identify.sampled_series import moving_mean
from skyarm.vehicle.vehicle_records import Vehicle

ROWS = 40
"""Fewest rows of a comparison."""

VISIBLE, FAINT, PLAIN = 0.35, 0.15, 0.6
"""Least multiple correlation of a row that is judged; of rotors, whose rotation drowns in noise; and of rates
and positions, which follow each other."""

CERTAIN = 30.0
"""Least square of the multiple correlation times the rows: noise gives about 5."""

CLIPPED = 6.0
"""Robust standard deviations at which both signals are cut off, so that a shock does not decide."""

ATTITUDE_STEP, VELOCITY_STEP, ROTOR_STEP = 0.06, 0.1, 0.03
"""Shortest intervals, s, over which attitudes, velocities and rates are differenced."""

COMMAND_STEP = 0.004
"""s, period of the rotors' response to commands."""

LATEST, LAG_STEP, COARSE = 0.25, 0.01, 4
"""Lags that are searched, s to both sides, their grid, and the steps of it that are tried first."""

AIRBORNE, SETTLED = 0.5, 1.0
"""Of the weight, thrust at which a vehicle flies; s, over which it is averaged."""


@immutable(kw_only=False, eq=False)
class Law:
    """Two signals without mean that should be equal, at the lag at which they fit best, as their second moments.

    Attributes:
        rows: number of samples.
        inputs: (m, m) sums of products of the signal that explains, mixed: (m, k) with the measured one, own: (k,) sums
            of squares of that.
        nominal: (k, m) map from the inputs to the measured signal if nothing is wrong.
        explained: (k,) multiple correlation of each row of the measured signal with all inputs.
        lag: s, of the measured signal behind the inputs.
        least: multiple correlation from which on a row is judged.
    """

    rows: int
    inputs: Array
    mixed: Array
    own: Array
    nominal: Array
    explained: Array
    lag: float
    least: float = VISIBLE

    @property
    def visible(self) -> Mask:
        """Rows (k,) that the inputs explain well enough to judge a map by them."""
        return (self.explained >= self.least) & (self.explained**2 * self.rows >= CERTAIN)

    def shares(self, mapping: Array, axes: Array | None = None) -> Array:
        """Correlation of each row with that of a map, over the multiple correlation; 1 of the best, -1 of its opposite.

        Args:
            mapping: (k, m) from the inputs.
            axes: (k, k) signed permutation from the measured axes to the true ones; as they are by default.
        """
        if axes is not None:
            mapping = axes.T @ mapping
        top = (mapping * self.mixed.T).sum(axis=1)
        below = np.sqrt(np.maximum((mapping @ self.inputs * mapping).sum(axis=1), 0.0) * self.own) * self.explained
        return np.asarray(top / np.maximum(below, 1e-300))

    def score(self, mapping: Array, axes: Array | None = None) -> float:
        """Mean share of the visible rows; 1 where no row is visible."""
        seen = self.visible
        return float(self.shares(mapping, axes)[seen].mean()) if seen.any() else 1.0

    @property
    def ratios(self) -> Array:
        """Size (k,) of the measured signal, with its noise, over that of the nominal map."""
        given = (self.nominal @ self.inputs * self.nominal).sum(axis=1)
        return np.asarray(np.sqrt(self.own / np.maximum(given, 1e-300)))

    @property
    def gains(self) -> Array:
        """Size (k,) of the measured signal over that of the nominal map, of what explains it."""
        return self.ratios * self.explained


def signed_permutations(size: int = 3) -> Iterator[Array]:
    """Yield the (size, size) maps that exchange axes and turn signs, those that change least first."""
    plain = np.eye(size)
    orders, signs = permutations(range(size)), list(product((1.0, -1.0), repeat=size))
    found = [np.diag(sign) @ plain[list(order)] for order in orders for sign in signs]
    yield from sorted(found, key=lambda each: int((each != plain).any(axis=1).sum()))


def rate_law(gyro: Channel, attitude: Channel) -> Law | None:
    """Rates of the attitude (measured) against those of the gyro (inputs), rad/s; None of a short flight."""
    time, turned = thin_samples(attitude, ATTITUDE_STEP)
    if len(time) < ROWS or gyro.time.size < ROWS:
        return None
    steps = np.diff(time)
    even = np.abs(steps - np.median(steps)) < 0.2 * np.median(steps)
    rates = rotation_steps(turned) / steps[:, None]
    return _best(_step_means(gyro.time, gyro.values, time, rates, even), np.eye(3))


def tilt_law(attitude: Channel, velocity: Channel) -> Law | None:
    """Slopes of the flown specific force over the ground (measured) against the tilt of the thrust axis (inputs).

    A multirotor is accelerated along its z axis: x and y of dv/dt + g over z are those of the attitude's z axis.
    None of a flight that is too short.
    """
    time, speeds = thin_samples(velocity, VELOCITY_STEP)
    if len(time) < ROWS or attitude.time.size < ROWS:
        return None
    force = slopes_of(time, speeds) + np.array([0.0, 0.0, GRAVITY])
    slopes = force[:, :2] / np.maximum(force[:, 2:], 0.3 * GRAVITY)
    axes = turn_vectors(attitude.values, np.tile([0.0, 0.0, 1.0], (attitude.time.size, 1)))
    means = _step_means(attitude.time, axes, time, slopes)

    def at(lag: float) -> tuple[Array, Array]:
        axis, measured = means(lag)
        return axis[:, :2] / np.maximum(axis[:, 2:], 0.2), measured

    return _best(at, np.eye(2))


def force_law(accelerometer: Channel, attitude: Channel, velocity: Channel) -> Law | None:
    """Specific force by velocity and attitude, base axes (measured), against the accelerometer (inputs), m/s^2."""
    time, speeds = thin_samples(velocity, VELOCITY_STEP)
    if len(time) < ROWS or accelerometer.time.size < ROWS:
        return None
    force = slopes_of(time, speeds) + np.array([0.0, 0.0, GRAVITY])
    felt = to_base(attitude_at(attitude, middle(time)), force)
    return _best(_step_means(accelerometer.time, accelerometer.values, time, felt), np.eye(3))


def rotor_law(gyro: Channel, speeds: Channel, vehicle: Vehicle, joints: Channel | None = None) -> Law | None:
    """Changes of the rates (measured) against the rotors' pushes over the same time (inputs), in the air.

    Args:
        gyro: rad/s.
        speeds: commanded speeds of the vehicle's rotors, rad/s.
        vehicle: rotors, and inertia at the mean of the joints' positions.
        joints: positions; without them those of the vehicle's zero.

    Returns:
        The law, or None of a flight that is too short or never in the air.
    """
    begin, end = common_span(gyro, speeds)
    time = np.arange(begin, end, COMMAND_STEP)
    if len(time) * COMMAND_STEP < SETTLED:
        return None
    pushes = rotor_pushes(speeds, vehicle, time)
    thrust = pushes @ np.array([float(each.thrust_coefficient) for each in vehicle.rotors])
    flies = moving_mean(thrust, round(SETTLED / COMMAND_STEP) | 1) > AIRBORNE * GRAVITY * float(vehicle.mass)
    width = max(ROTOR_STEP, 2.0 / gyro.rate, 2.0 / max(speeds.rate, 1e-9))
    edges = np.arange(begin + LATEST, end - LATEST, width)
    mean, push_mean = means_of(gyro.time, gyro.values), means_of(time, integral_of(time, pushes))
    if len(edges) < ROWS:
        return None
    changes = _changes(mean, edges)
    used = np.interp(edges[1:-1], time, flies.astype(float)) > 0.5

    def at(lag: float) -> tuple[Array, Array]:
        return _changes(push_mean, edges - lag)[used], changes[used]

    resting = np.zeros(vehicle.n) if joints is None else np.median(joints.values, axis=0)
    return _best(at, turning_of(vehicle, resting), FAINT) if used.sum() >= ROWS else None


def rotor_pushes(speeds: Channel, vehicle: Vehicle, time: Array) -> Array:
    """Squared speeds of the rotors (N, rotors), (rad/s)^2, at even instants (N,) s, after the vehicle's lag."""
    held = speeds.values[np.maximum(np.searchsorted(speeds.time, time + 1e-6, side="right") - 1, 0)]
    lags = np.maximum(1e-3, time_constants(vehicle.rotors)[0]).tolist()
    _, squares, _ = lag_response(np.clip(held, 0.0, highest_speeds(vehicle.rotors)), COMMAND_STEP, 0.0, *lags)
    return np.stack([push(r, np.sqrt(x)) for r, x in zip(vehicle.rotors, squares.T, strict=True)], axis=1)


def turning_of(vehicle: Vehicle, joints: Array) -> Array:
    """Angular acceleration (3, rotors), base axes, by the push of each rotor, (rad/s^2) / (rad/s)^2, joints held."""
    inertia = mass_matrix(vehicle, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), joints)[:6, :6]
    return np.asarray(np.linalg.solve(inertia, wrench_of_pushes(vehicle.rotors))[3:])


def joint_law(commands: Channel, positions: Channel) -> Law | None:
    """Rates of the joints' positions (measured) against those of the commanded ones (inputs)."""
    begin, end = common_span(commands, positions)
    edges = np.arange(begin + LATEST, end - LATEST, VELOCITY_STEP)
    if len(edges) < ROWS:
        return None
    mean, wanted = means_of(positions.time, positions.values), means_of(commands.time, commands.values)
    moved = _changes(mean, edges)

    def at(lag: float) -> tuple[Array, Array]:
        return _changes(wanted, edges - lag), moved

    return _best(at, np.eye(positions.values.shape[1]), PLAIN)


def slope_law(rates: Channel, positions: Channel) -> Law | None:
    """Slopes of positions (measured) against the rates that should be their derivatives (inputs)."""
    time, rows = thin_samples(positions, VELOCITY_STEP)
    if len(time) < ROWS or rates.time.size < ROWS or rates.values.shape[1] != rows.shape[1]:
        return None
    means = _step_means(rates.time, rates.values, time, slopes_of(time, rows))
    return _best(means, np.eye(rows.shape[1]), PLAIN)


def effort_law(stretch: Stretch, vehicle: Vehicle) -> Law | None:
    """Accelerations of the joints (measured) against those by the vehicle's dynamics under the efforts (inputs)."""
    found = predict(vehicle, Surroundings(), stretch, (True,) * vehicle.n)[:, 6:]
    moved = np.diff(stretch.joint_rates, axis=0) / stretch.period
    every = max(1, round(ROTOR_STEP / stretch.period))
    rows = len(moved) // every * every

    def at(lag: float) -> tuple[Array, Array]:
        late = max(0, round(lag / stretch.period))
        pair = np.roll(found[:rows], late, axis=0), moved[:rows]
        inputs, measured = (each.reshape(-1, every, vehicle.n).mean(axis=1) for each in pair)
        return inputs, measured

    return _best(at, np.eye(vehicle.n)) if rows >= ROWS * every else None


def slopes_of(time: Array, values: Array) -> Array:
    """Differences of successive values over those of their times."""
    return np.diff(values, axis=0) / np.diff(time)[:, None]


def _changes(mean: Callable[[Array, Array], Array], edges: Array) -> Array:
    """Differences of the means over successive steps between instants."""
    return np.diff(mean(edges[:-1], edges[1:]), axis=0)


def _step_means(
    source: Array, values: Array, time: Array, measured: Array, used: Mask | bool = True
) -> Callable[[float], tuple[Array, Array]]:
    """Function from a lag (s) to means of values over steps that much earlier, and what is measured in those.

    Args:
        source: times of the values, s.
        values: that are averaged.
        time: instants between which the steps lie.
        measured: of each step.
        used: True for each step that counts.
    """
    mean = means_of(source, values)

    def at(lag: float) -> tuple[Array, Array]:
        begin, end = time[:-1] - lag, time[1:] - lag
        inside = used & (begin >= source[0]) & (end <= source[-1])
        return mean(begin[inside], end[inside]), measured[inside]

    return at


def _best(at: Callable[[float], tuple[Array, Array]], nominal: Array, least: float = VISIBLE) -> Law | None:
    """Law at the lag of the largest multiple correlation; None if fewer rows than needed are left."""
    limits: list[tuple[Array, Array]] = []
    found: dict[int, Law] = {}

    def evaluate(steps: Sequence[int]) -> Law | None:
        for step in sorted(set(steps) - set(found), key=abs):
            rows = at(step * LAG_STEP)
            if len(rows[0]) < ROWS // 2:
                continue
            if not limits:
                limits.extend(_usual_range(each) for each in rows)
            inputs, measured = (np.clip(each, *limit) for each, limit in zip(rows, limits, strict=True))
            inputs, measured = inputs - inputs.mean(axis=0), measured - measured.mean(axis=0)
            square, mixed, own = inputs.T @ inputs, inputs.T @ measured, (measured**2).sum(axis=0)
            explained = _multiple_correlation(square, mixed, own)
            found[step] = Law(len(inputs), square, mixed, own, nominal, explained, step * LAG_STEP, least)
        if not found:
            return None
        # of equal ones the smallest lag
        return max(found.values(), key=lambda each: (round(float((each.explained**2).sum()), 6), -abs(each.lag)))

    coarse = evaluate(range(-COARSE * 6, COARSE * 6 + 1, COARSE))
    if coarse is None:
        return None
    middle = round(coarse.lag / LAG_STEP)
    return evaluate(range(middle - COARSE + 1, middle + COARSE))


def _usual_range(rows: Array) -> tuple[Array, Array]:
    """Numbers below and above which a signal is cut off: some robust standard deviations around its median."""
    middle = np.median(rows, axis=0)
    spread = CLIPPED * (1.4826 * np.median(np.abs(rows - middle), axis=0) + 1e-3 * np.std(rows, axis=0))
    return middle - spread, middle + spread


def _multiple_correlation(square: Array, mixed: Array, own: Array) -> Array:
    """Multiple correlation (k,) of each measured row with all inputs, from the second moments of a law."""
    firm = square + (1e-9 * np.trace(square) / len(square) + 1e-300) * np.eye(len(square))
    explained = (mixed * np.linalg.solve(firm, mixed)).sum(axis=0) / np.maximum(own, 1e-300)
    return np.asarray(np.sqrt(np.clip(explained, 1e-12, 1.0)))


def best_turn(law: Law) -> tuple[float, float]:
    """Turn of the rotors about z, rad, that explains the rotation best, and its score."""
    angles = np.radians(np.arange(-180.0, 180.0, 5.0))
    scores = [law.score(turned_about_z(law.nominal, float(each))) for each in angles]
    best = int(np.argmax(scores))
    return float(angles[best]), scores[best]


def turned_about_z(mapping: Array, angle: float) -> Array:
    """Map (3, m) whose result is turned by an angle (rad) about z; sizes of x and y are those before."""
    sizes = np.linalg.norm(mapping, axis=1, keepdims=True)
    unit = mapping / np.maximum(sizes, 1e-300)
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(sizes * (np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ unit))


def rotor_orders(count: int) -> Sequence[tuple[int, ...]]:
    """Orders of rotors that are tried: the plain one, exchanges, turns and mirrors, then all others of up to six."""
    plain = tuple(range(count))
    found = [plain]
    for i in range(count):
        for k in range(i):
            order = list(plain)
            order[i], order[k] = order[k], order[i]
            found.append(tuple(order))
    for i in range(count):
        found += [(plain[i:] + plain[:i])[::-1], plain[i:] + plain[:i]]
    return list(dict.fromkeys([*found, *(permutations(plain) if count <= MOST else ())]))


MOST = 6
"""Rotors of which all orders are tried."""


def best_order(law: Law) -> tuple[tuple[int, ...], float]:
    """Order of the rotors that explains the rotation, and its score: the first of those that are hardly worse."""
    orders = rotor_orders(law.nominal.shape[1])
    scores = np.array([law.score(law.nominal[:, list(each)]) for each in orders])
    k = int(np.argmax(scores > scores.max() - ALIKE))
    return orders[k], float(scores[k])


ALIKE = 0.03
"""Difference of scores that tells nothing: an allocation uses fewer directions than there are rotors."""
