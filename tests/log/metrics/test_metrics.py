"""Metrics of logs written by hand, whose answers follow from the definition."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import skyarm
from skyarm.algebra import Sym3, Vec3
from skyarm.compile.machine_code import NoMachineCodeError
from skyarm.log.metrics import score
from skyarm.log.metrics.score import over_log, settling_time
from skyarm.log.metrics.windows import Windows
from skyarm.log.tip_positions import level_tip, tip
from skyarm.paper.flights import GUST, HOLDS, HOVER, STEADY, TRANSIENT
from skyarm.paper.flights import metrics as paper_metrics
from skyarm.simulate import Log, Window
from skyarm.vehicle.linkage import BASE, Body, Joint, Link
from skyarm.vehicle.vehicle_records import Frame, Vehicle
from support import logs as m

RATE, SECONDS = 200, 30.0
Array = npt.NDArray[np.float64]


def log(**arrays: Array | Callable[[Array], Array]) -> Log:
    """A log of 30 s at rest at the origin, the reference too; arrays are given or made
    from the time.
    """
    t = np.arange(round(SECONDS * RATE)) / RATE
    n = t.size
    shapes = {
        "time": (n,),
        "yaw_held": (n,),
        "yaw_reference": (n,),
        "quaternion": (n, 4),
    }
    shapes |= dict.fromkeys(
        ("joints", "joint_rates", "efforts", "joints_held", "joint_rates_held"), (n, 2)
    )
    shapes |= dict.fromkeys(("joints_reference", "measured_joints"), (n, 2))
    shapes |= dict.fromkeys(("rotor_speeds", "rotor_commands"), (n, 4))
    values: dict[str, Any] = {
        field.name: np.zeros(shapes.get(field.name, (n, 3)))
        for field in dataclasses.fields(Log)
        if field.name not in ("info", "received", "path_time", "phase")
    }
    values["time"] = t
    values["quaternion"][:, 0] = 1.0
    for name, array in arrays.items():
        values[name] = array(t) if callable(array) else array
    rates = {"control": RATE, "reference": 50}
    return Log(
        **values, info={"status": "completed", "rates_hz": rates, "duration": SECONDS}
    )


PAPERS = Windows(
    steady=STEADY, transient=TRANSIENT, gust=GUST, hover=HOVER, holds=HOLDS
)


FORMS = ("", "_continuous")


def scored(flight: Log, *names: str, windows: Windows = PAPERS) -> list[float]:
    """Metrics of a log in the paper's windows."""
    return list(skyarm.score(flight, names, windows).values())


def column(
    i: int, function: Callable[[Array], Array], width: int = 3
) -> Callable[[Array], Array]:
    def made(t: Array) -> Array:
        table = np.zeros((t.size, width))
        table[:, i] = function(t)
        return table

    return made


def pitched(function: Callable[[Array], Array]) -> Callable[[Array], Array]:
    def made(t: Array) -> Array:
        half = function(t) / 2.0
        return np.stack([np.cos(half), 0 * t, np.sin(half), 0 * t], axis=1)

    return made


def test_windows_are_half_open() -> None:
    window, flight = Window(10.0, 20.0), log()
    inside = flight.time[window.of(flight)]
    assert (inside[0], inside[-1], inside.size) == (10.0, 19.995, 2000)
    assert flight.time[HOVER.of(flight)][[0, -1]].tolist() == [4.0, 5.895]


@pytest.mark.parametrize(
    ("time", "counted"), [(9.995, False), (10.0, True), (19.995, True), (20.0, False)]
)
def test_a_spike_counts_exactly_inside_its_window(time: float, counted: bool) -> None:
    flight = log(position=column(0, lambda t: np.where(t == time, 0.5, 0.0)))
    largest, mean = scored(flight, "position_error_max", "position_error_mean")
    assert largest == (0.5 if counted else 0.0)
    assert mean == pytest.approx(0.5 / 2000 if counted else 0.0)


