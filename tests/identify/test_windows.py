"""Windows of flights on an even clock: held commands, samples, where windows lie, and
what is known at their begins.
"""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from made_up_fits import HOVER, STEP, channel, clocked

from skyarm.flight_data.flight_data import Channel, FlightData
from skyarm.identify.windows import (
    ClockedWindows,
    SensorSamples,
    clock_step,
    held_over,
    on_clock,
    samples_on,
)
from support.flights import ONE, QUAD


def by_brute_force(commands, edges, delay, fine=4000):
    """Commands at the begins of steps, instants of the first switch within each, and
    values of slices of each.
    """
    last = np.searchsorted(commands.time, edges[:-1] - delay + 1e-9, "right") - 1
    before = commands.values[np.maximum(last, 0)]
    late, rows = [], []
    for a, b in pairwise(edges):
        inside = commands.time[
            (commands.time > a - delay + 1e-9) & (commands.time < b - delay - 1e-9)
        ]
        late.append(inside[0] + delay - a if len(inside) else 0.0)
        middles = a + (np.arange(fine) + 0.5) * (b - a) / fine
        at = np.searchsorted(commands.time, middles - delay, "right") - 1
        rows.append(commands.values[np.maximum(at, 0)])
    return before, np.array(late), np.array(rows)


@pytest.mark.parametrize("delay", [0.0, 0.0013, 0.004, -0.0007, 0.0211])
@pytest.mark.parametrize(
    "spacing", [0.0004, 0.0017, 0.002, 0.0071], ids=lambda each: f"{1e3 * each:g} ms"
)
def test_held_commands_switch_where_samples_are_and_keep_the_mean(delay, spacing):
    """Stamps of any spacing, some of them before and behind the clock: brute force in
    slices of a step.
    """
    draw = np.random.default_rng(round(1e7 * (spacing + abs(delay))))
    time = 0.01 + np.cumsum(spacing * draw.uniform(0.3, 1.7, size=60))
    commands = channel(time, draw.normal(size=(60, 2)))
    edges = STEP * np.arange(40)
    found = held_over(commands, edges, delay)
    before, late, rows = by_brute_force(commands, edges, delay)
    assert np.array_equal(found.before, before)
    assert found.late == pytest.approx(late, abs=1e-12)
    for k, each in enumerate(rows):
        first = late[k]
        whole = found.before[k] * first + found.after[k] * (STEP - first)
        # slices of a 4000th of the step, one to each side of a switch off by at most a
        # jump
        assert whole / STEP == pytest.approx(
            each.mean(axis=0), abs=4.0 * 6.0 / 4000.0
        ), k
    # a step without a switch holds one value all along
    still = late == 0.0
    alone = still & (np.ptp(rows, axis=1).max(axis=1) == 0.0)
    assert found.after[alone] == pytest.approx(found.before[alone])


def test_a_command_at_an_edge_holds_from_there_on():
    """Also if its stamp is rounded to either side of the edge: it switches no step but
    its own.
    """
    edges = 0.1 + STEP * np.arange(6)
    time = edges[[0, 2, 4]] + np.array([0.0, 1e-12, -1e-12])
    found = held_over(channel(time, [[1.0], [2.0], [3.0]]), edges, 0.0)
    assert found.before.ravel().tolist() == [1.0, 1.0, 2.0, 2.0, 3.0]
    assert found.after.ravel() == pytest.approx(found.before.ravel(), abs=1e-6)
    assert not found.late.any()


def test_commands_with_a_width_are_means_before_the_end_of_a_step_and_do_not_switch():
    time, values = 0.004 * np.arange(20), np.arange(20.0)
    edges = STEP * np.arange(2, 30)
    found = held_over(channel(time, values), edges, 0.001, width=0.006)
    assert not found.late.any()
    assert np.array_equal(found.before, found.after)
    for k, end in enumerate(edges[1:] - 0.001):
        middles = end - 0.006 + (np.arange(3000) + 0.5) * 2e-6
        mean = values[
            np.clip(np.searchsorted(time, middles, "right") - 1, 0, 19)
        ].mean()
        assert found.after[k, 0] == pytest.approx(mean, abs=2e-3), k
    # a width below a step is that of the step
    plain, thin = (
        held_over(channel(time, values), edges, 0.001),
        held_over(channel(time, values), edges, 0.001, 1e-4),
    )
    assert thin.after.ravel() * STEP == pytest.approx(
        (
            plain.before * plain.late[:, None]
            + plain.after * (STEP - plain.late[:, None])
        ).ravel()
    )


