"""The trials of the envelope: from a value to a scenario, and to the numbers that it sets by their paths."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy.typing as npt

from skyarm.actuation.drive import LaggedTorque
from skyarm.compare import envelope_motions as motions
from skyarm.compare.envelope_setting import PAPER, Setting
from skyarm.compare.perturbed_plants import Spread, draw
from skyarm.compare.suite import NOISE
from skyarm.compare.vehicle_spread import fitted_damping, spread_of
from skyarm.environment import ForceWind
from skyarm.records.leaves import walk
from skyarm.scenario.scenario_record import Delays, JointDrive, Scenario

SLOW = (0.3, 0.15)
"""m, m/s: circle of the trials of delay, lag, payload and noise."""

FALLING = 3.2 - 1.0
"""The lag of falling rotors grows to 3.2 times where that of rising ones grows to four (12.5/25 to 50/80 ms)."""

Numbers = Mapping[str, float]
Array = npt.NDArray[Any]

AGE = 0.005
"""s, of a measurement where there is noise."""


def by_weight(setting: Setting) -> float:
    """Forces and payloads go with the weight."""
    return setting.weight


def by_climb(setting: Setting) -> float:
    """Accelerations go with the thrust margin."""
    return setting.climb


def by_root_of_climb(setting: Setting) -> float:
    """Speeds on a circle go with the root of the acceleration."""
    return math.sqrt(setting.climb)


def fast_circle(setting: Setting, speed: float) -> Scenario:
    """Circle of 1 m at a speed, m/s."""
    return motions.circle(setting, 1.0, speed)


def slow_circle(setting: Setting) -> Scenario:
    """Circle on which delays, lags, payloads and noise are flown."""
    return motions.circle(setting, *SLOW)


def vertical_sine(setting: Setting, frequency: float) -> Scenario:
    """Vertical sine at a frequency, Hz."""
    return motions.vertical(setting, 0.2 * setting.climb, frequency)


def frequencies(*axes: str) -> Callable[[Setting, float], Numbers]:
    """The same frequency of eased sines at several places."""
    return lambda setting, value: {f"reference.{axis}.signal.frequency_hz": value for axis in axes}


def speed_numbers(setting: Setting, speed: float) -> Numbers:
    """Frequencies of the circle of 1 m at a speed."""
    return frequencies("x", "y")(setting, speed / (2.0 * math.pi))


def swing_frequency(setting: Setting, frequency: float) -> Numbers:
    """Frequency of every joint's swing."""
    return {f"reference.joints.{j}.1.signal.frequency_hz": frequency for j in range(setting.truth.n)}


def swing_amplitude(setting: Setting, amplitude: float) -> Numbers:
    """Amplitude of every joint's swing."""
    return {f"reference.joints.{j}.1.signal.amplitude": amplitude * k for j, k in enumerate(setting.swing)}


def turning_wind(setting: Setting, period: float) -> Scenario:
    """A turn of the wind in a time, s."""
    return motions.turning_wind(setting, 2.0 * setting.weight, 2.0, period)


def turning_frequency(setting: Setting, period: float) -> Numbers:
    """Frequencies of force and air."""
    components = [f"environment.{what}" for what in ("forces.0.force", "air.0.velocity")]
    return {f"{each}.{axis}.frequency_hz": 1.0 / period for each in components for axis in "xy"}


def late_commands(setting: Setting, delay: float) -> Scenario:
    """Commands late by a delay, s, of which no law is told."""
    return slow_circle(setting).with_words(delays=Delays(measurement=AGE, longest_command=LONGEST, command=delay))


LONGEST = 0.03
"""s, of the commands."""


def old_measurements(setting: Setting, age: float) -> Scenario:
    """Measurements of an age, s, of which laws are told."""
    return slow_circle(setting).with_words(noise=NOISE, delays=Delays(measurement=age))


