"""The axes of the envelope: a trial made harder step by step, and the numbers of the scenario that say how hard."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from skyarm.actuation.lagged_torque import LaggedTorque
from skyarm.compare import envelope_motions as motions
from skyarm.compare.envelope_setting import Setting
from skyarm.compare.suite import NOISE
from skyarm.scenario.places import LATE
from skyarm.scenario.scenario_parts import Delays, JointDrive
from skyarm.scenario.scenario_record import Scenario

TIP, OVERSHOOT = "ee_error_mean_continuous", "x_error_max_continuous"
"""What an axis is judged by: the mean distance of the tip from where a level base on its reference would carry it, or
how far the base goes beyond a step along x."""

TIP_MAX = "ee_error_max_continuous"

SLOW = (0.3, 0.15)
"""m, m/s: circle of the trials of delay, lag, payload and noise."""

SETTLED, DISTURBED = 7.0, 4.0
"""s: from when on a motion that grows until 5 s is judged; and a hover."""

FALLING = 3.2 - 1.0
"""The lag of falling rotors grows to 3.2 times where that of rising ones grows to four (12.5/25 to 50/80 ms)."""

Numbers = Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class Axis:
    """An axis is one trial at several values, the easiest first.

    Attributes:
        name: short name. title: one line. unit: of the values as they are shown.
        values: for the paper's vehicle, SI; the largest change of the trial last.
        build: scenario of a value, its law that of the setting.
        numbers: path -> number of a value, where values are data of one scenario; None where each is a scenario.
        share: of the values that the setting's vehicle is given.
        shown: factor from SI to the unit.
        noisy: sensor noise and a measurement that is 5 ms old, of which the law is told.
        start: s, from when on errors count. metric: by which the axis is judged.
    """

    name: str
    title: str
    unit: str
    values: tuple[float, ...]
    build: Callable[[Setting, float], Scenario]
    numbers: Callable[[Setting, float], Numbers] | None = None
    share: Callable[[Setting], float] = lambda setting: 1.0
    shown: float = 1.0
    noisy: bool = False
    start: float = DISTURBED
    metric: str = TIP

    def of(self, setting: Setting) -> tuple[float, ...]:
        """Values for a vehicle, SI."""
        share = self.share(setting)
        return tuple(float(f"{value * share:.3g}") for value in self.values)

    def scenario(self, setting: Setting, value: float) -> Scenario:
        """The trial at a value, with the sensors of the axis."""
        return self.sensed(self.build(setting, value))

    def sensed(self, built: Scenario) -> Scenario:
        """A scenario with the sensors of the axis; one that says its own keeps them."""
        if not self.noisy or built.sensors == NOISE:
            return built
        delays = dataclasses.replace(built.delays, measurement=built.delays.measurement or AGE)
        return dataclasses.replace(built, sensors=NOISE, delays=delays)


AGE = 0.005
"""s, of a measurement where there is noise."""


def _weight(setting: Setting) -> float:
    return setting.weight


def _climb(setting: Setting) -> float:
    return setting.climb


def _root(setting: Setting) -> float:
    return math.sqrt(setting.climb)


def _reach(setting: Setting) -> float:
    return max(setting.swing, default=1.0)


def _circle(setting: Setting, speed: float) -> Scenario:
    return motions.circle(setting, 1.0, speed)


def _slow(setting: Setting) -> Scenario:
    return motions.circle(setting, *SLOW)


def _vertical(setting: Setting, frequency: float) -> Scenario:
    return motions.vertical(setting, 0.2 * setting.climb, frequency)


def _frequencies(*axes: str) -> Callable[[Setting, float], Numbers]:
    """The same frequency of eased sines at several places."""
    return lambda setting, value: {f"reference.{axis}.signal.frequency_hz": value for axis in axes}


def _speed(setting: Setting, speed: float) -> Numbers:
    return _frequencies("x", "y")(setting, speed / (2.0 * math.pi))


def _swing_hz(setting: Setting, frequency: float) -> Numbers:
    return {f"reference.joints.{j}.1.signal.frequency_hz": frequency for j in range(setting.truth.n)}


def _swing_rad(setting: Setting, amplitude: float) -> Numbers:
    return {f"reference.joints.{j}.1.signal.amplitude": amplitude * k for j, k in enumerate(setting.swing)}


def _turning(setting: Setting, period: float) -> Scenario:
    return motions.turning_wind(setting, 2.0 * setting.weight, 2.0, period)


def _turning_hz(setting: Setting, period: float) -> Numbers:
    components = [f"environment.{what}" for what in ("forces.0.force", "air.0.velocity")]
    return {f"{each}.{axis}.frequency_hz": 1.0 / period for each in components for axis in "xy"}


def _late(setting: Setting, delay: float) -> Scenario:
    return dataclasses.replace(_slow(setting), delays=Delays(measurement=AGE, longest_command=LONGEST, command=delay))


LONGEST = 0.03
"""s, of the commands."""


def _old(setting: Setting, age: float) -> Scenario:
    return dataclasses.replace(_slow(setting), sensors=NOISE, delays=Delays(measurement=age))


def _lagging(setting: Setting, times: float) -> Scenario:
    rotors = tuple(
        dataclasses.replace(
            rotor,
            time_constant_up=rotor.time_constant_up * times,
            time_constant_down=rotor.time_constant_down * _falling(times),
        )
        for rotor in setting.truth.rotors
    )
    found = _slow(setting)
    vehicle = dataclasses.replace(found.world.vehicle, rotors=rotors)
    return dataclasses.replace(found, world=dataclasses.replace(found.world, vehicle=vehicle))


def _falling(times: float) -> float:
    return 1.0 + FALLING * (times - 1.0) / 3.0


def _lags(setting: Setting, times: float) -> Numbers:
    found: dict[str, float] = {}
    for i, rotor in enumerate(setting.truth.rotors):
        at = f"plant.vehicle.rotors.{i}.time_constant"
        found[f"{at}_up"] = float(rotor.time_constant_up) * times
        found[f"{at}_down"] = float(rotor.time_constant_down) * _falling(times)
    return found


def _slack(setting: Setting, lag: float) -> Scenario:
    drives = tuple(
        JointDrive(joint=link.joint.name, drive=LaggedTorque(time_constant=lag)) for link in setting.truth.links
    )
    return dataclasses.replace(_slow(setting), drives=drives)


def _slacks(setting: Setting, lag: float) -> Numbers:
    return {f"plant.drives.{link.joint.name}.time_constant": lag for link in setting.truth.links}


def _pushed(axis: str) -> Axis:
    return Axis(
        name=f"push_{axis}",
        title=f"hover, the tip pushed along {axis} during half of every second",
        unit="N",
        values=(0.5, 1.0, 2.0, 3.0),
        build=lambda setting, force: motions.pushes(setting, axis, force),
        numbers=lambda setting, force: {f"environment.forces.0.force.{axis}.signal": force},
        share=_weight,
        noisy=True,
    )


def _stepped_wind(setting: Setting, force: float) -> Numbers:
    return {f"environment.forces.0.force.{axis}.signal": force for axis in "xyz"}


def _loaded(setting: Setting, mass: float) -> Scenario:
    found = _slow(setting)
    vehicle = setting.truth.with_payload(mass)
    return dataclasses.replace(found, world=dataclasses.replace(found.world, vehicle=vehicle))


def _noises(times: float) -> Numbers:
    fields = ("position", "velocity", "attitude", "rate", "joints", "joint_rates")
    return {f"sensors.{name}": getattr(NOISE, name) * times for name in fields}


def _louder(setting: Setting, times: float) -> Scenario:
    louder = dataclasses.replace(NOISE, **{path.removeprefix("sensors."): n for path, n in _noises(times).items()})
    return dataclasses.replace(_slow(setting), sensors=louder, delays=Delays(measurement=AGE))


AXES: Mapping[str, Axis] = {
    axis.name: axis
    for axis in (
        Axis(
            name="circle",
            title="circle of 1 m, arm swinging",
            unit="m/s",
            values=(0.5, 1.0, 1.5, 2.0, 2.5, 3.0),
            build=_circle,
            numbers=_speed,
            share=_root,
            start=SETTLED,
        ),
        Axis(
            name="vertical",
            title="vertical sine of 0.2 m, arm swinging",
            unit="Hz",
            values=(0.25, 0.5, 0.75, 1.0, 1.25),
            build=_vertical,
            numbers=_frequencies("z.1"),
            start=SETTLED,
        ),
        Axis(
            name="vertical_noisy",
            title="the same with noise",
            unit="Hz",
            values=(0.25, 0.5, 0.75, 1.0),
            build=_vertical,
            numbers=_frequencies("z.1"),
            noisy=True,
            start=SETTLED,
        ),
        Axis(
            name="swing",
            title="hover, all joints swinging by 1 rad",
            unit="Hz",
            values=(0.5, 1.0, 1.5, 2.0),
            build=lambda setting, frequency: motions.arm_swing(setting, 1.0, frequency),
            numbers=_swing_hz,
            start=SETTLED,
        ),
        Axis(
            name="swing_amplitude",
            title="hover, all joints swinging at 1 Hz",
            unit="rad",
            values=(0.25, 0.5, 0.75, 1.0, 1.25),
            build=lambda setting, amplitude: motions.arm_swing(setting, amplitude, 1.0),
            numbers=_swing_rad,
            start=SETTLED,
        ),
        Axis(
            name="step",
            title="step of the position along x",
            unit="m",
            values=(0.5, 1.0, 2.0, 3.0),
            build=motions.step,
            numbers=lambda setting, height: {"reference.x.height": height},
            share=_climb,
            start=motions.STEP,
            metric=OVERSHOOT,
        ),
        Axis(
            name="turning_wind",
            title="hover in 2 N of wind that turns once in",
            unit="s",
            values=(40.0, 20.0, 10.0, 5.0),
            build=_turning,
            numbers=_turning_hz,
        ),
        Axis(
            name="turbulence",
            title="hover in turbulent air of this mean speed",
            unit="m/s",
            values=(1.5, 3.0, 4.5, 6.0),
            build=motions.turbulence,
        ),
        Axis(
            name="wind_steps",
            title="hover, a force on the base that steps from axis to axis",
            unit="N",
            values=(1.0, 2.5, 5.0),
            build=motions.wind_steps,
            numbers=_stepped_wind,
            share=_weight,
            noisy=True,
        ),
        *(_pushed(axis) for axis in "xyz"),
        Axis(
            name="command_delay",
            title="slow circle, commands late, unknown to the law",
            unit="ms",
            values=(0.0, 0.01, 0.02, LONGEST),
            build=_late,
            numbers=lambda setting, delay: {LATE: delay},
            shown=1e3,
            noisy=True,
        ),
        Axis(
            name="measurement_delay",
            title="slow circle, measurements old, the law is told",
            unit="ms",
            values=(0.0, 0.005, 0.01, 0.02, 0.03),
            build=_old,
            shown=1e3,
            noisy=True,
        ),
        Axis(
            name="motor_lag",
            title="slow circle, rotors slower than believed by",
            unit="times",
            values=(1.0, 2.0, 3.0, 4.0),
            build=_lagging,
            numbers=_lags,
            noisy=True,
        ),
        Axis(
            name="joint_lag",
            title="slow circle, joint torques that lag",
            unit="ms",
            values=(0.005, 0.01, 0.02, 0.04),
            build=_slack,
            numbers=_slacks,
            shown=1e3,
            noisy=True,
        ),
        Axis(
            name="payload",
            title="slow circle, an unknown mass at the tip",
            unit="kg",
            values=(0.0, 0.05, 0.1, 0.2),
            build=_loaded,
            numbers=lambda setting, mass: {"plant.payload.mass": mass},
            share=_weight,
            noisy=True,
        ),
        Axis(
            name="noise",
            title="slow circle, noise of the bench times",
            unit="times",
            values=(0.5, 1.0, 2.0, 4.0),
            build=_louder,
            numbers=lambda setting, times: _noises(times),
            noisy=True,
        ),
    )
}