def test_samples_of_a_step_are_averaged_with_the_share_that_is_over():
    edges = 1.0 + 0.01 * np.arange(6)
    time = [0.995, 1.0, 1.002, 1.006, 1.01, 1.025, 1.05 + 1e-10, 1.07]
    found = samples_on(
        channel(time, [[9.0], [9.0], [1.0], [3.0], [5.0], [7.0], [8.0], [9.0]]), edges
    )
    # of those on an edge the step before it, of the first edge none
    assert found.there.tolist() == [True, False, True, False, True]
    assert found.values[found.there].ravel() == pytest.approx([3.0, 7.0, 8.0])
    assert found.share[found.there] == pytest.approx([0.6, 0.5, 1.0])
    assert found.share.max() <= 1.0


def test_samples_of_attitudes_are_of_unit_length_whatever_their_signs():
    angle = 0.1 * np.arange(4)
    rows = np.stack(
        [np.cos(0.5 * angle), 0.0 * angle, np.sin(0.5 * angle), 0.0 * angle], axis=1
    )
    found = samples_on(
        channel([0.001, 0.002, 0.003, 0.012], rows * np.array([[1], [-1], [-1], [1]])),
        np.arange(4) * 0.005,
    )
    assert np.linalg.norm(found.values, axis=1) == pytest.approx(1.0)
    wanted = [np.cos(0.05), 0.0, np.sin(0.05), 0.0]
    assert found.values[0] == pytest.approx(wanted, abs=1e-9)
    assert abs(found.values[2] @ rows[3]) == pytest.approx(1.0)
    assert found.there.tolist() == [True, False, True]


def flight(duration=4.0, commands=None, rate=500.0, name="flight", **more):
    """Flight at hover, by default, whose sensors read zeros."""
    time = np.arange(round(duration * rate)) / rate
    speeds = np.full((len(time), 4), HOVER) if commands is None else commands(time)
    rows = {"gyro": np.zeros((len(time), 3)), "accelerometer": np.zeros((len(time), 3))}
    channels = {each: channel(time, values) for each, values in rows.items()}
    channels |= {"rotor_speed_commands": channel(time, speeds), **more}
    return FlightData(name=name, file="none", channels=channels)


def spans(usable, edges):
    """Begins and ends (s) of the spans of usable steps."""
    change = np.diff(np.concatenate([[0], usable.astype(int), [0]]))
    both = zip(np.flatnonzero(change > 0), np.flatnonzero(change < 0), strict=True)
    return [(float(edges[a]), float(edges[b])) for a, b in both]


def test_steps_are_usable_where_the_vehicle_flies():
    """On the ground until 1 s and from 3 s on; half a second beside each is left
    out.
    """

    def commands(time):
        return np.where((time > 1.0) & (time < 3.0), HOVER, 100.0)[:, None] * np.ones(4)

    clocked = on_clock(flight(commands=commands), QUAD, STEP)
    ((first, last),) = spans(clocked.usable, clocked.edges)
    assert first == pytest.approx(1.5, abs=0.3)
    assert last == pytest.approx(2.5, abs=0.3)
    assert clocked.since[np.flatnonzero(clocked.usable)[0]] == pytest.approx(
        0.0, abs=2 * STEP
    )
    assert clocked.size == 1999
    assert clocked.edges[-1] == pytest.approx(3.998)


def test_a_clock_begins_with_the_gyro_whatever_zero_its_stamps_have():
    """A log that counts from the start of the computer flies as one that counts from
    its own.
    """
    volts, turned = (
        channel([0.0, 4.0], [[12.0], [10.0]]),
        channel(np.arange(2000) / 500.0, np.zeros((2000, 3))),
    )
    plain = flight(voltage=volts, position=turned)
    late = {
        name: dataclasses.replace(each, time=each.time + 1e5)
        for name, each in plain.channels.items()
    }
    first, found = (
        on_clock(each, QUAD, STEP, full_voltage=12.0)
        for each in (plain, plain.with_channels(late))
    )
    assert (found.begin, found.size) == (1e5, first.size)
    assert found.edges - 1e5 == pytest.approx(first.edges, abs=1e-9)
    assert np.array_equal(found.usable, first.usable)
    for name in ("since", "voltage"):
        assert getattr(found, name) == pytest.approx(getattr(first, name), abs=1e-8)


