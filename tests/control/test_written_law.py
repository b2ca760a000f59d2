"""The page on the centroidal law is enough to write it again: what is written from it
gives the law's commands.

Whoever changes the law changes its page, and reads the change off the page into
``written_law.py`` and its parts.
"""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import written_parts
from written_law import WrittenLaw
from written_vehicle import vehicle_of

import skyarm
from skyarm.control.laws.centroidal import noise_estimate
from skyarm.control.laws.centroidal.options import GAINS, VALUES
from skyarm.reference.preview import samples, samples_ahead
from support.pages import law_equations

LIBRARY = Path(skyarm.__file__).parent
NOISE = {
    "position": 1e-3,
    "velocity": 1e-2,
    "attitude": 2e-3,
    "rate": 1e-2,
    "joints": 1e-3,
    "joint_rates": 1e-2,
    "specific_force": 0.05,
}
CLOSE = 1e-6


def scenario_of(
    case: str, *, start: float | None = None, duration: float, **tables: Any
) -> skyarm.Scenario:
    """A shipped case under the law, its motion from ``start`` (s) on, with tables
    replaced.
    """
    file = tomllib.loads(
        (LIBRARY / "scenario" / "library" / f"{case}.toml").read_text("utf-8")
    )
    motions = [file["reference"]["base"], *file["reference"]["joints"]]
    for motion in motions if start is not None else ():
        motion["start"] = start
    file |= {"controller": {"preset": "centroidal_tip"}, "duration": duration} | tables
    file.pop("windows")
    return skyarm.scenario_from(file)


def recorded(scenario: skyarm.Scenario) -> list[tuple[Any, Any, list[Any], Any, Any]]:
    """Of each period of a flight: measurement, reference, its samples to come, rotor
    speeds and efforts commanded.
    """
    session, rows = skyarm.Session(scenario), []
    while session.running:
        seen, reference = session.measurement, session.reference
        names = (
            "position",
            "quaternion",
            "velocity",
            "rate",
            "joints",
            "joint_rates",
            "specific_force",
        )
        taken = {name: np.array(getattr(seen, name), dtype=float) for name in names}
        ahead = [np.array(each, dtype=float) for each in samples_ahead(reference)]
        rows.append(
            (SimpleNamespace(**taken), np.array(samples(reference), dtype=float), ahead)
        )
        session.step()
    log = session.log
    assert log.status == "completed"
    return [
        (*row, *sent)
        for row, *sent in zip(rows, log.rotor_commands, log.efforts, strict=True)
    ]


def written(scenario: skyarm.Scenario) -> WrittenLaw:
    """The law written from the page, for the model's file."""
    rates = scenario.rates
    vehicle = vehicle_of(LIBRARY / "vehicle" / "library" / "hummingbird_arm2.toml")
    delay = round(scenario.delays.measurement * rates.control)
    return WrittenLaw(vehicle, 9.81, 1.0 / rates.control, 1.0 / rates.reference, delay)


def differences(rows: list[Any], law: WrittenLaw) -> Any:
    """Largest relative difference in each period: of rotor speeds, of efforts (of the
    limit).

    Speeds count as 10 rad/s at least: near a standstill they are the root of a thrust
    that is rounded as a large one.
    """
    found = []
    for measurement, held, ahead, speeds, efforts in rows:
        own_speeds, own_efforts = law.step(measurement, held, ahead)
        off = (np.abs(own_speeds - speeds) / np.maximum(speeds, 10.0)).max()
        found.append(max(off, np.abs((own_efforts - efforts) / 0.5).max()))
    return np.array(found)


