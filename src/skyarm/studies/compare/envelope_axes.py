"""Difficulty axes of the performance envelope: trials with one growing parameter, and their error metric."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from skyarm.algebra import E_X, Vec3
from skyarm.dynamics.actuators.drive import LaggedTorque
from skyarm.records.arrays import Array
from skyarm.records.immutable import immutable
from skyarm.records.leaves import walk
from skyarm.reference import Constant, Product, Pulses, Ramp, Signal, Sine, Sum, Windowed
from skyarm.reference.splines import uniform_curve
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.paths import LATE
from skyarm.scenario.scenario_record import PERFECT_SENSORS, Change, Delays, JointDrive, Scenario, with_words
from skyarm.sensing.measurement import SensorNoise
from skyarm.studies.compare.envelope_setting import DURATION, PAPER, Setting
from skyarm.studies.compare.perturbed_plants import Spread, draw, fitted_damping, spread_of
from skyarm.studies.compare.suite import DELAY, NOISE
from skyarm.vehicle import BodyDrag
from skyarm.world import AirSignals, Disturbance, ForceWind, MovingAir
from skyarm.world.dryden import Dryden
from skyarm.world.signal_vector import SignalVector

TIP, OVERSHOOT = "ee_error_mean_continuous", "x_error_max_continuous"
"""Metrics that judge an axis: mean distance of the tip from its reference with a level base, or overshoot of the
base in a step along x."""

TIP_MAX, OUTSIDE = "ee_error_max_continuous", "ee_time_outside_continuous"
"""Metrics: largest such distance, and time for which it exceeds 5 cm."""

SETTLED, DISTURBED, STEP = 7.0, 4.0, 1.0
"""Start (s) of the judged window of a motion that grows until 5 s, and of a hover; and time (s) of the position
step."""

EASE = Ramp(start=2.0, duration=3.0, height=1.0, shape="quintic")
"""Envelope of every motion, which grows from rest to its amplitude between 2 and 5 s."""

ARM, ARM_HZ, ARM_PHASE = (0.2, 0.15), 0.5, 0.6
"""Swing of the joints during a motion of the base: amplitudes (rad), frequency (Hz), phase (rad) from joint to
joint."""

SWING_PHASE = 0.9
"""Phase (rad) from joint to joint in the trials of a swinging arm."""

SLOW = (0.3, 0.15)
"""Radius (m) and speed (m/s) of the circle in the trials of delay, lag, payload and noise."""

HULL, SCALE_LENGTH = 0.02, 3.0
"""Drag of the hull (N/(m/s)^2) in turbulence, for the paper's weight; length scale (m) of the turbulence along all
axes."""

FALLING = 3.2 - 1.0
"""Growth of the lag of falling rotors, up to 3.2 times while that of rising ones grows to four (12.5/25 to 50/80
ms)."""

LONGEST = 0.03
"""Longest delay (s) of the commands."""

ON_TIME = Delays()
"""Delays of a loop without dead time."""

ONSET, LATEST = 8.0, 0.04
"""Onset (s) and largest size (s) of a command delay that appears in flight."""

VEHICLES = ("hexarotor_arm6", "octo_coaxial_two_arms", "quadrotor_roll_arm2")
"""Further vehicles, each with an axis of delays: six joints, two arms with slides on eight rotors, and servos."""

FIGURE = {"x": (0.8, 2.0, 0.0), "y": (0.5, 3.0, 0.7), "z": (0.15, 5.0, 1.9)}
FIGURE_ARM = (0.3, 7.0, 1.1)
"""Lissajous figure that no gain or law was chosen on: amplitudes (m; of the joints rad), multiples of the axis'
frequency, and phases (rad)."""

POINTS, SPAN = 31, {"x": 0.8, "y": 0.8, "z": 0.3, "joints": 0.6}
"""Seed of the random curve's points, and their largest distance from its middle (m; rad for joints)."""