def test_sections_take_the_place_of_what_flies():
    clocked = on_clock(flight(), QUAD, STEP, sections=[(0.5, 1.0), (2.0, 2.2)])
    assert np.array(spans(clocked.usable, clocked.edges)) == pytest.approx(
        np.array([(0.5, 1.0), (2.0, 2.2)]), abs=STEP
    )
    assert clocked.since[0] == pytest.approx(-0.5)
    # a thrust drifts from the take-off on, whatever part counts
    assert on_clock(flight(), QUAD, STEP, sections=[(2.0, 2.2)]).since[
        0
    ] == pytest.approx(-0.5)


@pytest.mark.parametrize("sensor", ["gyro", "accelerometer", "joint_positions"])
def test_no_step_lies_in_a_gap_of_a_sensor_that_is_needed(sensor):
    """Gaps of more than five samples count, and so does what is before the first sample
    and behind the last.
    """
    whole = flight()
    time = np.array(
        [t for t in whole["gyro"].time if not 1.5 <= t < 1.6 and not 2.5 <= t < 2.507]
    )
    time = time if sensor == "gyro" else time[(time >= 1.1) & (time < 3.2)]
    vehicle, width = (ONE, 1) if sensor == "joint_positions" else (QUAD, 3)
    gappy = whole.with_channels({sensor: channel(time, np.zeros((len(time), width)))})
    clocked = on_clock(gappy, vehicle, STEP, sections=[(1.0, 3.4)])
    found = np.array(spans(clocked.usable, clocked.edges))
    begin, end = (1.0, 3.4) if sensor == "gyro" else (1.1, 3.2)
    assert found == pytest.approx(
        np.array([(begin, 1.498), (1.6, end)]), abs=1.5 * STEP
    )


def test_no_step_lies_across_a_reset_of_an_estimator():
    whole = on_clock(flight(), QUAD, STEP, sections=[(1.0, 3.0)])
    cut = on_clock(
        dataclasses.replace(flight(), jumps=((1.5, 1.55),)),
        QUAD,
        STEP,
        sections=[(1.0, 3.0)],
    )
    (first, last), *_ = spans(whole.usable, whole.edges)
    found = np.array(spans(cut.usable, cut.edges))
    assert found == pytest.approx(
        np.array([(first, 1.5), (1.55, last)]), abs=1.01 * STEP
    )


def test_no_step_lies_where_a_motor_coasts_or_recovers():
    """One motor of four below a tenth of the full signal from 1.6 to 1.7 s, and for
    three time constants after.
    """
    shares = HOVER / float(QUAD.rotors[0].max_speed)

    def commands(time):
        rows = np.full((len(time), 4), shares)
        rows[(time >= 1.6) & (time < 1.7), 2] = 0.09
        return rows

    plain = flight()
    rows = {
        name: each
        for name, each in plain.channels.items()
        if name != "rotor_speed_commands"
    }
    time = plain["gyro"].time
    given = FlightData(
        name="a",
        file="a",
        channels={**rows, "rotor_commands": channel(time, commands(time))},
    )
    clocked = on_clock(given, QUAD, STEP, sections=[(1.0, 3.0)])
    recovered = 3.0 * float(QUAD.rotors[0].time_constant_down)
    found = np.array(spans(clocked.usable, clocked.edges))
    assert found == pytest.approx(
        np.array([(1.0, 1.6), (1.7 + recovered, 3.0)]), abs=2 * STEP
    )
    # speeds that are commanded obey their lag
    speeds = given.with_channels(
        {
            "rotor_speed_commands": channel(
                time, commands(time) * QUAD.rotors[0].max_speed
            )
        }
    )
    assert (
        len(
            spans(
                on_clock(speeds, QUAD, STEP, sections=[(1.0, 3.0)]).usable,
                clocked.edges,
            )
        )
        == 1
    )


def test_flights_that_do_not_fit_the_vehicle_are_refused_in_one_line():
    time = flight()["gyro"].time
    with pytest.raises(
        ValueError,
        match=r"^flight: joint_positions: is not in this flight; there is gyro, ",
    ):
        on_clock(flight(), ONE, STEP)
    two = channel(time, np.zeros((len(time), 2)))
    for name in ("joint_positions", "joint_efforts", "joint_commands"):
        given = flight(
            joint_positions=channel(time, np.zeros((len(time), 1)))
        ).with_channels({name: two})
        with pytest.raises(
            ValueError, match=f"^flight: {name}: 2 columns, vehicle 'one_joint' has 1$"
        ):
            on_clock(given, ONE, STEP)
    with pytest.raises(
        ValueError, match=r"^flight: a table: 3 rotors, vehicle 'hummingbird' has 4$"
    ):
        on_clock(flight(commands=lambda t: np.ones((len(t), 3))), QUAD, STEP)