def test_the_paper_s_windows() -> None:
    assert (STEADY.start, STEADY.stop) == (10.0, 20.0)
    assert (TRANSIENT.start, TRANSIENT.stop) == (0.0, 8.0)
    assert (GUST.start, GUST.stop) == (5.0, 20.0)
    assert (HOVER.start, HOVER.stop) == (4.0, 5.9)
    # ramp 6-7 s, hold 7-12 s, ramps 12-14 s, hold 14-19 s: the last 3 s of each
    assert [(w.start, w.stop) for w in HOLDS] == [(9.0, 12.0), (16.0, 19.0)]


def test_errors_are_norms_of_actual_minus_desired() -> None:
    flight = log(
        position=np.tile([3.0, 4.0, 1.0], (6000, 1)),
        position_held=np.tile([0.0, 0.0, 1.0], (6000, 1)),
        joints=np.tile([0.3, 0.0], (6000, 1)),
        joints_held=np.tile([0.0, 0.4], (6000, 1)),
        tool=np.tile([1.0, 2.0, 2.0], (6000, 1)),
    )
    assert over_log(flight, "position")[0] == 5.0
    assert over_log(flight, "joint")[0] == 0.5
    assert over_log(flight, "ee")[0] == 3.0
    assert (over_log(flight, "x")[0], over_log(flight, "height")[0]) == (3.0, 0.0)


def test_held_and_continuous_are_taken_against_their_own_reference() -> None:
    flight = log(
        **{
            f"{name}_held": column(0, lambda t: 0 * t + 1.0, width)
            for name, width in (("position", 3), ("joints", 2))
        },
        **{
            f"{name}_reference": column(0, lambda t: 0 * t - 2.0, width)
            for name, width in (("position", 3), ("joints", 2))
        },
        tool_held=column(1, lambda t: 0 * t + 3.0),
        tool_reference=column(1, lambda t: 0 * t - 4.0),
    )
    held, free = (
        [over_log(flight, f"{q}{form}")[0] for q in ("position", "joint", "ee")]
        for form in FORMS
    )
    assert held == [1.0, 1.0, 3.0]
    assert free == [2.0, 2.0, 4.0]
    found = paper_metrics("case2", flight)
    assert found["position_error_mean"] == pytest.approx(1.0)
    assert found["position_error_mean_continuous"] == pytest.approx(2.0)


def test_rms_of_attitude_and_torques() -> None:
    flight = log(
        quaternion=pitched(lambda t: 0.2 * np.sin(2.0 * np.pi * t)),
        efforts=column(1, lambda t: np.where(t < 15.0, 0.3, -0.1), 2),
    )
    pitch, roll, first, second = scored(
        flight, "pitch_rms", "roll_rms", "tau1_rms", "tau2_rms"
    )
    assert pitch == pytest.approx(0.2 / math.sqrt(2.0), rel=1e-9)  # ten whole periods
    assert roll == 0.0
    assert first == 0.0
    assert second == pytest.approx(math.sqrt((0.09 + 0.01) / 2.0))


def test_the_integral_of_a_constant_error_is_error_times_time() -> None:
    flight = log(
        position=column(2, lambda t: 0 * t - 0.1),
        joints=column(0, lambda t: 0 * t + 0.2, 2),
    )
    assert scored(flight, "iae_position", "iae_joint") == pytest.approx(
        [0.1 * 30.0, 0.2 * 30.0]
    )
    assert scored(flight, "gust_iae_position", "gust_iae_joint") == pytest.approx(
        [0.1 * 15.0, 0.2 * 15.0]
    )
    for case, seconds in (("case2", 30.0), ("case2_gust", 15.0), ("case3_wind", 30.0)):
        found = paper_metrics(case, flight)
        assert found["iae_position"] == pytest.approx(0.1 * seconds)
        assert found["iae_joint"] == pytest.approx(0.2 * seconds)


def test_the_integral_counts_each_sample_for_one_control_period() -> None:
    flight = log(position=column(0, lambda t: np.where(t == 12.0, 1.0, 0.0)))
    assert scored(flight, "gust_iae_position") == pytest.approx([0.005])