PLANTS, WIDEST = 24, 2.0
"""Perturbed plants of every value, the same ones for every law, further from the model as the value grows; the last
value, times the comparison's spread."""

WIND_STEPS = {"x": ((0.0, 3.0, 1.0), (9.0, 12.0, -1.0)), "y": ((6.0, 9.0, 1.0),), "z": ((15.0, math.inf, 1.0),)}
"""World axis -> (start, stop, fraction): +x, 0, +y, -x, 0, +z, each for 3 s."""

Numbers = Mapping[str, float]


@immutable
class EnvelopeAxis:
    """Difficulty axis of the performance envelope: one trial at several parameter values, the easiest first.

    Attributes:
        name: short name. title: one line. unit: unit of the values as they are shown.
        values: values for the paper's vehicle, SI; the largest change of the trial last.
        build: scenario of the setting, its law that of the setting; of setting and value where ``numbers`` is None.
        numbers: path -> number of a value, where values are data of one scenario; None where each is a scenario.
        plants: a value is the width of a spread of plants, and many fly each.
        share: share of the values that the setting's vehicle is given.
        shown: factor from SI to the unit.
        noisy: sensor noise and a measurement that is 5 ms old, a delay that the law knows.
        start: s, beginning of the error metrics. metric: metric that decides on the axis.
        torques: whether the joints must take torques; a vehicle whose joints are servos does not fly it.
        vehicle: vehicle that flies the axis in place of the envelope's; "" for none.
    """

    name: str
    title: str
    unit: str
    values: tuple[float, ...]
    build: Callable[..., Scenario]
    numbers: Callable[[Setting, float], Numbers] | None = None
    plants: bool = False
    share: Callable[[Setting], float] = lambda setting: 1.0
    shown: float = 1.0
    noisy: bool = False
    start: float = DISTURBED
    metric: str = TIP
    torques: bool = False
    vehicle: str = ""

    def of(self, setting: Setting) -> tuple[float, ...]:
        """Parameter values of a difficulty axis, scaled to a vehicle, SI."""
        share = self.share(setting)
        return tuple(float(f"{value * share:.3g}") for value in self.values)

    def scenario(self, setting: Setting, value: float) -> Scenario:
        """Scenario of an envelope trial at one axis value, with sensor noise if the axis requires it."""
        built = self.build(setting, value) if self.numbers is None else self.build(setting)
        if self.noisy and built.agent.noise == PERFECT_SENSORS:
            delays = replace(built.agent.delays, measurement=built.agent.delays.measurement or DELAY)
            built = with_words(built, noise=NOISE, delays=delays)
        return built if self.numbers is None else with_numbers(built, self.numbers(setting, value))


def sine_from_rest(amplitude: float, frequency_hz: float = 1.0, phase: float = 0.0) -> Signal:
    """Sine signal that fades in from rest; paths to the sine's parameters contain ``signal``."""
    return Product(Sine(amplitude=amplitude, frequency_hz=frequency_hz, phase=phase), EASE)


def along(setting: Setting, **signals: Any) -> Scenario:
    """Scenario of a vehicle that follows the given reference signals of base and joints."""
    return setting.hover.with_reference(replace(setting.hover.agent.reference, **signals))


def swings(setting: Setting, amplitudes: tuple[float, ...], frequency_hz: float, phase: float) -> tuple[Signal, ...]:
    """Sine references of all joints about mid-range, each with a phase lag to the previous joint."""
    return tuple(
        Sum((Constant(middle), sine_from_rest(amplitudes[j % len(amplitudes)] * unit, frequency_hz, phase * j)))
        for j, (middle, unit) in enumerate(zip(setting.middle, setting.swing, strict=True))
    )


def swinging(setting: Setting, amplitude: float = 1.0) -> Scenario:
    """Envelope trial: all joints swing in hover at 1 Hz, amplitude in rad."""
    return along(setting, joints=swings(setting, (amplitude,), 1.0, SWING_PHASE))