def test_commands_are_bounded_and_a_position_leaves_out_the_velocity():
    high = 2.0 * float(QUAD.rotors[0].max_speed)
    time = flight()["gyro"].time
    rows = channel(time, np.zeros((len(time), 3)))
    given = flight(
        commands=lambda t: np.full((len(t), 4), high), position=rows, velocity=rows
    )
    clocked = on_clock(given, QUAD, STEP)
    assert clocked.speeds.values.max() == QUAD.rotors[0].max_speed
    assert set(clocked.channels) == {"gyro", "accelerometer", "position"}
    alone = FlightData(
        name="b",
        file="b",
        channels={k: v for k, v in given.channels.items() if k != "position"},
    )
    assert "velocity" in on_clock(alone, QUAD, STEP).channels


def test_commands_at_ten_hertz_are_on_a_smooth_curve():
    """Steps of 0.1 s would leave their swing of 1 Hz by 6 rad/s, and straight lines by
    1 rad/s.
    """
    time = np.arange(0.0, 4.0, 0.1)

    def swing(time):
        return 400.0 + 20.0 * np.sin(2.0 * np.pi * time)[:, None] * np.ones(4)

    given = flight().with_channels({"rotor_speed_commands": channel(time, swing(time))})
    clocked = on_clock(given, QUAD, STEP)
    at = clocked.edges[:-1] + 0.5 * STEP
    inside = (at > 0.5) & (at < 3.4)
    assert clocked.speeds.values[inside] == pytest.approx(swing(at[inside]), abs=0.05)


def test_an_autopilot_s_commands_are_on_a_curve_through_its_samples():
    """Held at 100 Hz a sine of 3.7 Hz would be half a period late: 2 rad/s off."""
    time = np.arange(0.0, 4.0, 0.01)

    def swing(time):
        return 400.0 + 20.0 * np.sin(7.4 * np.pi * time)[:, None] * np.ones(4)

    given = flight().with_channels({"rotor_speed_commands": channel(time, swing(time))})
    clocked = on_clock(dataclasses.replace(given, facts={"vehicle": "PX4"}), QUAD, STEP)
    at = clocked.edges[:-1] + 0.5 * STEP
    inside = (at > 0.5) & (at < 3.4)
    assert clocked.speeds.values[inside] == pytest.approx(swing(at[inside]), abs=0.01)
    assert on_clock(given, QUAD, STEP).speeds.values == pytest.approx(swing(time))


def test_the_voltage_is_over_that_of_the_rotors_data():
    given = flight().with_channels({"voltage": channel([0.0, 4.0], [[12.0], [10.0]])})
    found = on_clock(given, QUAD, STEP, full_voltage=12.0).voltage
    assert found[0] == pytest.approx(1.0)
    assert found[1000] == pytest.approx(11.0 / 12.0)
    assert found[-1] == pytest.approx((12.0 - 0.5 * 3.996) / 12.0)
    assert found.shape == on_clock(given, QUAD, STEP).usable.shape == (1999,)
    assert (on_clock(given, QUAD, STEP).voltage == 1.0).all()


@pytest.mark.parametrize(
    ("gyro", "commands", "step"),
    [
        (500.0, 500.0, 0.002),
        (500.0, 50.0, 0.002),
        (100.0, 100.0, 0.005),
        (100.0, 400.0, 0.0025),
        (150.0, 20.0, 1.0 / 300.0),
        (200.0, 200.0, 0.005),
        (4000.0, 400.0, 0.001),
        (1000.0, 8000.0, 0.001),
    ],
)
def test_the_clock_s_step_is_a_whole_part_of_the_samples(gyro, commands, step):
    given = flight(rate=gyro)
    time = np.arange(round(4.0 * commands)) / commands
    given = given.with_channels(
        {"rotor_speed_commands": channel(time, np.full((len(time), 4), HOVER))}
    )
    assert clock_step([given], QUAD) == pytest.approx(step, rel=2e-5)
    # several flights: of the fastest one
    slow = flight(rate=50.0)
    assert clock_step([slow, given], QUAD) == pytest.approx(step, rel=2e-5)