def lagging_rotors(setting: Setting, times: float) -> Scenario:
    """Rotors that rise so many times slower than believed."""
    rotors = tuple(
        dataclasses.replace(
            rotor,
            time_constant_up=rotor.time_constant_up * times,
            time_constant_down=rotor.time_constant_down * _falling(times),
        )
        for rotor in setting.truth.rotors
    )
    found = slow_circle(setting)
    vehicle = dataclasses.replace(found.plant.vehicle, rotors=rotors)
    return found.with_words(plant=dataclasses.replace(found.plant, vehicle=vehicle))


def _falling(times: float) -> float:
    return 1.0 + FALLING * (times - 1.0) / 3.0


def rotor_lags(setting: Setting, times: float) -> Numbers:
    """Time constants of every rotor, rising and falling, s."""
    found: dict[str, float] = {}
    for i, rotor in enumerate(setting.truth.rotors):
        at = f"plant.vehicle.rotors.{i}.time_constant"
        found[f"{at}_up"] = float(rotor.time_constant_up) * times
        found[f"{at}_down"] = float(rotor.time_constant_down) * _falling(times)
    return found


def lagging_joints(setting: Setting, lag: float) -> Scenario:
    """Joint torques that follow their setpoints with a lag, s."""
    drives = tuple(
        JointDrive(joint=link.joint.name, drive=LaggedTorque(time_constant=lag)) for link in setting.truth.links
    )
    return slow_circle(setting).with_words(drives=drives)


def joint_lags(setting: Setting, lag: float) -> Numbers:
    """Time constant of every joint's drive, s."""
    return {f"plant.drives.{link.joint.name}.time_constant": lag for link in setting.truth.links}


def stepped_force(setting: Setting, force: float) -> Numbers:
    """The size of a force that steps from axis to axis, N."""
    return {f"environment.forces.0.force.{axis}.signal": force for axis in "xyz"}


def loaded_tip(setting: Setting, mass: float) -> Scenario:
    """A point mass at the tip that the belief lacks, kg."""
    found = slow_circle(setting)
    vehicle = setting.truth.with_payload(mass)
    return found.with_words(plant=dataclasses.replace(found.plant, vehicle=vehicle))


def noise_numbers(times: float) -> Numbers:
    """Standard deviations of the bench's noise, so many times."""
    fields = ("position", "velocity", "attitude", "rate", "joints", "joint_rates")
    return {f"sensors.{name}": getattr(NOISE, name) * times for name in fields}


def louder_sensors(setting: Setting, times: float) -> Scenario:
    """Sensors that are so many times as noisy as the bench's."""
    louder = dataclasses.replace(
        NOISE, **{path.removeprefix("sensors."): n for path, n in noise_numbers(times).items()}
    )
    return slow_circle(setting).with_words(noise=louder, delays=Delays(measurement=AGE))


PLANTS = 24
"""Of every value. The same ones at every value and for every law, further from the belief as the value grows."""

WIDEST = 2.0
"""Times the README's spread: the last value."""


def swinging(setting: Setting, times: float) -> Scenario:
    """All joints swing by 0.5 rad at 1 Hz in hover; the plant is drawn, its commands late by what no law knows."""
    flown = motions.arm_swing(setting, 0.5, 1.0)
    return flown.with_words(wind=ForceWind(), delays=Delays(longest_command=WIDEST * Spread().delay))


def plants_at(setting: Setting, scenario: Scenario, times: float, count: int, *, seed: int) -> dict[str, Array]:
    """Numbers of the plants of a value, by path; the first ones do not depend on how many there are.

    Args:
        setting: vehicle.
        scenario: of :func:`swinging`; its truth is the middle of the spread.
        times: width of the spread over that of the README.
        count: plants.
        seed: key.
    """
    if setting.vehicle == PAPER:
        return draw(scenario, widened(Spread(), times), count, seed=seed)
    spread, _ = spread_of(setting.truth, float(scenario.plant.gravity), Spread().delay)
    return fitted_damping(scenario, spread, draw(scenario, widened(spread, times), count, seed=seed))


def widened(spread: Spread, times: float) -> Spread:
    """A spread so many times as wide."""
    low, high = spread.thrust
    shares = {place[0]: value * times for place, value in walk(spread) if place[0] != "thrust"}
    return Spread(**shares, thrust=(low * times, high * times))