def moving_base(setting: Setting, **axes: Signal) -> Scenario:
    """Envelope trial: the base follows reference signals while the arm swings gently."""
    return along(setting, joints=swings(setting, ARM, ARM_HZ, ARM_PHASE), **axes)


def circle(setting: Setting, radius: float = 1.0, speed: float = 1.0) -> Scenario:
    """Envelope trial: horizontal circle, radius in m and speed in m/s."""
    f = speed / (2.0 * math.pi * radius)
    return moving_base(setting, x=sine_from_rest(radius, f, 0.5 * math.pi), y=sine_from_rest(radius, f))


def slow_circle(setting: Setting, delays: Delays = ON_TIME, noise: SensorNoise = PERFECT_SENSORS) -> Scenario:
    """Envelope trial: slow horizontal circle, used for delays, lags, payloads and noise."""
    return with_words(circle(setting, *SLOW), delays=delays, noise=noise)


def slow_circle_with_onset(setting: Setting) -> Scenario:
    """Envelope trial: slow circle with a command delay that sets in at 8 s."""
    late = Change(at=ONSET, path=LATE, value=LATEST)
    return with_words(slow_circle(setting), delays=Delays(measurement=DELAY, longest_command=LATEST), changes=(late,))


def figure(setting: Setting) -> Scenario:
    """Envelope trial: Lissajous figure in space while the joints swing faster; the axis value sets the frequencies."""
    height = setting.hover.agent.reference.z
    base = {axis: sine_from_rest(size * setting.climb, times, phase) for axis, (size, times, phase) in FIGURE.items()}
    size, times, phase = FIGURE_ARM
    return along(setting, **base | {"z": Sum((height, base["z"]))}, joints=swings(setting, (size,), times, phase))


def figure_frequencies(setting: Setting, frequency: float) -> Numbers:
    """Parameter path -> frequency of every sine of the Lissajous figure, Hz."""
    paths = {("z.1" if axis == "z" else axis): times for axis, (_, times, _) in FIGURE.items()}
    paths |= {f"joints.{j}.1": FIGURE_ARM[1] for j in range(setting.truth.n)}
    return {f"reference.{path}.signal.frequency_hz": times * frequency for path, times in paths.items()}


def random_curve(setting: Setting, step: float) -> Scenario:
    """Envelope trial: base and joints follow B-splines with random control points at a given spacing (s)."""
    draws = np.random.default_rng(POINTS)
    count = math.ceil(DURATION / min(RANDOM_STEPS)) + 8

    def curve(span: float) -> Signal:
        points = span * draws.uniform(-1.0, 1.0, count)
        return Product(uniform_curve(points[: math.ceil(setting.duration / step) + 8].tolist(), 0.0, step), EASE)

    base = {axis: curve(SPAN[axis] * setting.climb) for axis in "xyz"}
    joints = tuple(
        Sum((Constant(middle), curve(SPAN["joints"] * unit)))
        for middle, unit in zip(setting.middle, setting.swing, strict=True)
    )
    return along(setting, **base | {"z": Sum((setting.hover.agent.reference.z, base["z"]))}, joints=joints)


def vertical(setting: Setting) -> Scenario:
    """Envelope trial: vertical sine motion of 0.2 m amplitude."""
    return moving_base(setting, z=Sum((setting.hover.agent.reference.z, sine_from_rest(0.2 * setting.climb))))


def pushed_hover(setting: Setting, **force: Any) -> Scenario:
    """Envelope trial: hover under a given disturbance force."""
    return with_words(setting.hover, forces=(Disturbance(**force),))


def turning_wind(setting: Setting) -> Scenario:
    """Envelope trial: hover in a wind that rotates about the vertical, force 2 N, air speed 2 m/s."""
    force, air = (
        SignalVector(**{axis: Sine(amplitude=size, frequency_hz=1.0, phase=phase)
                        for axis, phase in (("x", 0.5 * math.pi), ("y", 0.0))})
        for size in (2.0 * setting.weight, 2.0)
    )  # fmt: skip
    return with_words(pushed_hover(setting, force=force), air=(AirSignals(velocity_W=air),))