RUN_IN = math.ceil(
    8.0
    * max(
        float(QUAD.rotors[0].time_constant_up), float(QUAD.rotors[0].time_constant_down)
    )
    / STEP
)


def test_windows_follow_each_other_where_all_of_their_steps_are_usable():
    usable = np.ones(600, dtype=bool)
    usable[[RUN_IN + 130, RUN_IN + 131, RUN_IN + 300]] = False
    windows = ClockedWindows([clocked(600, usable)], QUAD, 0.1)
    assert windows.run_in == RUN_IN
    assert windows.length == 50
    assert (windows.begins - RUN_IN).tolist() == [0, 50, 132, 182, 232, 301, 351, 401]
    assert windows.count == 8
    for begin in windows.begins:
        assert usable[begin : begin + windows.length].all()


def test_windows_of_several_flights_are_numbered_on_one_clock():
    given = [
        clocked(400, name="a"),
        clocked(RUN_IN + 10, name="b"),
        clocked(360, name="c"),
    ]
    windows = ClockedWindows(given, QUAD, 0.2)
    assert windows.firsts.tolist() == [0, 400, 410 + RUN_IN, 770 + RUN_IN]
    assert set(windows.owners.tolist()) == {0, 2}
    first, last = (windows.begins[windows.owners == i] for i in (0, 2))
    assert first.tolist() == [RUN_IN + 100 * k for k in range(3)]
    assert (last - windows.firsts[2]).tolist() == [RUN_IN + 100 * k for k in range(2)]
    # what lies before a flight's first step is that step, and none of the flight before
    assert (
        windows.before(-RUN_IN - 5)[windows.owners == 2] - windows.firsts[2]
    ).tolist() == [0, 95]
    few = ClockedWindows(given, QUAD, 0.2, 3)
    assert few.count == 3
    assert few.begins[[0, -1]].tolist() == windows.begins[[0, -1]].tolist()
    assert np.isin(few.begins, windows.begins).all()


def test_sensors_and_commands_of_one_flight_alone_are_none_in_the_others():
    time, draw = STEP * (np.arange(400) + 1), np.random.default_rng(1)
    gyro, speeds = (
        channel(time, np.full((400, 3), 1.0)),
        channel(2.0 * time, draw.normal(size=(400, 4))),
    )
    place, torque = (
        channel(time, np.full((400, 3), 2.0)),
        channel(time - STEP, np.full((400, 1), 3.0)),
    )
    flights = [
        clocked(400, name="a", channels={"gyro": gyro}, speeds=speeds),
        clocked(
            400, name="b", channels={"gyro": gyro, "position": place}, efforts=torque
        ),
    ]
    windows = ClockedWindows(flights, QUAD, 0.1)
    samples = windows.samples({})
    assert set(samples) == {"gyro", "position"}
    assert samples["gyro"].there.sum() == 800
    assert samples["position"].there.tolist() == [False] * 400 + [True] * 400
    assert samples["position"].values.shape == (800, 3)
    held = windows.commands("efforts", 0.0)
    assert held.after.ravel() == pytest.approx([0.0] * 400 + [3.0] * 400)
    # over three quarters of the time between samples once more
    wide, both = (
        windows.commands("speeds", 0.001, 0.75),
        held_over(flights[0].speeds, flights[0].edges, 0.001, 0.003),
    )
    assert wide.after[:400] == pytest.approx(both.after, rel=1e-9)
    assert not wide.late.any()
    # samples that are three steps late lie three steps sooner
    late = windows.samples({"position": 3 * STEP})["position"]
    assert late.there.tolist() == [False] * 400 + [True] * 397 + [False] * 3


def test_thrust_goes_with_voltage_time_and_flight():
    size = 300
    flights = [
        clocked(size, voltage=np.full(size, 0.9)),
        clocked(size, name="b", voltage=np.full(size, 0.8)),
    ]
    windows = ClockedWindows(flights, QUAD, 0.1)
    found = windows.thrusts(2.0, 0.01, 1.0, 0.7)
    since = STEP * np.arange(size)
    assert found[:size] == pytest.approx(0.81 * (1.0 + 0.01 * since))
    assert found[size:] == pytest.approx(0.7 * 0.64 * (1.0 + 0.01 * since))


