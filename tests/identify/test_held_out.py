"""Errors of held-out predictions: of true and wrong vehicles, of holding, and what a
flight's past is worth.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from made_up_fits import clocked

from skyarm.algebra import Quaternion, Vec3
from skyarm.flight_data.flight_data import Channel
from skyarm.identify import held_out
from skyarm.identify.held_out import (
    LASTING,
    MEMORIES,
    NOTHING,
    WHOLE,
    Ends,
    end_of_past,
    ends_of,
    errors_of,
    fading,
    learn_from_past,
    noises_of,
    one_step_errors,
    past_windows,
    predict_held_out,
    shares_of,
    thin_places,
)
from skyarm.identify.held_out_errors import (
    CURVE,
    HOLD,
    HORIZONS,
    IDENTIFIED,
    PAST,
    START,
    HorizonErrors,
    table_horizons,
)
from skyarm.identify.identified_numbers import Identified
from skyarm.identify.identified_parts import IdentifiedSurroundings
from skyarm.identify.open_loop import OpenLoopPredictor, places_of
from skyarm.identify.windows import ClockedWindows, on_clock
from support.flights import GRAVITY, NOISE, ONE, QUAD, STEP, flown, measured

pytest.importorskip("scipy", reason="needs the extra 'identify'")

DELAY = 0.0033
ABOUT = IdentifiedSurroundings(delay=DELAY)
POSES = ("position", "velocity", "quaternion")


def flight_of(vehicle=QUAD, duration=2.4, **more):
    return measured(flown(vehicle, duration, DELAY, 0.0), **more)


def identified(vehicle=QUAD, about=ABOUT):
    nothing = {
        "numbers": (),
        "correlation": np.zeros((0, 0)),
        "explained": {},
        "deviation": {},
        "settled": True,
    }
    return Identified(vehicle=vehicle, surroundings=about, seconds=3.0, **nothing)


def heavier(vehicle=QUAD):
    return dataclasses.replace(
        vehicle, base=dataclasses.replace(vehicle.base, mass=1.3 * vehicle.base.mass)
    )


def test_the_true_vehicle_predicts_a_flight_that_another_does_not():
    """The start vehicle is heavier, and flies without the dead time that was found."""
    found = predict_held_out(
        identified(), heavier(), [flight_of()], horizons=(0.01, 0.1, 0.5)
    )
    assert list(found.errors) == [IDENTIFIED, START, HOLD]
    assert found.flights == ("flight",)
    assert found.period == pytest.approx(STEP)
    assert found.has_poses
    assert found.notes == ()
    for model, start, held in zip(*found.errors.values(), strict=True):
        assert model.begins == start.begins == held.begins > 5
        for name in ("position", "velocity", "attitude", "rate"):
            assert getattr(model, name) < 2e-2 * getattr(held, name), (
                name,
                model.horizon,
            )
            assert getattr(model, name) < 0.2 * getattr(start, name), (
                name,
                model.horizon,
            )
    good, wrong, spread = (found.one_step[name] for name in (IDENTIFIED, START, HOLD))
    assert good.specific_force < 0.02 * min(wrong.specific_force, spread.specific_force)
    assert good.angular_acceleration < 0.02 * spread.angular_acceleration
    late = predict_held_out(
        identified(about=IdentifiedSurroundings()), QUAD, [flight_of()], horizons=(0.1,)
    )
    assert (
        late.errors[IDENTIFIED][0].attitude > 5.0 * found.errors[IDENTIFIED][1].attitude
    )


def test_a_flight_without_poses_shows_rates_and_accelerations_only():
    flight = flight_of(without=POSES)
    found = predict_held_out(identified(), heavier(), [flight], horizons=(0.03,))
    assert not found.has_poses
    assert found.notes == (
        (
            "flight: no quaternion is measured: rate and specific force are predicted,"
            " and no pose"
        ),
    )
    for errors in found.errors.values():
        assert all(
            math.isnan(each.position) and math.isnan(each.attitude) for each in errors
        )
    # without the drag of its speed
    assert found.errors[IDENTIFIED][0].rate < 0.3 * found.errors[HOLD][0].rate
    assert (
        found.one_step[IDENTIFIED].specific_force
        < 0.1 * found.one_step[START].specific_force
    )
    # beside one with poses it counts in accelerations alone
    both = predict_held_out(
        identified(), heavier(), [flight, flight_of()], horizons=(0.03,)
    )
    alone = predict_held_out(identified(), heavier(), [flight_of()], horizons=(0.03,))
    assert both.errors == alone.errors


@pytest.mark.parametrize(
    ("without", "note"),
    [
        (
            ("velocity",),
            (
                "the velocity is the slope of the position over 0.1 s, of begins over"
                " the 0.1 s before"
            ),
        ),
        (("position",), "the position is the sum of the velocity"),
    ],
)
def test_poses_that_are_not_measured_whole_are_said(without, note):
    found = predict_held_out(
        identified(), QUAD, [flight_of(without=without)], horizons=(0.1,)
    )
    assert found.notes == (f"flight: {note}",)
    assert found.errors[IDENTIFIED][0].position < 0.5 * found.errors[HOLD][0].position


def test_joints_are_given_as_measured_and_it_is_said():
    found = predict_held_out(
        identified(ONE), heavier(ONE), [flight_of(ONE)], horizons=(0.1,)
    )
    assert found.notes[-1].startswith("The motion of the joints is given as measured; ")
    assert found.errors[IDENTIFIED][0].attitude < 0.05 * found.errors[HOLD][0].attitude


def test_commands_at_10_hz_and_a_slow_gyro_are_predicted_in_the_shortest_steps():
    flight = flight_of()
    told = flight["rotor_speed_commands"]
    slow = {
        "rotor_speed_commands": dataclasses.replace(
            told, time=told.time[::50], values=told.values[::50]
        )
    }
    for name, every in (("gyro", 6), ("accelerometer", 6)):
        slow[name] = dataclasses.replace(
            flight[name],
            time=flight[name].time[::every],
            values=flight[name].values[::every],
        )
    found = predict_held_out(
        identified(), heavier(), [flight.with_channels(slow)], horizons=(0.01, 0.1)
    )
    assert found.period == pytest.approx(0.0133, abs=0.002)
    assert found.errors[IDENTIFIED][1].position < 0.25 * found.errors[HOLD][1].position


def test_a_flight_that_is_too_short_is_refused():
    for horizons, changes in (((60.0,), {}), ((0.1,), {"without": ("none",)})):
        flight = flight_of(**changes)
        if changes:
            gyro = flight["gyro"]
            inside = gyro.time < 0.3
            flight = flight.with_channels(
                {
                    "gyro": Channel(
                        time=gyro.time[inside], values=gyro.values[inside], source="g"
                    )
                }
            )
        with pytest.raises(
            ValueError, match=r"^flight: no stretch is long enough for a prediction$"
        ):
            predict_held_out(identified(), QUAD, [flight], horizons=horizons)


def loop_of(about=ABOUT, **more):
    flight = flight_of(**more)
    parts = on_clock(flight, QUAD, STEP)
    loop = OpenLoopPredictor(QUAD, about, [flight], [parts], GRAVITY)
    return loop, loop.windows([places_of(parts, QUAD, 50, 0.2)])


def test_a_window_of_the_past_tells_noises_state_and_the_torque_that_the_model_lacks():
    """Twice the noise of good sensors, found within a fifth; the state at the window's
    end is better than measured.
    """
    wrong = dataclasses.replace(ABOUT, torque=(0.002, -0.001, 0.0005))
    loop, errors = loop_of(wrong, noise=2.0)
    before = past_windows(loop, errors.windows, 0.2)
    assert (before.windows.begins + 100).tolist() == errors.windows.begins.tolist()
    noise, spread = noises_of(before, loop.begins(before.windows))
    for (name, _), found in zip(before.rows, noise[0], strict=True):
        assert found == pytest.approx(2.0 * NOISE[name], rel=0.2), name
    state, wrench = end_of_past(loop, errors, 0.2, noise, spread)
    assert wrench[:, 3:].mean(axis=0) == pytest.approx(
        [-0.002, 0.001, -0.0005], abs=1e-4
    )
    log, rows = flown(QUAD, 2.4, DELAY, 0.0), errors.windows.begins
    for name, better in (("position", 0.6), ("velocity", 0.6), ("rate", 0.6)):
        off, plain = (
            getattr(each, name) - log[name][rows]
            for each in (state, loop.begins(errors.windows))
        )
        assert np.sqrt((off**2).mean()) < better * np.sqrt((plain**2).mean()), name


def test_flights_without_windows_take_the_noise_of_the_others():
    quiet, loud = (
        flight_of(noise=1.0),
        flight_of(noise=4.0, name="other", without=("velocity",)),
    )
    parts = [on_clock(each, QUAD, STEP) for each in (quiet, loud)]
    loop = OpenLoopPredictor(QUAD, ABOUT, [quiet, loud], parts, GRAVITY)
    before = loop.windows([places_of(parts[0], QUAD, 100, 0.1), np.zeros(0, int)], 0.1)
    noise, _ = noises_of(before, loop.begins(before.windows))
    assert noise[1] == pytest.approx(noise[0])


def test_of_a_wrench_its_mean_stays_and_the_rest_fades():
    size = 4000
    windows = ClockedWindows(
        [clocked(size), clocked(size, name="b")],
        QUAD,
        0.1,
        places=[np.arange(0, size, 50)] * 2,
    )
    draw = np.random.default_rng(2)
    wrench = np.where(windows.owners[:, None] == 0, 2.0, -1.0) + draw.normal(
        scale=0.1, size=(windows.count, 6)
    )
    rows = np.flatnonzero(windows.owners == 0)[-5:]
    weights = np.exp(
        -(windows.begins[rows[-1]] - windows.begins[: rows[-1] + 1]) * STEP / LASTING
    )
    mean = (weights[:, None] * wrench[: rows[-1] + 1]).sum(axis=0) / weights.sum()
    ahead = fading(wrench, windows, 0.5)
    assert ahead(0.0) == pytest.approx(wrench)
    assert ahead(50.0)[rows[-1]] == pytest.approx(mean)
    assert ahead(0.5)[rows[-1]] == pytest.approx(
        mean + math.exp(-1.0) * (wrench[rows[-1]] - mean)
    )
    assert fading(wrench, windows, 0.0)(0.0)[rows[-1]] == pytest.approx(mean)
    # a flight begins anew
    assert ahead(50.0)[rows[-1] + 1] == pytest.approx(wrench[rows[-1] + 1])


def ends(count=400, seed=5):
    """Predictions of which the model counts by 0.7 and rest by 0.2 in positions, and
    only rest in rates.
    """
    draw = np.random.default_rng(seed)
    off = draw.normal(size=(4, 2, count, 3))
    measured = np.stack(
        [0.7 * off[0, 0] + 0.2 * off[0, 1], 1.5 * off[1, 0], 0.1 * off[2, 0], off[3, 1]]
    )
    return Ends(0.5, off, measured)


def test_shares_are_those_of_the_least_error_between_nothing_and_all():
    given = ends()
    found = shares_of(given)
    assert found[0] == pytest.approx(np.array([[0.7] * 3, [0.2] * 3]), abs=1e-9)
    assert found[1, 0] == pytest.approx(1.0)
    assert found[3] == pytest.approx(np.array([[0.0] * 3, [1.0] * 3]), abs=1e-9)
    assert errors_of(given, found).position == pytest.approx(0.0, abs=1e-9)
    assert errors_of(given, found).velocity < errors_of(given, WHOLE).velocity + 1e-9
    assert shares_of(
        Ends(0.5, given.off[:, :, :0], given.measured[:, :0])
    ) == pytest.approx(np.stack([WHOLE] * 4))


def test_errors_are_mean_distances_and_angles_between_attitudes():
    given = ends(3)
    held, model = errors_of(given, NOTHING), errors_of(given, WHOLE)
    assert (held.horizon, held.begins) == (0.5, 3)
    assert held.rate == pytest.approx(math.sqrt((given.measured[3] ** 2).sum() / 3))
    assert model.position == pytest.approx(
        math.sqrt(((given.measured[0] - given.off[0, 0]) ** 2).sum() / 3)
    )
    both = [
        Quaternion.of_rotation_vector(Vec3(*each[2].T))
        for each in (given.measured, given.off[:, 0])
    ]
    cosine = np.abs(sum(a * b for a, b in zip(*both, strict=True)))
    assert model.attitude == pytest.approx(
        math.sqrt((4.0 * np.arccos(cosine) ** 2).mean())
    )
    nothing = errors_of(ends(0), WHOLE)
    assert nothing.begins == 0
    assert math.isnan(nothing.position)


def test_means_of_a_step_count_where_two_of_them_are_flown_without_a_gap():
    """Of an accelerometer of four steps a sample: begins less than eight steps before
    the end show nothing.
    """
    loop, _ = loop_of(noise=1.0)
    (parts,), slow = loop.flights, copy.copy(loop)
    end = int(np.flatnonzero(parts.usable)[-1]) + 1
    slow.averaged = 4
    far = np.arange(end - 100, end - 7, 10)
    period, model, spread = one_step_errors(slow, [far])
    assert period == pytest.approx(4 * STEP)
    assert one_step_errors(slow, [np.append(far, range(end - 7, end))]) == (
        period,
        model,
        spread,
    )
    assert one_step_errors(slow, [np.append(far, end - 8)])[1] != model


def test_holding_s_accelerations_are_off_by_what_is_measured_about_its_mean():
    """Of the steps that are flown: the first two after each begin, and the turning of
    the first of them.
    """
    flight = flight_of()
    parts = on_clock(flight, QUAD, STEP)
    loop = OpenLoopPredictor(QUAD, ABOUT, [flight], [parts], GRAVITY)
    begins = places_of(parts, QUAD, 90)
    period, _, spread = one_step_errors(loop, [begins])
    # a sample is the mean of the step before it
    force = flight["accelerometer"].values[begins[:, None] + [1, 2]].reshape(-1, 3)
    rate = loop.measured.rate
    turned = (rate[begins + 1] - rate[begins]) / STEP
    for found, rows in (
        (spread.specific_force, force),
        (spread.angular_acceleration, turned),
    ):
        assert found == pytest.approx(
            math.sqrt(len(rows[0]) * ((rows - rows.mean(axis=0)) ** 2).mean()), rel=1e-9
        )
    assert period == STEP


def test_the_past_of_a_flight_helps_where_the_model_lacks_a_torque():
    """Fit and prediction on flights with noise; the model has a torque too much."""
    wrong = dataclasses.replace(ABOUT, torque=(0.006, -0.003, 0.001))
    seen, aside = flight_of(noise=1.0), flight_of(noise=1.0, seed=9, name="aside")
    words = {"seen": [seen], "horizons": (0.1, 0.2)}
    found = predict_held_out(identified(about=wrong), QUAD, [aside], **words).errors
    assert list(found) == [IDENTIFIED, PAST, START, HOLD]
    assert len({errors[0].begins for errors in found.values()}) == 1
    for plain, past in zip(found[IDENTIFIED], found[PAST], strict=True):
        assert past.attitude < 0.3 * plain.attitude
        assert past.position < plain.position


def test_of_pasts_the_best_in_flights_of_the_fit_is_chosen(monkeypatch):
    """Of a true vehicle that is all noise: the state of a window; and the same memory,
    whichever is tried last.
    """
    loop, errors = loop_of(noise=2.0)
    monkeypatch.setattr(held_out, "PASTS", (0.2,))
    chosen = []
    for memories in ((0.0, 1.0), (1.0, 0.0)):
        monkeypatch.setattr(held_out, "MEMORIES", memories)
        chosen.append(learn_from_past(loop, errors, (0.1, 0.25)))
    assert all(
        each.smoothed and each.seconds == 0.2 and len(each.shares) == 2
        for each in chosen
    )
    assert chosen[0].memory == chosen[1].memory


@pytest.mark.parametrize(
    ("horizons", "by"),
    [((0.1, 0.2), 0.2), ((0.1, 0.19), 0.1), ((0.1, 0.2, 0.3), 0.3)],
    ids=str,
)
def test_a_past_is_chosen_by_far_horizons_if_there_are_any(horizons, by, monkeypatch):
    """From 0.2 s on. Each horizon has another best memory, and the longer one's error
    is the more so.
    """
    best = {0.1: MEMORIES[1], 0.19: MEMORIES[1], 0.2: MEMORIES[0], 0.3: MEMORIES[2]}

    def errors_of(end, shares):
        horizon, memory = end
        size = (
            1e30
            if memory is None
            else (
                1.0
                if memory == best[horizon]
                else 10.0 ** (1.0 + 20.0 * (horizon == 0.1) + 3.0 * (horizon == 0.3))
            )
        )
        return HorizonErrors(
            horizon=horizon,
            begins=5,
            position=size,
            velocity=1.0,
            attitude=1.0,
            rate=1.0,
        )

    _learn_by(errors_of, monkeypatch)
    chosen = learn_from_past(*FAKES, horizons)
    assert chosen.memory == best[by]
    assert [horizon for horizon, _ in chosen.shares] == list(horizons)


FAKES = (
    SimpleNamespace(begins=lambda windows: "measured"),
    SimpleNamespace(windows=None),
)
"""Loop and errors of which nothing is read."""


def _learn_by(errors_of, monkeypatch, key=lambda smoothed, memory: memory):
    """Let the choice of a past see errors that are given by horizon and choice; None is
    without a past.
    """
    fakes = {
        "past_windows": lambda loop, windows, seconds: SimpleNamespace(windows=None),
        "noises_of": lambda before, begins: (None, None),
        "end_of_past": lambda *_: ("state", "wrench"),
        "fading": lambda wrench, windows, memory: memory,
        "_replace_fields": lambda states, others, names: names,
        "ends_of": lambda loop, errors, horizons, begins, memory=None: [
            (each, None if begins == "measured" else key(begins, memory))
            for each in horizons
        ],
        "shares_of": lambda end: end,
        "errors_of": errors_of,
    }
    for name, fake in fakes.items():
        monkeypatch.setattr(held_out, name, fake)


@pytest.mark.parametrize("size", [1.0, 0.01])
@pytest.mark.parametrize(
    ("attitude", "place", "kept"),
    [
        (1e-3, 1.1, True),
        (1e-3, 1.005, False),
        (1.1, 1e-3, True),
        (1.005, 1e-3, False),
        (0.5, 0.5, False),
    ],
)
def test_a_past_that_makes_attitudes_better_and_positions_worse_is_not_taken(
    attitude, place, kept, size, monkeypatch
):
    """States of the window that only help where they harm nothing, up to a hundredth;
    else the measured ones.

    Over one far horizon of two: it is harm. That of errors of one size is that of all.
    """

    def errors_of(end, shares):
        horizon, smoothed = end
        sizes = (
            (place, attitude)
            if smoothed
            else (1.0, 0.9)
            if smoothed == ()
            else (1.0, 1.0)
        )
        sizes = [
            size * each
            for each in (sizes if horizon < 1.0 or not smoothed else (0.9, 0.9))
        ]
        return HorizonErrors(
            horizon=horizon,
            begins=5,
            position=sizes[0],
            velocity=1.0,
            attitude=sizes[1],
            rate=1.0,
        )

    _learn_by(errors_of, monkeypatch, key=lambda smoothed, memory: smoothed)
    for horizons in ((0.5,), (0.5, 1.0)):
        assert (learn_from_past(*FAKES, horizons).smoothed == ()) == kept


def test_a_past_whose_errors_are_no_numbers_is_not_taken(monkeypatch):
    def errors_of(end, shares):
        size = math.nan if end[1] == () else 1.0
        return HorizonErrors(
            horizon=end[0],
            begins=5,
            position=size,
            velocity=1.0,
            attitude=1.0,
            rate=1.0,
        )

    _learn_by(errors_of, monkeypatch, key=lambda smoothed, memory: smoothed)
    assert learn_from_past(*FAKES, (0.5,)).smoothed != ()


def test_horizons_of_tables_are_among_those_of_figures_and_multiples_of_the_shortest():
    assert set(HORIZONS) <= set(CURVE)
    assert list(CURVE) == sorted(set(CURVE))
    assert [each / CURVE[0] for each in CURVE] == pytest.approx(
        [round(each / CURVE[0]) for each in CURVE]
    )
    assert [CURVE[k] for k in table_horizons(SimpleNamespace(horizons=CURVE))] == list(
        HORIZONS
    )
    assert table_horizons(SimpleNamespace(horizons=(0.2, 0.5))) == [1]


def test_rest_is_the_begin_s_pose_without_a_speed():
    """Beside holding, whose velocity and rate go on for 0.1 s."""
    loop, errors = loop_of()
    begins = loop.begins(errors.windows)
    (found,) = ends_of(loop, errors, (0.1,), begins)
    rest, begins = (
        found.off[:, 1],
        begins.at(np.flatnonzero(loop.left(errors.windows) >= round(0.1 / STEP))),
    )
    assert rest[0] == pytest.approx(-0.1 * begins.velocity, abs=1e-12)
    assert rest[1] == pytest.approx(-begins.velocity, abs=1e-12)
    assert rest[2] == pytest.approx(-0.1 * begins.rate, abs=1e-9)
    assert rest[3] == pytest.approx(-begins.rate, abs=1e-12)
    # holding itself is 0.1 s of a flight off, and the model hardly
    assert (
        np.abs(found.off[0, 0] - found.measured[0]).max()
        < 0.02 * np.abs(found.measured[0]).max()
    )


def test_places_are_thinned_evenly_to_about_so_many():
    """To less than one more a flight."""
    places = [np.arange(100), np.zeros(0, int), 7 + np.arange(50)]
    for most, every in ((150, 1), (149, 2), (50, 3), (30, 5)):
        found = thin_places(places, most)
        assert [each.tolist() for each in found] == [
            each[::every].tolist() for each in places
        ]
        assert sum(map(len, found)) < most + len(places)
    assert [each.size for each in thin_places([places[1]], 5)] == [0]


def test_flights_of_the_fit_without_poses_or_begins_without_a_past_show_none(
    monkeypatch,
):
    monkeypatch.setattr(
        held_out, "learn_from_past", lambda *_: pytest.fail("there is no past")
    )
    flight = flight_of()
    plain = predict_held_out(identified(), QUAD, [flight], horizons=(0.1, 1.3)).errors
    # no begin with a past has so long a horizon behind it
    for seen in ([flight_of(without=POSES)], [flight]):
        found = predict_held_out(
            identified(), QUAD, [flight], seen=seen, horizons=(0.1, 1.3)
        )
        assert found.errors == plain