def turbulence(setting: Setting, mean: float) -> Scenario:
    """Envelope trial: hover in turbulent wind along x with given mean (m/s), standard deviation half the mean."""
    drag = BodyDrag(area=Vec3(*(2.0 * HULL * setting.weight / 1.225,) * 3), air_density=1.225)
    sigma, length = Vec3(*(0.5 * mean,) * 3), Vec3(*(SCALE_LENGTH,) * 3)
    gusts = Dryden(intensity=sigma, scale_length=length, airspeed=mean, direction_W=E_X)
    plant = replace(setting.hover.agent.plant, vehicle=replace(setting.truth, drag=drag))
    return with_words(setting.hover, plant=plant, wind=MovingAir(velocity_W=Vec3(mean, 0, 0), turbulence=gusts))


def wind_steps(setting: Setting) -> Scenario:
    """Envelope trial: hover under a step force on the base, along one axis after another."""
    vector = {
        axis: Product(Constant(1.0), Sum(tuple(Windowed(Constant(sign), a, b) for a, b, sign in windows)))
        for axis, windows in WIND_STEPS.items()
    }
    return pushed_hover(setting, force=SignalVector(**vector))


def pushes(axis: str, setting: Setting) -> Scenario:
    """Envelope trial: hover under a pulsed tip force along a world axis, on for half of every second."""
    pulses = Pulses(count=max(1, math.ceil(setting.duration)), start=4.0, period=1.0, width=0.5)
    force = SignalVector(**{axis: Product(Constant(1.0), pulses)})
    return pushed_hover(setting, frame=setting.truth.end_effector, force=force)


def lagging_joints(setting: Setting) -> Scenario:
    """Envelope trial: slow circle with a first-order lag on the joint torques."""
    lagged = LaggedTorque(time_constant=LONGEST)
    drives = tuple(JointDrive(joint=joint.name, drive=lagged) for joint in setting.truth.joints)
    return with_words(slow_circle(setting), drives=drives)


def axis_words(name: str) -> str:
    """Printed words for an axis; the names in files and options are older than some words."""
    return "perturbed plants" if name == "wrong_plants" else name.replace("_", " ")


def wrong_plants(setting: Setting, times: float) -> Scenario:
    """Envelope trial: joints swing by 0.5 rad on a perturbed plant with an unmodelled command delay."""
    delays = Delays(longest_command=WIDEST * Spread().delay)
    return with_words(swinging(setting, 0.5), delays=delays, wind=ForceWind())


def plants_at(setting: Setting, scenario: Scenario, times: float, count: int, *, seed: int) -> dict[str, Array]:
    """Perturbed plants at one axis value: parameter path -> values (plants,).

    Args:
        setting: vehicle.
        scenario: scenario of :func:`wrong_plants`; its truth is the middle of the spread.
        times: width of the spread over that of the comparison.
        count: plants.
        seed: key.
    """
    if setting.vehicle == PAPER:
        return draw(scenario, widen(Spread(), times), count, seed=seed)
    spread, _ = spread_of(setting.truth, float(scenario.agent.plant.gravity), Spread().delay)
    return fitted_damping(scenario, spread, draw(scenario, widen(spread, times), count, seed=seed))


def widen(spread: Spread, times: float) -> Spread:
    """Distribution of perturbed plants with all its widths multiplied by a factor."""
    low, high = spread.thrust
    shares = {place[0]: value * times for place, value in walk(spread) if place[0] != "thrust"}
    return Spread(**shares, thrust=(low * times, high * times))


def same(*paths: str, factor: float = 1.0) -> Callable[[Setting, float], Numbers]:
    """Function from a difficulty value to several parameters by path, each equal to the value times a factor."""
    return lambda setting, value: dict.fromkeys(paths, value * factor)