PAGE = " ".join(law_equations().split())
PHRASES = {
    "observer": "`observer = [force, torque, joints, pose]` ({}, {}, {}, {} rad/s)",
    "base": "`base = [k_p, k_v, K_R, K_w]` ({}, {}, {}, {})",
    "yaw": "`yaw` those about z ({}, {})",
    "arm": "`arm = [k_p, k_d]` ({}, {})",
    "tip": "`tip = [k_p, k_d]` ({}, {})",
    "reach": "`reach` ({} m",
    "damping": "`damping` ({} m",
    "posture": "`posture` (0.1 mm)",
    "shift_rate": "`shift_rate` ({} rad/s)",
    "pull": "`a` = {} m/s^2,",
    "tilt": "`tilt` ({})",
    "approach": "deceleration `b` = {} m/s^2",
    "low_thrust": "Below `c` = {} of the weight",
    "arm_turn": "`size` exceeds {} rad/s^2",
    "yaw_slack": "`t_0` is {} rad/s^2",
    "lag_inversion": "`kappa` = {}",
    "trim_rate": "the trim grows at {} 1/s",
    "preview": "`preview` ({} s for an arm of 0.3 m)",
    "lag": "`lag = [T_b, T_j]` (20, 12 ms)",
    "velocity_noise": "`N` = {} m/s/Hz^0.5",
    "accelerometer": "`accelerometer = [force, velocity]` ({}, {} rad/s)",
    "force_trend": "`force_trend`** (`force_trend.py`; {} rad/s = `Omega`,",
    "adaptation": "`adaptation` ({} 1/s)",
    "friction_adaptation": "{} 1/s is the rate of the damping",
    "tip_mass_limit": "`tip_mass_limit` ({} kg)",
}


def test_the_numbers_of_the_written_law_are_those_of_the_page() -> None:
    assert PHRASES.keys() == vars(written_parts.NUMBERS).keys()
    assert (written_parts.NUMBERS.posture, written_parts.NUMBERS.lag) == (
        1e-4,
        (0.020, 0.012),
    )
    for name, phrase in PHRASES.items():
        value = getattr(written_parts.NUMBERS, name)
        shown = phrase.format(
            *(f"{each:g}" for each in (value if isinstance(value, tuple) else (value,)))
        )
        assert shown in PAGE, shown


def test_the_numbers_of_the_law_are_those_of_the_page() -> None:
    numbers = vars(written_parts.NUMBERS)
    shared = VALUES.keys() & numbers.keys()
    assert shared >= {
        *GAINS,
        "accelerometer",
        "adaptation",
        "force_trend",
        "lag",
        "preview",
    }
    assert {name: VALUES[name] for name in shared} == {
        name: numbers[name] for name in shared
    }
    assert pytest.approx((written_parts.SEEN, written_parts.FELT)) == (
        noise_estimate.SEEN,
        noise_estimate.FELT,
    )


@pytest.fixture(scope="module")
def short() -> tuple[skyarm.Scenario, list[Any]]:
    """0.6 s of Case 3 in wind, whose circle begins with its step of 0.3 m at 0.2 s."""
    scenario = scenario_of("case3_wind", start=0.2, duration=0.6)
    return scenario, recorded(scenario)


def test_a_law_written_from_the_page_gives_the_commands_of_the_law(short: Any) -> None:
    scenario, rows = short
    assert differences(rows, written(scenario)).max() < CLOSE


def test_a_law_written_from_the_page_turns_back_from_upside_down() -> None:
    about = np.array([math.sin(5e-4), *(math.cos(5e-4) * np.array([0.6, 0.0, 0.8]))])
    start = {"quaternion_wxyz": about.tolist(), "position": [0.0, 0.0, 9.0]}
    scenario = scenario_of(
        "case3", duration=0.02, initial=start, environment={"ground": False}
    )
    assert differences(recorded(scenario), written(scenario)).max() < CLOSE


def test_a_law_written_from_the_page_takes_blows() -> None:
    """Of one period: one after which no rotor is at its limit, and a larger one; under
    five times the bench's noise.
    """
    blows = [
        {
            "kind": "disturbance",
            "force": [
                {
                    "kind": "constant",
                    "value": 100.0 * size,
                    "start": start,
                    "stop": start + 0.005,
                },
                0.0,
                0.0,
            ],
            "torque": [
                0.0,
                {
                    "kind": "constant",
                    "value": 4.0 * size,
                    "start": start,
                    "stop": start + 0.005,
                },
                0.0,
            ],
        }
        for start, size in ((0.05, 1.0), (0.15, 5.0))
    ]
    noise = NOISE | {"velocity": 0.05}
    scenario = scenario_of(
        "case3", duration=0.3, environment={"forces": blows}, sensors=noise
    )
    rows, law = recorded(scenario), written(scenario)
    assert differences(rows, law).max() < CLOSE


