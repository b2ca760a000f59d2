"""The axes of the envelope: a trial made harder step by step, and by what it is judged."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from skyarm.compare import envelope_motions as motions
from skyarm.compare import envelope_trials as trials
from skyarm.compare.envelope_setting import Setting
from skyarm.compare.envelope_trials import AGE, PLANTS, WIDEST, Numbers, swinging
from skyarm.compare.suite import NOISE
from skyarm.scenario.paths import LATE
from skyarm.scenario.scenario_record import PERFECT_SENSORS, Scenario

TIP, OVERSHOOT = "ee_error_mean_continuous", "x_error_max_continuous"
"""What an axis is judged by: the mean distance of the tip from where a level base on its reference would carry it, or
how far the base goes beyond a step along x."""

TIP_MAX, OUTSIDE = "ee_error_max_continuous", "ee_time_outside_continuous"
"""The largest such distance, and for how long it was over 5 cm."""

SETTLED, DISTURBED = 7.0, 4.0
"""s: from when on a motion that grows until 5 s is judged; and a hover."""


@dataclass(frozen=True, kw_only=True)
class Axis:
    """An axis is one trial at several values, the easiest first.

    Attributes:
        name: short name. title: one line. unit: of the values as they are shown.
        values: for the paper's vehicle, SI; the largest change of the trial last.
        build: scenario of a value, its law that of the setting.
        numbers: path -> number of a value, where values are data of one scenario; None where each is a scenario.
        plants: a value is the width of a spread of plants, and many fly each.
        share: of the values that the setting's vehicle is given.
        shown: factor from SI to the unit.
        noisy: sensor noise and a measurement that is 5 ms old, of which the law is told.
        start: s, from when on errors count. metric: by which the axis is judged.
        torques: of joints that take torques only; a vehicle whose joints are servos does not fly it.
    """

    name: str
    title: str
    unit: str
    values: tuple[float, ...]
    build: Callable[[Setting, float], Scenario]
    numbers: Callable[[Setting, float], Numbers] | None = None
    plants: bool = False
    share: Callable[[Setting], float] = lambda setting: 1.0
    shown: float = 1.0
    noisy: bool = False
    start: float = DISTURBED
    metric: str = TIP
    torques: bool = False

    def of(self, setting: Setting) -> tuple[float, ...]:
        """Values for a vehicle, SI."""
        share = self.share(setting)
        return tuple(float(f"{value * share:.3g}") for value in self.values)

    def scenario(self, setting: Setting, value: float) -> Scenario:
        """The trial at a value, with the sensors of the axis."""
        return self.sensed(self.build(setting, value))

    def sensed(self, built: Scenario) -> Scenario:
        """A scenario with the sensors of the axis; one that has noise of its own keeps it."""
        if not self.noisy or built.noise != PERFECT_SENSORS:
            return built
        delays = dataclasses.replace(built.delays, measurement=built.delays.measurement or AGE)
        return built.with_words(noise=NOISE, delays=delays)


MOVING = partial(Axis, start=SETTLED)
"""A motion that grows until 5 s."""


def _slow(*, what: str, **facts: Any) -> Axis:
    """Something wrong on the slow circle, under noise."""
    return Axis(title=f"slow circle, {what}", noisy=True, **facts)


def _pushed(axis: str) -> Axis:
    return Axis(
        name=f"push_{axis}",
        title=f"hover, the tip pushed along {axis} during half of every second",
        unit="N",
        values=(0.5, 1.0, 2.0, 3.0),
        build=lambda setting, force: motions.pushes(setting, axis, force),
        numbers=lambda setting, force: {f"environment.forces.0.force.{axis}.signal": force},
        share=trials.by_weight,
        noisy=True,
    )


VERTICAL = partial(
    MOVING,
    title="vertical sine of 0.2 m, arm swinging",
    unit="Hz",
    build=trials.vertical_sine,
    numbers=trials.frequencies("z.1"),
)

MOTIONS = (
    MOVING(
        name="circle",
        title="circle of 1 m, arm swinging",
        unit="m/s",
        values=(0.5, 1.0, 1.5, 2.0, 2.5, 3.0),
        build=trials.fast_circle,
        numbers=trials.speed_numbers,
        share=trials.by_root_of_climb,
    ),
    VERTICAL(name="vertical", values=(0.25, 0.5, 0.75, 1.0, 1.25)),
    VERTICAL(name="vertical_noisy", values=(0.25, 0.5, 0.75, 1.0), noisy=True),
    MOVING(
        name="swing",
        title="hover, all joints swinging by 1 rad",
        unit="Hz",
        values=(0.5, 0.75, 1.0, 1.25, 1.5, 2.0),
        build=lambda setting, frequency: motions.arm_swing(setting, 1.0, frequency),
        numbers=trials.swing_frequency,
    ),
    MOVING(
        name="swing_amplitude",
        title="hover, all joints swinging at 1 Hz",
        unit="rad",
        values=(0.25, 0.5, 0.75, 1.0, 1.25),
        build=lambda setting, amplitude: motions.arm_swing(setting, amplitude, 1.0),
        numbers=trials.swing_amplitude,
    ),
    MOVING(
        name="wrong_plants",
        title=f"hover, joints swinging by 0.5 rad at 1 Hz, {PLANTS} wrong plants, width of their spread",
        unit="times",
        values=(0.5, 1.0, 1.5, WIDEST),
        build=swinging,
        plants=True,
    ),
)
"""Motions of base and arm; in the last the plants differ."""

DISTURBANCES = (
    Axis(
        name="step",
        title="step of the position along x",
        unit="m",
        values=(0.5, 1.0, 2.0, 3.0),
        build=motions.step,
        numbers=lambda setting, height: {"reference.x.height": height},
        share=trials.by_climb,
        start=motions.STEP,
        metric=OVERSHOOT,
    ),
    Axis(
        name="turning_wind",
        title="hover in 2 N of wind that turns, time of a turn",
        unit="s",
        values=(40.0, 20.0, 10.0, 5.0),
        build=trials.turning_wind,
        numbers=trials.turning_frequency,
    ),
    Axis(
        name="turbulence",
        title="hover in turbulent air, mean speed",
        unit="m/s",
        values=(1.5, 3.0, 4.5, 6.0),
        build=motions.turbulence,
    ),
    Axis(
        name="wind_steps",
        title="hover, a force on the base that steps from axis to axis",
        unit="N",
        values=(1.0, 2.0, 3.0, 4.0, 5.0),
        build=motions.wind_steps,
        numbers=trials.stepped_force,
        share=trials.by_weight,
        noisy=True,
    ),
    *(_pushed(axis) for axis in "xyz"),
)
"""A step, and forces on a hover."""

SLOW_CIRCLE = (
    _slow(
        name="command_delay",
        what="commands late, unknown to the law",
        unit="ms",
        values=(0.0, 0.005, 0.01, 0.015, 0.02, trials.LONGEST),
        build=trials.late_commands,
        numbers=lambda setting, delay: {LATE: delay},
        shown=1e3,
    ),
    _slow(
        name="measurement_delay",
        what="measurements old, the law is told",
        unit="ms",
        values=(0.0, 0.005, 0.01, 0.02, 0.03),
        build=trials.old_measurements,
        shown=1e3,
    ),
    _slow(
        name="motor_lag",
        what="lag of the rotors against what is believed",
        unit="times",
        values=(1.0, 1.5, 2.0, 3.0, 4.0),
        build=trials.lagging_rotors,
        numbers=trials.rotor_lags,
    ),
    _slow(
        name="joint_lag",
        what="joint torques that lag",
        unit="ms",
        values=(0.005, 0.01, 0.02, 0.04),
        build=trials.lagging_joints,
        numbers=trials.joint_lags,
        shown=1e3,
        torques=True,
    ),
    _slow(
        name="payload",
        what="an unknown mass at the tip",
        unit="kg",
        values=(0.0, 0.05, 0.1, 0.2),
        build=trials.loaded_tip,
        numbers=lambda setting, mass: {"plant.payload.mass": mass},
        share=trials.by_weight,
    ),
    _slow(
        name="noise",
        what="noise against that of the bench",
        unit="times",
        values=(0.5, 1.0, 2.0, 4.0),
        build=trials.louder_sensors,
        numbers=lambda setting, times: trials.noise_numbers(times),
    ),
)
"""What is wrong beside the motion: delays, lags, a load, noise."""

AXES: Mapping[str, Axis] = {axis.name: axis for axis in (*MOTIONS, *DISTURBANCES, *SLOW_CIRCLE)}