def test_peaks_in_the_transient_are_magnitudes() -> None:
    flight = log(
        quaternion=pitched(
            lambda t: np.select([t == 7.0, t == 7.5, t == 9.0], [-0.3, 0.2, 0.9], 0.0)
        ),
        position=column(0, lambda t: np.select([t == 6.0, t == 8.0], [-0.4, 0.9], 0.0)),
    )
    assert scored(flight, "peak_pitch", "peak_position") == pytest.approx([0.3, 0.4])
    found = paper_metrics("case2", flight)
    assert (found["peak_pitch"], found["peak_position"]) == (
        pytest.approx(0.3),
        pytest.approx(0.4),
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_peaks_in_a_gust_carry_their_sign(sign: float) -> None:
    flight = log(
        quaternion=pitched(
            lambda t: sign * np.select([t == 8.0, t == 9.0], [-0.4, 0.3], 0.0)
        ),
        position=column(
            0,
            lambda t: (
                sign * np.select([t == 8.0, t == 9.0, t == 4.0], [0.7, -0.6, 5.0], 0.0)
            ),
        ),
    )
    found = paper_metrics("case2_gust", flight)
    assert found["peak_pitch"] == pytest.approx(-0.4 * sign)
    assert found["peak_x"] == pytest.approx(0.7 * sign)


def test_ripple_is_half_peak_to_peak() -> None:
    flight = log(
        position=column(1, lambda t: 0.5 + 0.1 * np.sin(np.pi * t / 2.0)),
        quaternion=pitched(lambda t: -0.28 + 0.02 * np.cos(np.pi * t)),
    )
    found = paper_metrics("case3_wind", flight)
    assert found["position_ripple"] == pytest.approx(0.1)
    assert (found["position_min"], found["position_max"]) == (
        pytest.approx(0.4),
        pytest.approx(0.6),
    )
    assert found["pitch_mean"] == pytest.approx(-0.28, abs=1e-12)
    assert found["pitch_ripple"] == pytest.approx(0.02)
    assert found["peak_pitch"] == pytest.approx(0.30)


def test_settling_time_is_when_the_error_last_enters_the_band() -> None:
    # steady mean 0.1; leaves the band of 0.02 at 4 s and again from 6 s to 7 s
    flight = log(
        position=column(
            0,
            lambda t: np.select(
                [t < 2.0, t == 4.0, (t >= 6.0) & (t < 7.0)], [0.5, 0.2, 0.1201], 0.1
            ),
        )
    )
    assert settling_time(flight, STEADY) == 7.0
    assert paper_metrics("case1", flight)["settling_time_upper_bound"] == 7.0
    inside = log(position=column(0, lambda t: np.where(t < 7.0, 0.1199, 0.1)))
    assert settling_time(inside, STEADY) == 0.0
    later = dataclasses.replace(
        inside,
        position_reference=np.where(inside.time < 3.0, 0.05, 0.0)[:, None] * [1, 0, 0],
    )
    assert settling_time(later, STEADY, continuous=True) == 3.0


def test_settling_time_is_not_a_number_if_the_end_is_outside() -> None:
    flight = log(position=column(0, lambda t: np.where(t >= 29.995, 0.5, 0.1)))
    assert math.isnan(settling_time(flight, STEADY))
    assert math.isnan(settling_time(flight, Window(40.0, 50.0)))
    assert paper_metrics("case2", flight)["settling_time"] is None


def test_hover_offset_is_positive_below_the_reference() -> None:
    flight = log(
        position=column(2, lambda t: np.where((t >= 4.0) & (t < 5.9), 0.965, 9.0)),
        position_reference=column(2, lambda t: 0 * t + 1.0),
    )
    assert scored(flight, "hover_offset") == pytest.approx([0.035])


def test_held_position_error_is_the_mean_over_both_holds() -> None:
    flight = log(
        position=column(
            0,
            lambda t: np.select(
                [(t >= 9) & (t < 12), (t >= 16) & (t < 19)], [0.1, -0.2], 7.0
            ),
        )
    )
    assert scored(flight, "held_position_error") == pytest.approx([0.15])
    assert paper_metrics("case1", flight)["held_position_error"] == pytest.approx(0.15)


def test_an_episode_that_ended_early_has_no_numbers() -> None:
    whole = log(position=column(0, lambda t: 0 * t + 0.1))
    cut = dataclasses.replace(
        whole, **{name: array[:3000] for name, array in whole.arrays().items()}
    )
    ended = dataclasses.replace(cut, info={**cut.info, "status": "ground"})
    assert set(paper_metrics("case2", ended).values()) == {None}
    # rows of a shorter flight that completed: a window without rows has no number
    # either
    short = dataclasses.replace(
        whole, **{name: array[:1000] for name, array in whole.arrays().items()}
    )
    found = paper_metrics("case2", short)
    assert found["position_error_mean"] is None
    assert found["settling_time"] is None
    assert found["peak_position"] == pytest.approx(0.1)


def by_numpy(case: str, flight: Log, errors: m.Errors) -> dict[str, float]:
    """The paper's table of a case by the other form of the metrics."""
    window = GUST if case == "case2_gust" else STEADY
    found = m.motion(flight, window) | {"hover_offset": m.hover_offset(flight, HOVER)}
    if case == "case2_gust":
        return m.gust(flight, errors, window) | found
    if case == "case3_wind":
        return m.constant_wind(flight, errors, window, TRANSIENT) | found
    found |= m.steady_and_transient(flight, errors, window, TRANSIENT)
    if case == "case1":
        found["held_position_error"] = m.held_position_error(flight, errors, HOLDS)
        found["settling_time_upper_bound"] = found["settling_time"]
    return found


@pytest.mark.parametrize(
    "case", ["case1", "case2", "case2_gust", "case3", "case3_wind"]
)
def test_the_paper_s_table_has_the_metrics_and_the_order_that_numpy_gives(
    case: str,
) -> None:
    """Sums of thousands of numbers in another order: 1e-12 relative."""
    generator = np.random.default_rng(3)
    flight = log()
    noise = {
        name: array + 0.01 * generator.normal(size=array.shape)
        for name, array in flight.arrays().items()
        if name != "time"
    }
    noise["quaternion"] /= np.linalg.norm(noise["quaternion"], axis=1)[:, None]
    flight = dataclasses.replace(flight, **noise)
    wanted = by_numpy(case, flight, m.Errors.held(flight))
    wanted |= {
        f"{k}_continuous": v
        for k, v in by_numpy(case, flight, m.Errors.continuous(flight)).items()
    }
    found = paper_metrics(case, flight)
    assert list(found) == list(wanted)
    for name, value in wanted.items():
        assert found[name] == (
            None if math.isnan(value) else pytest.approx(value, rel=1e-12)
        ), name


def two_links() -> Vehicle:
    """An arm of two links of 0.15 m about +y, shifted forwards by 0.1 m."""
    limb = Body(mass=0.05, com=Vec3(0, 0, -0.07), inertia=Sym3(1e-4, 1e-4, 1e-4))
    joints = (
        Joint(name="a", position=Vec3(0.1, 0, 0)),
        Joint(name="b", position=Vec3(0, 0, -0.15)),
    )
    return Vehicle(
        name="two_links",
        base=Body(mass=1.0, inertia=Sym3(0.01, 0.01, 0.01)),
        links=(
            Link(name="one", parent=BASE, joint=joints[0], body=limb),
            Link(name="two", parent=0, joint=joints[1], body=limb),
        ),
        frames=(Frame(name="tip", link=1, position=Vec3(0, 0, -0.15)),),
        end_effector="tip",
    )


def by_hand(position: Array, yaw: float, a: float, b: float) -> Array:
    """p + R_z(yaw) p_e with p_e of a planar arm, equation (10), from 0.1 m in front of
    the base.
    """
    x = 0.1 - 0.15 * math.sin(a) - 0.15 * math.sin(a + b)
    z = -0.15 * math.cos(a) - 0.15 * math.cos(a + b)
    return position + np.array([x * math.cos(yaw), x * math.sin(yaw), z])


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.5])
def test_the_desired_tool_is_that_of_a_level_base_with_the_desired_heading(
    yaw: float,
) -> None:
    position = np.array([[1.0, -2.0, 3.0], [0.5, 0.2, 1.0]])
    joints = np.array([[0.3, -0.5], [1.0, 0.4]])
    found = level_tip(two_links(), position, np.array([yaw, yaw]), joints)
    for row in range(2):
        assert found[row] == pytest.approx(
            by_hand(position[row], yaw, *joints[row]), abs=1e-12
        )