def test_a_wrong_number_of_the_page_is_found(
    short: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario, rows = short
    monkeypatch.setattr(written_parts.NUMBERS, "shift_rate", 3.03)
    assert differences(rows[:60], written(scenario)).max() > CLOSE


ABRUPT = {
    "base": {
        "kind": "signals",
        "x": {"kind": "ramp", "start": 0.1, "duration": 0.02, "height": 1.5},
        "z": [
            2.0,
            {"kind": "sine", "amplitude": 0.25, "frequency_hz": 1.25, "start": 0.3},
        ],
    },
    "joints": [
        {"kind": "sine", "amplitude": 0.9, "frequency_hz": 2.0, "phase": phase}
        for phase in (0.0, 0.9)
    ],
}
"""A reference that takes rotors and joints to their limits."""


@pytest.fixture(scope="module")
def abrupt() -> tuple[skyarm.Scenario, list[Any]]:
    """1.2 s of it, in wind and noise, of the velocity five times the bench's.

    Of a rotor that turns slowly while another is at its limit the speed is the root of
    a thrust that is rounded as the other's: of nine draws of the noise six have an
    instant with 1e-6 to 6e-6. This draw has none.
    """
    noise = NOISE | {"velocity": 0.05}
    scenario = scenario_of(
        "case3_wind", duration=1.2, reference=ABRUPT, sensors=noise, seed=4
    )
    return scenario, recorded(scenario)


@pytest.mark.thorough
def test_it_does_where_rotors_and_joints_are_at_their_limits(abrupt: Any) -> None:
    scenario, rows = abrupt
    assert differences(rows, written(scenario)).max() < CLOSE
    stopped = np.array([speeds.min() <= 0.0 for *_, speeds, _ in rows])
    limited = np.array([np.abs(efforts).max() >= 0.5 for *_, efforts in rows])
    assert stopped.mean() > 0.2
    assert limited.any()


UNUSED = {"tip_mass_limit"}
"""A bound that none of these flights reaches."""


@pytest.mark.thorough
@pytest.mark.parametrize("name", sorted(vars(written_parts.NUMBERS)))
def test_a_number_of_the_page_enters_the_commands(
    short: Any, abrupt: Any, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """1 % more of it gives other commands in one of both flights."""
    value = getattr(written_parts.NUMBERS, name)
    changed = (
        tuple(1.01 * each for each in value)
        if isinstance(value, tuple)
        else 1.01 * value
    )
    monkeypatch.setattr(written_parts.NUMBERS, name, changed)
    flights = (short, abrupt)
    found = any(
        differences(rows, written(scenario)).max() > CLOSE for scenario, rows in flights
    )
    assert found == (name not in UNUSED)


@pytest.mark.thorough
@pytest.mark.parametrize("case", ["case3", "case3_wind"])
def test_it_does_over_the_whole_of_case_3(case: str) -> None:
    scenario = scenario_of(case, duration=30.0)
    found = differences(recorded(scenario), written(scenario))
    assert len(found) == 6000
    assert found.max() < CLOSE


@pytest.mark.thorough
def test_it_does_under_noise_with_known_and_unknown_delay() -> None:
    """Measurements 5 ms old, and commands that become 20 ms late at 2 s, which the lag
    estimate finds.
    """
    delays = {"measurement": 0.005, "longest_command": 0.02}
    late = [{"at": 2.0, "path": "delays.command", "value": 0.02}]
    scenario = scenario_of(
        "case3", start=0.5, duration=5.0, sensors=NOISE, delays=delays, changes=late
    )
    law = written(scenario)
    assert differences(recorded(scenario), law).max() < CLOSE
    assert law._lags()[1][0] > 0.01