def test_rotors_speeds_at_a_begin_are_those_of_a_long_simulation():
    """From the flight's first command on, in closed form from switch to switch; 3e-4 of
    a change are forgotten.
    """
    draw = np.random.default_rng(4)
    size, delay = 900, 0.0031
    time = 0.01 + np.cumsum(STEP * draw.uniform(1.0, 3.0, size=500))
    speeds = channel(time, draw.uniform(300.0, 700.0, size=(500, 4)))
    windows = ClockedWindows([clocked(size, speeds=speeds)], QUAD, 0.1)
    rotors = tuple(dataclasses.replace(each, max_speed=620.0) for each in QUAD.rotors)
    found = windows.rotor_speeds([rotors], [windows.commands("speeds", delay)])[0]
    up, down = (
        float(QUAD.rotors[0].time_constant_up),
        float(QUAD.rotors[0].time_constant_down),
    )
    begins = STEP * windows.begins
    speed, exact = np.minimum(speeds.values[0], 620.0), []
    for a, b in pairwise(
        np.unique(np.concatenate([[0.0], time + delay, begins, [STEP * size]]))
    ):
        if a in begins:
            exact.append(speed)
        target = speeds.values[
            max(np.searchsorted(time, 0.5 * (a + b) - delay, "right") - 1, 0)
        ]
        target = np.minimum(target, 620.0)
        speed = target + (speed - target) * np.exp(
            (a - b) / np.where(target > speed, up, down)
        )
    assert found == pytest.approx(np.array(exact), abs=0.12)
    assert np.ptp(exact, axis=0).min() > 80.0


def test_in_a_short_flight_rotors_begin_at_their_command_half_of_it_before():
    """Rather than with no window: a rotor that stood goes on from there in closed
    form.
    """
    size, up = 60, float(QUAD.rotors[0].time_constant_up)
    speeds = channel(STEP * np.array([-10.0, 20.0]), [[300.0] * 4, [600.0] * 4])
    windows = ClockedWindows([clocked(size, speeds=speeds)], QUAD, 0.02)
    assert (windows.run_in, windows.begins.tolist()) == (30, [30, 40, 50])
    found = windows.rotor_speeds(
        [QUAD.rotors, QUAD.rotors],
        [windows.commands("speeds", late) for late in (0.0, 0.01)],
    )
    assert found.shape == (2, 3, 4)
    for key, switch in enumerate((20, 25)):
        behind = STEP * (windows.begins - switch)
        # a window begins from the command of 30 steps before
        wanted = np.where(
            windows.begins - 30 < switch, 600.0 - 300.0 * np.exp(-behind / up), 600.0
        )
        assert found[key] == pytest.approx(np.tile(wanted[:, None], (1, 4)), rel=1e-9)


def moving(t):
    """Attitude that turns about y by an angle of 0.3 + 2 t."""
    half = 0.5 * (0.3 + 2.0 * t)
    return np.stack([np.cos(half), 0.0 * t, np.sin(half), 0.0 * t], axis=1)


@pytest.mark.parametrize("rate", [500.0, 120.0], ids=["each step", "now and then"])
def test_first_states_are_those_of_parabolas(rate):
    """A motion that is one in every sensor is given back, at the begin of the window
    and not at a sample's time.
    """
    size, even = 700, STEP * (np.arange(700) + 1)
    time = np.arange(0.0004, 1.4, 1.0 / rate)
    channels = {
        "gyro": channel(even, np.stack([1.0 + even, -even, even**2], axis=1)),
        "position": channel(time, np.stack([time, 2.0 * time**2, 1.0 - time], axis=1)),
        "quaternion": channel(time, moving(time)),
        "joint_positions": channel(even, (0.2 + 3.0 * even - even**2)[:, None]),
    }
    windows = ClockedWindows([clocked(size, channels=channels)], QUAD, 0.2)
    found, t = windows.first_states(windows.samples({})), STEP * windows.begins
    assert found["position"] == pytest.approx(
        np.stack([t, 2.0 * t**2, 1.0 - t], axis=1), abs=1e-9
    )
    assert found["velocity"] == pytest.approx(
        np.stack([t**0, 4.0 * t, -(t**0)], axis=1), abs=1e-8
    )
    assert found["rate"] == pytest.approx(
        np.stack([1.0 + t, -t, t**2], axis=1), abs=1e-9
    )
    assert found["joints"] == pytest.approx((0.2 + 3.0 * t - t**2)[:, None], abs=1e-9)
    assert found["joint_rates"] == pytest.approx((3.0 - 2.0 * t)[:, None], abs=1e-7)
    assert found["quaternion"] == pytest.approx(moving(t), abs=1e-5)
    assert np.linalg.norm(found["quaternion"], axis=1) == pytest.approx(1.0)