def test_the_tool_follows_the_tilt_of_the_base() -> None:
    half = 0.2 / 2.0
    # RK4 keeps no length exactly
    quaternion = np.array([[math.cos(half), 0.0, math.sin(half), 0.0]]) * 1.0001
    found = tip(two_links(), np.zeros((1, 3)), quaternion, np.zeros((1, 2)))
    # the tip at (0.1, 0, -0.3) turned by 0.2 rad about +y
    expected = [
        0.1 * math.cos(0.2) - 0.3 * math.sin(0.2),
        0.0,
        -0.1 * math.sin(0.2) - 0.3 * math.cos(0.2),
    ]
    assert found[0] == pytest.approx(expected, abs=1e-12)


def test_a_vehicle_without_a_tool_is_its_own_tool() -> None:
    plain = skyarm.load_vehicle("hummingbird")
    position = np.array([[1.0, 2.0, 3.0]])
    assert np.array_equal(
        tip(plain, position, np.array([[1.0, 0.0, 0.0, 0.0]]), np.zeros((1, 0))),
        position,
    )


def test_without_machine_code_metrics_have_the_same_bits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flights = [
        skyarm.run(skyarm.load_scenario(name, duration=0.5))
        for name in ("case3_wind", "press_and_hold")
    ]
    windows = Windows(steady=Window(0.0, 0.5), transient=Window(0.0, 0.5))
    names = ("standard", "position_error_mean", "position_min", "peak_pitch")
    compiled = [skyarm.score(each, names, windows) for each in flights]
    # from the first instant on, as NumPy has it
    errors = np.linalg.norm(flights[0].position - flights[0].position_held, axis=1)
    assert compiled[0]["position_error_mean"] == pytest.approx(errors.mean(), rel=1e-12)

    def refuse(*_: Any, **__: Any) -> None:
        raise NoMachineCodeError

    monkeypatch.setattr(score, "Kernel", refuse)
    monkeypatch.setattr(score, "_kept_counter", score._make_counter)
    assert [repr(skyarm.score(each, names, windows)) for each in flights] == [
        repr(each) for each in compiled
    ]


def test_a_program_that_is_kept_counts_as_one_made_anew(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Flights of two and six joints, with a contact, of two vehicles, cut, without
    limits, in other windows.
    """
    names = ("case1", "press_and_hold", "two_hold_a_bar", "case3")
    flights = [skyarm.run(skyarm.load_scenario(name, duration=0.5)) for name in names]
    flights += [
        skyarm.run(skyarm.load_scenario("case1", duration=0.2)),
        dataclasses.replace(
            flights[0],
            info={k: v for k, v in flights[0].info.items() if k != "scenario_record"},
        ),
    ]
    ways = [
        Windows(steady=Window(0.0, end), transient=Window(0.0, end))
        for end in (0.1, 0.2)
    ]
    kept = [
        repr(skyarm.score(each, windows=way))
        for _ in range(2)
        for each in flights
        for way in ways
    ]
    assert kept[: len(kept) // 2] == kept[len(kept) // 2 :]
    assert score._kept_counter.cache_info().hits > 0
    monkeypatch.setattr(score, "_kept_counter", score._make_counter)
    assert kept[: len(kept) // 2] == [
        repr(skyarm.score(each, windows=way)) for each in flights for way in ways
    ]