def frequencies(*axes: str) -> Callable[[Setting, float], Numbers]:
    """Function from a difficulty value to the frequencies of several reference sines, by parameter path."""
    return same(*(f"reference.{axis}.signal.frequency_hz" for axis in axes))


def rotor_lags(setting: Setting, times: float) -> Numbers:
    """Parameter path -> time constant of every rotor, rising and falling, s."""
    falling = 1.0 + FALLING * (times - 1.0) / 3.0
    return {
        f"plant.vehicle.rotors.{i}.time_constant_{way}": float(getattr(rotor, f"time_constant_{way}")) * factor
        for i, rotor in enumerate(setting.truth.rotors)
        for way, factor in (("up", times), ("down", falling))
    }


def by_weight(setting: Setting) -> float:
    """Scale of forces and payloads for a vehicle: its weight over that of the Barakou et al. 2026 vehicle."""
    return setting.weight


RANDOM_STEPS = (1.0, 0.7, 0.5, 0.35)
"""Times (s) between the points of the random curve."""

MOVING = partial(EnvelopeAxis, start=SETTLED)
SLOWLY = partial(EnvelopeAxis, noisy=True)
VERTICAL = partial(MOVING, title="vertical sine of 0.2 m, arm swinging", unit="Hz", build=vertical,
                   numbers=frequencies("z.1"))  # fmt: skip

LATE_IN_FLIGHT = partial(SLOWLY, build=slow_circle_with_onset, numbers=same("changes.0.value"), start=ONSET, shown=1e3)