def test_first_states_of_a_motion_through_zero_average_noise_over_50_ms_on_each_side():
    """The variance of a parabola's value amid n samples is 9 / (4 n) of theirs
    (Savitzky and Golay 1964).
    """
    even, draw = STEP * (np.arange(2000) + 1), np.random.default_rng(6)
    line = (even[:, None] - 2.0) * np.array([1.0, -2.0, 3.0])
    noise = 0.01 * draw.normal(size=(2000, 3))
    windows = ClockedWindows(
        [clocked(2000, channels={"gyro": channel(even, line + noise)})], QUAD, 0.1
    )
    off = windows.first_states(windows.samples({}))["rate"] - (
        STEP * windows.begins[:, None] - 2.0
    ) * [1.0, -2.0, 3.0]
    assert np.sqrt((off**2).mean()) == pytest.approx(
        0.01 * math.sqrt(9.0 / (4.0 * 51.0)), rel=0.2
    )
    assert (np.abs(STEP * windows.begins - 2.0) < 0.06).any()


def test_first_states_without_a_pose_are_level_and_a_measured_velocity_counts():
    even = STEP * (np.arange(500) + 1)
    rows = {
        "gyro": channel(even, np.ones((500, 3))),
        "velocity": channel(even, np.tile([1.0, 2.0, 3.0], (500, 1))),
    }
    windows = ClockedWindows([clocked(500, channels=rows)], QUAD, 0.2)
    found = windows.first_states(windows.samples({}))
    assert (found["quaternion"] == [1.0, 0.0, 0.0, 0.0]).all()
    assert not found["position"].any()
    assert found["velocity"] == pytest.approx(
        np.tile([1.0, 2.0, 3.0], (windows.count, 1))
    )
    assert found["joints"].shape == (windows.count, 0)


def test_a_first_state_takes_samples_of_its_own_flight_only():
    even = STEP * (np.arange(400) + 1)
    flights = [
        clocked(
            400,
            name=str(i),
            channels={"gyro": channel(even, np.full((400, 3), float(i)))},
        )
        for i in range(3)
    ]
    windows = ClockedWindows(flights, QUAD, 0.1)
    assert windows.first_states(windows.samples({}))["rate"] == pytest.approx(
        np.tile(windows.owners[:, None].astype(float), (1, 3))
    )
    # few samples in all: what there is
    lonely = SensorSamples(np.ones((1200, 3)), np.ones(1200), np.arange(1200) == 390)
    assert windows.first_states({"position": lonely})["position"][
        windows.owners == 0
    ] == pytest.approx(1.0)
    assert not windows.first_states({"position": lonely})["position"][
        windows.owners > 0
    ].any()
    # one sample shows no speed
    assert not windows.first_states({"position": lonely})["velocity"].any()


def test_a_sensor_that_is_missing_has_attitudes_of_unit_length_and_zeros_of_others():
    edges = np.arange(4, dtype=float)
    level, still = (
        samples_on(
            Channel(time=np.zeros(0), values=np.zeros((0, width)), source="none"), edges
        )
        for width in (4, 3)
    )
    assert level.values.tolist() == [[1.0, 0.0, 0.0, 0.0]] * 3
    assert not level.there.any()
    assert still.values.tolist() == [[0.0] * 3] * 3


def test_commands_at_ten_hertz_are_taken_in_the_middle_of_each_step():
    """A straight ramp of 1000 rad/s in a second: a hundredth of a step beside the
    middle is 0.02 rad/s off.
    """
    time = np.arange(0.0, 4.0, 0.1)
    given = flight().with_channels(
        {
            "rotor_speed_commands": channel(
                time, (300.0 + 100.0 * time)[:, None] * np.ones(4)
            )
        }
    )
    found = on_clock(given, QUAD, STEP)
    at = found.edges[:-1] + 0.5 * STEP
    inside = (at > 0.5) & (at < 3.4)
    assert found.speeds.values[inside][:, 0] == pytest.approx(
        300.0 + 100.0 * at[inside], abs=1e-4
    )