ROWS = (
    MOVING(
        name="circle", title="circle of 1 m, arm swinging", unit="m/s", values=(0.5, 1.0, 1.5, 2.0, 2.5, 3.0),
        build=circle, numbers=lambda setting, speed: frequencies("x", "y")(setting, speed / (2.0 * math.pi)),
        share=lambda setting: math.sqrt(setting.climb),
    ),
    VERTICAL(name="vertical", values=(0.25, 0.5, 0.75, 1.0, 1.25)),
    VERTICAL(name="vertical_noisy", values=(0.25, 0.5, 0.75, 1.0), noisy=True),
    MOVING(
        name="swing", title="hover, all joints swinging by 1 rad", unit="Hz", values=(0.5, 0.75, 1.0, 1.25, 1.5, 2.0),
        build=swinging,
        numbers=lambda setting, f: frequencies(*(f"joints.{j}.1" for j in range(setting.truth.n)))(setting, f),
    ),
    MOVING(
        name="swing_amplitude", title="hover, all joints swinging at 1 Hz", unit="rad",
        values=(0.25, 0.5, 0.75, 1.0, 1.25), build=swinging,
        numbers=lambda setting, size: {
            f"reference.joints.{j}.1.signal.amplitude": size * unit for j, unit in enumerate(setting.swing)
        },
    ),
    MOVING(
        name="figure", title="Lissajous figure in space, joints swinging", unit="Hz", values=(0.05, 0.1, 0.15, 0.2),
        build=figure, numbers=figure_frequencies,
    ),
    MOVING(
        name="random_curve", title="B-spline of random points, time between them, base and joints", unit="s",
        values=RANDOM_STEPS, build=random_curve,
    ),
    MOVING(
        name="wrong_plants", unit="times", values=(0.5, 1.0, 1.5, WIDEST), build=wrong_plants, plants=True,
        title=f"hover, joints swinging by 0.5 rad at 1 Hz, {PLANTS} perturbed plants, width of their spread",
    ),
    EnvelopeAxis(
        name="step", title="step of the position along x", unit="m", values=(0.5, 1.0, 2.0, 3.0), start=STEP,
        # within one control period of the paper's rates
        build=lambda setting: along(setting, x=Ramp(start=STEP, duration=0.005, height=1.0)),
        numbers=same("reference.x.height"), share=lambda setting: setting.climb, metric=OVERSHOOT,
    ),
    EnvelopeAxis(
        name="turning_wind", title="hover in 2 N of wind that turns, time of a turn", unit="s",
        values=(40.0, 20.0, 10.0, 5.0), build=turning_wind,
        numbers=lambda setting, period: {
            f"environment.{what}.{axis}.frequency_hz": 1.0 / period
            for what in ("forces.0.force", "air.0.velocity") for axis in "xy"
        },
    ),
    EnvelopeAxis(name="turbulence", title="hover in turbulent air, mean speed", unit="m/s", values=(1.5, 3.0, 4.5, 6.0),
         build=turbulence),
    EnvelopeAxis(
        name="wind_steps", title="hover, a force on the base that steps from axis to axis", unit="N",
        values=(1.0, 2.0, 3.0, 4.0, 5.0), build=wind_steps, share=by_weight, noisy=True,
        numbers=same(*(f"environment.forces.0.force.{axis}.signal" for axis in "xyz")),
    ),
    *(
        EnvelopeAxis(
            name=f"push_{axis}", title=f"hover, the tip pushed along {axis} during half of every second", unit="N",
            values=(0.5, 1.0, 2.0, 3.0), build=partial(pushes, axis), share=by_weight, noisy=True,
            numbers=same(f"environment.forces.0.force.{axis}.signal"),
        )
        for axis in "xyz"
    ),
    SLOWLY(
        name="command_delay", title="slow circle, commands late, unknown to the law", unit="ms", shown=1e3,
        values=(0.0, 0.005, 0.01, 0.015, 0.02, LONGEST), numbers=same(LATE),
        build=partial(slow_circle, delays=Delays(measurement=DELAY, longest_command=LONGEST)),
    ),
    LATE_IN_FLIGHT(
        name="delay_in_flight", title="slow circle, commands late from 8 s on, unknown to the law", unit="ms",
        values=(0.0, 0.01, 0.02, 0.03, LATEST),
    ),
    *(
        LATE_IN_FLIGHT(
            name=vehicle, title=f"the same on {vehicle}", unit="ms late", values=(0.0, 0.01, 0.02, 0.03),
            vehicle=vehicle,
        )
        for vehicle in VEHICLES
    ),
    SLOWLY(
        name="measurement_delay", title="slow circle, measurements old, the law is told", unit="ms", shown=1e3,
        values=(0.0, 0.005, 0.01, 0.02, 0.03),
        build=lambda setting, age: slow_circle(setting, noise=NOISE, delays=Delays(measurement=age)),
    ),
    SLOWLY(
        name="motor_lag", title="slow circle, lag of the rotors over the nominal one", unit="times",
        values=(1.0, 1.5, 2.0, 3.0, 4.0), build=slow_circle, numbers=rotor_lags,
    ),
    SLOWLY(
        name="joint_lag", title="slow circle, joint torques that lag", unit="ms", shown=1e3, torques=True,
        values=(0.005, 0.01, 0.02, 0.04), build=lagging_joints,
        numbers=lambda setting, lag: {
            f"plant.drives.{joint.name}.time_constant": lag for joint in setting.truth.joints
        },
    ),
    SLOWLY(
        name="payload", title="slow circle, an unknown mass at the tip", unit="kg", values=(0.0, 0.05, 0.1, 0.2),
        build=slow_circle, numbers=same("plant.payload.mass"), share=by_weight,
    ),
    SLOWLY(
        name="noise", title="slow circle, noise against that of the bench", unit="times", values=(0.5, 1.0, 2.0, 4.0),
        build=slow_circle,
        numbers=lambda setting, times: {
            f"sensors.{name}": getattr(NOISE, name) * times
            for name in ("position", "velocity", "attitude", "rate", "joints", "joint_rates")
        },
    ),
)  # fmt: skip
"""Axes of the envelope: motions of base and arm; a step, and forces in hover; delays, lags, a load and noise on a
slow circle."""

AXES: Mapping[str, EnvelopeAxis] = {axis.name: axis for axis in ROWS}
