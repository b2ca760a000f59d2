"""Verdict on a flight that the model does not explain: which change is named, and where
each threshold lies.

Thresholds are written as numbers, so that one that is dropped, doubled or halved is
seen.
"""

from __future__ import annotations

import dataclasses
import re
from types import SimpleNamespace

import numpy as np
import pytest
from changed_channels import (
    ARM,
    DEGREES,
    POSE,
    SOUND,
    VEHICLE,
    columns,
    made,
    rows_of,
    same,
    then,
    times,
    times_of,
)

from skyarm.identify import identify_windows, isolate_fault
from skyarm.identify.channel_changes import ChannelChange, channel_changes
from skyarm.identify.isolate_fault import (
    PUSHES,
    Leavings,
    Left,
    TriedChange,
    find_faults,
)
from skyarm.identify.log_checks import REFUSED, WARNED

SENSORS = ("gyro", "accelerometer", *POSE, "joint_positions", "joint_rates")


class Fits:
    """In place of fits: sizes of rows by how far a flight is from one that would be
    white.

    Args:
        sizes: flight -> size of the rows of each sensor.
        unusual: flight -> how far the numbers are from the start's.
        delay: s, of the commands.
    """

    def __init__(self, sizes, unusual=lambda flight: 0.0, delay=0.005):
        self.sizes, self.unusual, self.delay = sizes, unusual, delay
        self.calls, self.flights = [], []

    @property
    def count(self):
        return len(self.calls)

    def __call__(self, start):
        return self

    def rows(self, flight, most, turns):
        self.calls.append((most, turns))
        self.flights.append(flight)
        found = self.sizes(flight)
        sensors = [name for name in flight if name in SENSORS]
        rows = {
            (name, axis): found.get(name, 1.0)
            for name in sensors
            for axis in range(flight[name].values.shape[1])
        }
        rows |= {(name, 0): found.get(name, 0.0) for name in PUSHES}
        return Left(rows, self.unusual(flight), self.delay)


def isolated(monkeypatch, sizes, flight=SOUND, clock=None, **others):
    fits = Fits(sizes, **others)
    monkeypatch.setattr(isolate_fault, "Leavings", fits)
    monkeypatch.setattr(isolate_fault, "align_poses", lambda flight: (flight, clock))
    return find_faults(flight, VEHICLE), fits


def differs(flight, name):
    """Whether a flight's channel is none or not that of the sound one."""
    rows, sound = (
        each[name].values if name in each else np.zeros(0) for each in (flight, SOUND)
    )
    return rows.shape != sound.shape or not np.allclose(rows, sound, atol=1e-6)


@pytest.mark.parametrize(("size", "searched"), [(1.295, False), (1.305, True)])
def test_a_row_alarms_from_some_times_its_noise_on(monkeypatch, size, searched):
    found, fits = isolated(monkeypatch, lambda flight: {"gyro": size})
    assert found == ()
    assert (fits.count > 1) is searched


def test_what_no_change_mends_is_said_of_the_model(monkeypatch):
    (fault,), _ = isolated(
        monkeypatch, lambda flight: {"gyro": 14.2, "position": 3.01, "velocity": 1.2}
    )
    assert (fault.severity, fault.channel) == (WARNED, "model")
    assert (
        fault.finding
        == "does not explain gyro (14 times its noise), position (3 times its noise)"
    )
    for size, channels in ((2.99, []), (3.01, ["model"])):
        found, _ = isolated(monkeypatch, lambda flight, size=size: {"position": size})
        assert [each.channel for each in found] == channels
    (fault,), _ = isolated(
        monkeypatch, lambda flight: {"gyro": 5.0, "unexplained force": 4.2}
    )
    assert (
        fault.finding
        == "does not explain gyro (5 times its noise) and leaves an unexplained force"
        " 4.2 times what is usual"
    )


def test_a_joint_s_name_may_hold_braces(monkeypatch):
    first, *others = VEHICLE.links
    named = dataclasses.replace(
        first, joint=dataclasses.replace(first.joint, name="arm{1}")
    )
    vehicle = dataclasses.replace(VEHICLE, links=(named, *others))
    wrong = rows_of("joint_positions", times(-1, 1))(SOUND)
    fits = Fits(
        lambda flight: (
            {"joint_positions": 9.0} if differs(flight, "joint_positions") else {}
        )
    )
    monkeypatch.setattr(isolate_fault, "Leavings", fits)
    monkeypatch.setattr(isolate_fault, "align_poses", lambda flight: (flight, None))
    (fault,) = find_faults(wrong, vehicle)
    assert fault.finding.startswith("the sign of arm{1} looks turned: ")


def test_the_change_that_makes_all_white_is_named_with_what_it_does(monkeypatch):
    wrong = rows_of("gyro", times(DEGREES, DEGREES, DEGREES))(SOUND)
    found, fits = isolated(
        monkeypatch,
        lambda flight: {"gyro": 47.0 if differs(flight, "gyro") else 1.1},
        wrong,
    )
    assert [each.words for each in found] == [
        "flight.csv: gyro: it looks like deg/s: the residual of gyro falls from 47"
        " times its noise to 1.1; state its unit in columns.toml"
    ]
    assert found[0].severity == REFUSED
    everything = sum(len(each.amounts) for each in channel_changes(wrong, VEHICLE))
    assert fits.count < 0.5 * everything, (
        "an attitude decides: what makes all white ends the search"
    )


@pytest.mark.parametrize(("share", "named"), [(1.1, "gyro"), (0.9, "model")])
def test_a_change_that_leaves_something_is_named_only_if_it_gains_much(
    monkeypatch, share, named
):
    wrong = rows_of("gyro", times(1, -1, 1))(SOUND)
    count = 20  # rows of the flight
    fall = np.exp(share * 0.3 * count / 3.0)

    def sizes(flight):
        return {
            "gyro": 400.0 if differs(flight, "gyro") else 400.0 / fall,
            "position": 1.5,
        }

    (fault,), _ = isolated(monkeypatch, sizes, wrong)
    assert fault.channel == named


def test_what_fits_as_well_is_told_beside(monkeypatch):
    """Without an attitude an order of the rotors may stand for axes of the gyro."""
    blind = dataclasses.replace(
        SOUND, channels={name: SOUND[name] for name in SOUND if name not in POSE}
    )
    wrong = rows_of("gyro", columns(1, 0, 2))(blind)

    def sizes(margin):
        def of(flight):
            if not differs(flight, "gyro"):
                return {"gyro": 1.0}
            turned = np.allclose(
                flight["rotor_speed_commands"].values,
                SOUND["rotor_speed_commands"].values[:, [0, 3, 2, 1]],
            )
            return {"gyro": margin if turned else 50.0}

        return of

    near, far = (float(np.exp(least * 10 / 3.0)) for least in (0.08, 0.12))
    (fault,), _ = isolated(monkeypatch, sizes(near), wrong)
    assert fault.channel == "gyro"
    assert (
        "x and y look swapped, or rotor commands: the rotors look mirrored, left for"
        " right" in fault.finding
    )
    (fault,), _ = isolated(monkeypatch, sizes(far), wrong)
    assert ", or " not in fault.finding


def test_a_channel_is_left_out_only_if_nothing_mends_it(monkeypatch):
    wrong = rows_of("position", times(1, -1, -1))(SOUND)
    foreign = then(
        wrong and rows_of("position", times(1, -1, -1)),
        rows_of("quaternion", columns(2, 1, 0, 3)),
    )(SOUND)

    def sizes(flight):
        bad = any(
            name in flight and differs(flight, name)
            for name in ("position", "quaternion")
        )
        return {"position": 20.0, "quaternion": 20.0} if bad else {}

    (fault,), _ = isolated(monkeypatch, sizes, wrong)
    assert fault.channel == "position"
    (fault,), _ = isolated(monkeypatch, sizes, foreign)
    assert (fault.severity, fault.channel) == (REFUSED, "pose")
    assert "does not belong to this flight: the residual of" in fault.finding
    assert (
        "is 20 times its noise, and without it all others are at most 1"
        in fault.finding
    )


@pytest.mark.parametrize(("left", "named"), [(1.29, "pose"), (1.31, "model")])
def test_a_channel_is_left_out_only_if_all_else_is_then_explained(
    monkeypatch, left, named
):
    def sizes(flight):
        return (
            {"quaternion": 20.0, "gyro": 7.0}
            if "quaternion" in flight
            else {"gyro": left}
        )

    (fault,), _ = isolated(monkeypatch, sizes)
    assert fault.channel == named


def test_leaving_out_costs_more_than_a_change_that_leaves_little(monkeypatch):
    wrong = rows_of("velocity", times(1.25, 1.25, 1.25))(SOUND)
    left = float(np.exp(0.4 * 0.35 * 20 / 3.0))

    def sizes(flight):
        if "velocity" not in flight:
            return {}
        return {"velocity": left if not differs(flight, "velocity") else 90.0}

    (fault,), _ = isolated(monkeypatch, sizes, wrong)
    assert "is 1.25 times what fits" in fault.finding


@pytest.mark.parametrize(("size", "channel"), [(1.5, []), (90.0, ["pose"])])
def test_a_channel_is_left_out_only_if_that_is_worth_its_price(
    monkeypatch, size, channel
):
    foreign = rows_of("quaternion", columns(2, 1, 0, 3))(SOUND)

    def sizes(flight):
        if "quaternion" not in flight:
            return {}
        return {"quaternion": size if same(flight, foreign) else 200.0}

    found, _ = isolated(monkeypatch, sizes, foreign)
    assert [each.channel for each in found] == channel


def test_a_channel_is_left_out_however_little_one_turn_tells_of_that(monkeypatch):
    foreign = rows_of("quaternion", columns(2, 1, 0, 3))(SOUND)

    def sizes(flight):
        if "quaternion" not in flight:
            return {"gyro": 1e4} if isolate_fault.Leavings.calls[-1] == (12, 1) else {}
        return {"quaternion": 90.0 if same(flight, foreign) else 80.0}

    (fault,), _ = isolated(monkeypatch, sizes, foreign)
    assert (fault.severity, fault.channel) == (REFUSED, "pose")


def test_an_amount_between_those_of_the_table_is_found(monkeypatch):
    wrong = rows_of("gyro", times(*(1.15,) * 3))(SOUND)

    def sizes(flight):
        if flight["gyro"].time.size != SOUND["gyro"].time.size:
            return {"gyro": 90.0}
        off = (
            np.abs(flight["gyro"].values - SOUND["gyro"].values).max()
            / np.abs(SOUND["gyro"].values).max()
        )
        return {"gyro": 1.0 + 300.0 * off}

    (fault,), _ = isolated(monkeypatch, sizes, wrong)
    scale = float(re.search(r"is ([\d.]+) times what fits", fault.finding)[1])
    assert scale == pytest.approx(1.15, abs=0.02)


def test_channels_that_a_check_names_alarm_no_more(monkeypatch):
    frozen = SOUND["position"].values.copy()
    frozen[400:500] = frozen[400]
    wrong = rows_of("position", lambda rows: frozen)(SOUND)
    found, fits = isolated(monkeypatch, lambda flight: {"position": 30.0}, wrong)
    assert [each.channel for each in found] == ["position"]
    assert "is frozen" in found[0].finding
    assert fits.count <= 2


def test_a_force_that_nothing_explains_alarms(monkeypatch):
    (fault,), _ = isolated(monkeypatch, lambda flight: {"unexplained force": 5.0})
    assert fault.finding == "leaves an unexplained force 5 times what is usual"


def test_a_refused_log_is_not_flown(monkeypatch):
    wrong = rows_of("accelerometer", times(*(0.1,) * 3))(SOUND)
    found, fits = isolated(monkeypatch, lambda flight: {"gyro": 9.0}, wrong)
    assert [each.channel for each in found] == ["accelerometer"]
    assert fits.count == 0


@pytest.mark.parametrize(("share", "named"), [(0.98, []), (1.02, ["accelerometer"])])
def test_what_only_an_odd_vehicle_explains_is_searched(monkeypatch, share, named):
    """A search that is long enough explains a wrong scale by masses and lengths that no
    vehicle has.
    """
    wrong = rows_of("accelerometer", times(0.8, 0.8, 0.8))(SOUND)

    def unusual(flight):
        mean, true = (
            np.linalg.norm(each["accelerometer"].values, axis=1).mean()
            for each in (flight, SOUND)
        )
        off = mean / true - 1.0
        return share * 200.0 * abs(off) / 0.2

    found, _ = isolated(monkeypatch, lambda flight: {}, wrong, unusual=unusual)
    assert [each.channel for each in found] == named
    if named:
        assert re.match(
            r"is 0\.[78]\d* times what fits: the start vehicle is 14 standard dev",
            found[0].finding,
        )


@pytest.mark.parametrize(
    ("after", "named"), [(1.8, False), (1.49, False), (1.43, True)]
)
def test_no_channel_is_accused_whose_residual_rises_or_hardly_falls(
    monkeypatch, after, named
):
    """A vehicle far off its start gains more by an exchange than the residual of the
    gyro pays for it.
    """

    def exchanged(flight):
        return differs(flight, "rotor_speed_commands")

    def sizes(flight):
        return {"gyro": after if exchanged(flight) else 1.63}

    found, _ = isolated(
        monkeypatch, sizes, unusual=lambda flight: 0.0 if exchanged(flight) else 400.0
    )
    accused = [each.channel for each in found if each.severity == REFUSED]
    assert accused == ["rotor commands"] * named
    assert all(
        "falls from 1.63 times its noise to 1.4" in each.finding
        for each in found
        if each.severity == REFUSED
    )


@pytest.mark.parametrize(("left", "named"), [(0.27, False), (0.23, True)])
def test_an_odd_vehicle_accuses_a_channel_that_halves_its_distance_from_the_start(
    monkeypatch, left, named
):
    """All is white before and after: what is left odd has another cause, as gusts have
    that a controller fights.
    """

    def unusual(flight):
        return 400.0 * (left if differs(flight, "rotor_speed_commands") else 1.0)

    found, _ = isolated(monkeypatch, lambda flight: {}, unusual=unusual)
    assert bool(found) == named


def test_of_two_changes_the_one_that_leaves_the_vehicle_as_it_was_is_named(monkeypatch):
    """Without an attitude a unit of the gyro and a clock explain the same, with other
    moments of inertia.
    """
    blind = dataclasses.replace(
        SOUND, channels={name: SOUND[name] for name in SOUND if name not in POSE}
    )
    wrong = rows_of("gyro", columns(1, 0, 2))(blind)

    def mirrored(flight):
        return np.allclose(
            flight["rotor_speed_commands"].values,
            SOUND["rotor_speed_commands"].values[:, [0, 3, 2, 1]],
        )

    def sizes(flight):
        return {
            "gyro": 1.0 if mirrored(flight) or not differs(flight, "gyro") else 50.0
        }

    (fault,), _ = isolated(
        monkeypatch, sizes, wrong, unusual=lambda flight: 60.0 * mirrored(flight)
    )
    assert fault.finding.startswith("x and y look swapped: the")
    (fault,), _ = isolated(
        monkeypatch, sizes, wrong, unusual=lambda flight: 60.0 * (not mirrored(flight))
    )
    assert fault.finding.startswith("the rotors look mirrored, left for right: the")


@pytest.mark.parametrize(
    ("late", "words"),
    [(0.059, ""), (0.085, "off by -80 ms"), (-0.07, r"off by \+75 ms")],
)
def test_commands_that_act_too_late_or_too_early_are_on_another_clock(
    monkeypatch, late, words
):
    found, _ = isolated(monkeypatch, lambda flight: {}, delay=late)
    assert [each.channel for each in found] == ["rotor commands"] * bool(words)
    assert all(
        re.match(f"stamps are {words}, . is late: they act", each.finding)
        for each in found
    )


def test_a_gyro_beyond_what_any_reads_is_of_the_unit_that_fits_best(monkeypatch):
    """A real flight leaves so much whatever is changed that the gain of the right unit
    may be small.
    """
    wrong = rows_of("gyro", times(DEGREES, DEGREES, DEGREES))(SOUND)
    found, _ = isolated(
        monkeypatch,
        lambda flight: {"gyro": 20.0, "position": 20.0 + differs(flight, "gyro")},
        wrong,
    )
    assert [each.channel for each in found] == ["gyro"]
    unit = "it looks like deg/s, or gyro: it looks like mrad/s"
    assert re.match(
        rf"{unit}: readings of up to 1\d\d rad/s are beyond those of any gyroscope$",
        found[0].finding,
    )
    slow = rows_of("gyro", times(2.0, 2.0, 2.0))(SOUND)
    found, _ = isolated(
        monkeypatch,
        lambda flight: {"gyro": 20.0, "position": 20.0 + differs(flight, "gyro")},
        slow,
    )
    assert [each.channel for each in found] == ["model"]


@pytest.mark.parametrize(
    ("margin", "others"), [(0.28, ", or gyro: it looks like mrad/s"), (0.32, "")]
)
@pytest.mark.parametrize("attitude", [True, False])
def test_units_that_fit_about_as_well_are_both_named(
    monkeypatch, attitude, margin, others
):
    """The residual of one row falls with the wrong unit, and none with the right one:
    neither decides.
    """
    flight = (
        SOUND
        if attitude
        else dataclasses.replace(
            SOUND, channels={n: SOUND[n] for n in SOUND if n not in POSE}
        )
    )
    wrong = rows_of("gyro", times(DEGREES, DEGREES, DEGREES))(flight)
    rows = sum(flight[name].values.shape[1] for name in flight if name in SENSORS)

    def sizes(flight):
        if not differs(flight, "gyro"):
            return {"gyro": 20.0, "accelerometer": 20.0}
        read = np.allclose(flight["gyro"].values, wrong["gyro"].values)
        return {
            "gyro": 20.0 if read else 10.0,
            "accelerometer": 20.0 if read else 40.0 * np.exp(margin * rows / 3.0),
        }

    (fault,), _ = isolated(monkeypatch, sizes, wrong)
    assert fault.finding.startswith(f"it looks like deg/s{others}: readings of up to")


def test_a_scale_of_a_gyro_beyond_its_range_needs_evidence_of_its_own(monkeypatch):
    """Slow turns in deg/s are within the range after a factor of 1.5, too."""
    largest = np.abs(SOUND["gyro"].values).max()
    wrong = rows_of("gyro", times(*(80.0 / largest,) * 3))(SOUND)

    def sizes(flight):
        slower = np.abs(flight["gyro"].values).max() < 10.0
        return {"gyro": 20.0, "position": 20.0 + 20.0 * slower}

    (fault,), _ = isolated(monkeypatch, sizes, wrong)
    assert "times what fits" not in fault.finding
    assert fault.finding.startswith("it looks like deg/s")


def test_a_flight_that_cannot_be_flown_is_searched(monkeypatch):
    wrong = rows_of("joint_rates", times(DEGREES, DEGREES))(SOUND)

    def sizes(flight):
        return dict.fromkeys(flight, np.inf) if differs(flight, "joint_rates") else {}

    (fault,), _ = isolated(monkeypatch, sizes, wrong)
    assert fault.channel == "joint_rates"
    assert (
        fault.finding
        == "it looks like deg/s: the motion under the commands is no number without"
        " this change"
    )
    (fault,), _ = isolated(monkeypatch, lambda flight: dict.fromkeys(flight, np.inf))
    assert (fault.severity, fault.finding) == (
        WARNED,
        "flies to infinity under the commands",
    )


def test_the_search_takes_the_cheap_way_first(monkeypatch):
    """Windows and turns: all changes with few, with more turns eight and those without
    a channel, four to the end.
    """
    wrong = rows_of("gyro", columns(2, 1, 0))(SOUND)
    _, fits = isolated(monkeypatch, lambda flight: {"gyro": 5.0}, wrong)
    kinds = [
        call for i, call in enumerate(fits.calls) if i == 0 or call != fits.calls[i - 1]
    ]
    assert kinds == [(60, 40), (12, 1), (12, 4), (60, 40)]
    assert fits.calls.count((12, 4)) == 8 + len(("pose", "joint_efforts"))
    assert fits.calls.count((60, 40)) == 1 + 4
    _, fits = isolated(monkeypatch, lambda flight: {"unexplained force": 5.0})
    assert (12, 1) not in fits.calls, "one turn tells little of a force between windows"


@pytest.mark.parametrize(("share", "tried"), [(0.797, True), (0.803, False)])
def test_a_change_that_mends_much_is_followed_to_the_end_at_once(
    monkeypatch, share, tried
):
    wrong = rows_of("gyro", times(-1, 1, 1))(SOUND)
    _, fits = isolated(
        monkeypatch,
        lambda flight: {"gyro": 1e6 ** (1.0 if differs(flight, "gyro") else share)},
        wrong,
    )
    assert ((60, 40) in fits.calls[1 : fits.calls.index((12, 4))]) is tried


@pytest.mark.parametrize(("seconds", "seen"), [(34.0, 30.0), (20.0, 20.0)])
def test_thirty_seconds_of_a_flight_are_looked_at(monkeypatch, seconds, seen):
    _, fits = isolated(monkeypatch, lambda flight: {}, made(seconds))
    assert fits.flights[0].duration == pytest.approx(seen, abs=1.1)


def noted(change, flight, amount):
    """In place of a change: the flight with a note of it."""
    return dataclasses.replace(
        flight, notes=(f"{change.channel}: {change.words.format(amount)}",)
    )


@pytest.mark.parametrize(
    ("cheap", "dear", "price"),
    [
        ("gyro: the sign of x", "gyro: the signs of x and y", 0.003),
        (
            "rotor commands: rotors 1 and 2",
            "rotor commands: the order of the rotors looks reversed",
            0.006,
        ),
        ("gyro: the sign of x", "gyro: is 0.8 times", 0.017),
        ("accelerometer: the sign of x", "accelerometer: is 0.8 times", 0.017),
        ("gyro: the sign of x", "rotor commands: begin at 6 %", 0.017),
        (
            "joint_rates: it looks like deg/s",
            f"joint_positions: zero of {ARM[0]} is off by 0.15",
            0.02,
        ),
        (
            "joint_rates: it looks like deg/s",
            "joint_positions: stamps are off by +50 ms",
            0.02,
        ),
        ("gyro: is 0.8 times", "time: runs 1.25 times", 0.08),
        (
            "gyro: is 0.8 times",
            "gyro: and accelerometer: axes look turned by 90 deg",
            0.08,
        ),
        ("gyro: is 0.8 times", "quaternion: axes look turned by 90 deg", 0.0),
        ("velocity: the sign of x", "velocity: does not belong", 0.172),
        ("quaternion: turns the other way", "pose: does not belong", 0.35),
        ("joint_rates: it looks like deg/s", "joint_rates: does not belong", 0.175),
        ("joint_rates: it looks like deg/s", "joint_efforts: does not belong", 0.35),
    ],
)
@pytest.mark.parametrize("share", [0.75, 1.3])
def test_a_dearer_change_must_leave_less_by_its_price(
    monkeypatch, cheap, dear, price, share
):
    """The change is named that has less of both, what it leaves and its price."""
    by = share * price or 0.001 * (share - 1.0)
    # without a channel all else must be explained, or it is none at fault
    most = 0.25 + by if dear.endswith("does not belong") else 1.0

    def sizes(flight):
        costs = [
            cost
            for words, cost in ((cheap, most), (dear, most - by))
            for note in flight.notes
            if note.startswith(words)
        ]
        return dict.fromkeys(SENSORS, float(np.exp(min(costs, default=3.0))))

    monkeypatch.setattr(ChannelChange, "of", noted)
    (fault,), _ = isolated(monkeypatch, sizes)
    assert f"{fault.channel}: {fault.finding}".startswith(
        dear if share > 1.0 else cheap
    )


@pytest.mark.parametrize(
    ("offset", "words"),
    [
        (-0.0598, ""),
        (-0.0602, "is 60 ± 10 ms late against the gyro"),
        (0.0602, "is 60 ± 10 ms early against the gyro"),
    ],
)
def test_a_pose_that_is_late_by_more_than_its_interval_is_told(
    monkeypatch, offset, words
):
    clock = SimpleNamespace(offset=offset, offset_error=0.01)
    found, _ = isolated(monkeypatch, lambda flight: {}, clock=clock)
    assert [(each.severity, each.channel, each.finding) for each in found] == [
        (WARNED, "quaternion", words)
    ] * bool(words)
    monkeypatch.setattr(ChannelChange, "of", noted)
    for channel in ("pose", "joint_rates"):
        said = f"{channel}: does not belong"
        found, _ = isolated(
            monkeypatch,
            lambda flight, said=said: dict.fromkeys(
                SENSORS, 1.0 if str(flight.notes).startswith(f"('{said}") else 9.0
            ),
            clock=clock,
        )
        late = ["quaternion"] * bool(words and channel != "pose")
        assert [each.channel for each in found] == [
            channel,
            *late,
        ], "refused ones first; what is at fault is not late"


def test_a_change_is_made_on_the_flight_whose_clock_it_spares(monkeypatch):
    """A wrong rate or attitude puts the alignment of the poses off as well."""
    stamped, aligned = (
        dataclasses.replace(SOUND, name=name) for name in ("stamped", "aligned")
    )
    anew = dataclasses.replace(SOUND, name="aligned anew")
    monkeypatch.setattr(
        isolate_fault,
        "align_poses",
        lambda flight: (anew if flight.name == "stamped" else flight, None),
    )
    fits = Fits(lambda flight: {"gyro": 2.0})

    def tried(channel, factor=1.0):
        make = rows_of("gyro", times(*(factor,) * 3))
        change = ChannelChange(
            channel,
            "",
            "",
            ("gyro",),
            lambda own, amount: dict(make(SOUND).channels),
            price=0.5,
        )
        return change, isolate_fault._try_change(
            fits, (stamped, aligned), change, 2.0, (3, 1)
        )

    for channel, name in {
        "gyro": "aligned anew",
        "quaternion": "aligned anew",
        "velocity": "aligned",
    }.items():
        change, (found,) = tried(channel)
        assert (found.change, found.amount, fits.flights[-1].name) == (
            change,
            2.0,
            name,
        )
        assert found.cost == pytest.approx(3.0 * np.log(2.0) / 20.0 + 0.5)
        assert fits.calls[-1] == (3, 1)
    assert tried("velocity", 1e4)[1] == [], "no gyro reads so much"
    monkeypatch.setattr(fits, "rows", lambda *_: None)
    assert tried("velocity")[1] == [], "too few windows"


def test_the_cost_is_the_mean_logarithm_of_rows_that_are_not_white():
    left = Left(
        {
            ("gyro", 0): np.e,
            ("gyro", 1): 0.5,
            ("unexplained force", 0): np.e**2,
            ("unexplained torque", 0): 0.1,
        }
    )
    assert left.cost() == pytest.approx((1.0 + 2.0) / 2.0)
    assert left.cost(0.1) == pytest.approx(
        (1.0 + 2.0 + 0.1 * (1.0 + 0.5 + 1.0 + 0.1)) / 2.0
    )
    assert left.largest == np.e**2
    assert dataclasses.replace(left, unusual=100.0).cost() == pytest.approx(1.5 + 0.3)
    assert Left({("gyro", 0): np.e}).cost() == pytest.approx(1.0)
    assert Left({(PUSHES[0], 0): np.e}).cost() == pytest.approx(1.0)


def some_change(*amounts):
    return ChannelChange(
        "gyro", "", "", ("gyro",), lambda own, amount: own, amounts=amounts
    )


def test_of_each_change_the_best_amount_stays():
    one, two, three = (some_change(1.0, 2.0) for _ in range(3))
    tried = [
        TriedChange(*each, Left({}))
        for each in ((3.0, one, 1.0), (1.0, two, 1.0), (2.0, one, 2.0), (4.0, two, 2.0))
    ]
    best = isolate_fault._each_best([*tried, TriedChange(1.5, three, 1.0, Left({}))])
    assert [(each.cost, each.change, each.amount) for each in best] == [
        (1.0, two, 1.0),
        (1.5, three, 1.0),
        (2.0, one, 2.0),
    ]


def trial(best, calls, least=0.0, white=True):
    """In place of fits: the farther from the best amount, the larger is what is
    left.
    """

    def tried(change, amount, how):
        calls.append((amount, how))
        size = abs(amount - best) / 1e3 + (0.0 if white else 2.0)
        return (
            [TriedChange(0.0, change, amount, Left({("gyro", 0): size}))]
            if amount > least
            else []
        )

    return tried


@pytest.mark.parametrize("white", [True, False])
@pytest.mark.parametrize(
    ("begin", "best", "found"),
    [(50.0, 50.0, 50.0), (50.0, 20.0, 20.0), (200.0, 95.0, 95.0), (50.0, 300.0, 200.0)],
)
def test_the_best_amount_is_found_by_halves_of_the_distance(white, begin, best, found):
    """Also among amounts that all make white; to a part of the distance, and not beyond
    the last ones.
    """
    calls = []
    change = some_change(200.0, -50.0, -200.0, 50.0)
    amount = isolate_fault._best_amount(trial(best, calls, white=white), change, begin)
    assert amount == pytest.approx(found, abs=150.0 / 32.0)
    assert {how for _, how in calls} == {(12, 4)}
    assert len({amount for amount, _ in calls}) == len(calls), (
        "each amount is flown once"
    )
    assert len(calls) <= 1 + 2 * 5


@pytest.mark.parametrize(("above", "stays"), [(0.04, True), (0.06, False)])
def test_half_of_a_white_row_is_worth_a_twentieth_of_another_one(above, stays):
    def tried(change, amount, how):
        sizes = (np.exp(above), 0.5) if amount == 50.0 else (1.0, 1.0)
        return [
            TriedChange(
                0.0,
                change,
                amount,
                Left({("gyro", i): size for i, size in enumerate(sizes)}),
            )
        ]

    assert (
        isolate_fault._best_amount(tried, some_change(-50.0, 50.0), 50.0) == 50.0
    ) is stays


def test_amounts_that_cannot_be_flown_are_not_best():
    change = some_change(-50.0, 50.0)
    assert isolate_fault._best_amount(
        trial(-40.0, [], least=10.0), change, 50.0
    ) == pytest.approx(13.0, abs=3.2)


@pytest.mark.parametrize("name", ["gyro", "time"])
def test_every_scale_within_those_of_the_table_is_found(name):
    (change,) = [
        each
        for each in channel_changes(SOUND, VEHICLE)
        if each.channel == name and re.match(r"is \{|runs", each.words)
    ]
    least, most = (0.65, 1.5) if name == "gyro" else (0.5, 2.0)
    for scale in np.linspace(0.4, 2.1, 35):
        begin = min(change.amounts, key=lambda each, scale=scale: abs(each - scale))
        found = isolate_fault._best_amount(trial(scale, []), change, begin)
        assert found == pytest.approx(
            min(max(scale, least), most), abs=0.02 if least < scale < most else 1e-9
        )


class Window:
    """In place of windows and their errors: what they are made of, and a fit of given
    numbers.
    """

    rows = (("gyro", 0), ("accelerometer", 2), ("position", 1))
    replay, push = None, np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1])

    def __init__(self):
        self.made, self.count = [], 4
        self.noise, self.white = np.full((1, 3), 0.02), np.full((1, 3), 0.01)
        self.moved, self.wrong = {}, None

    def windows(self, flights, start, seconds, most):
        self.made.append((*(each.step for each in flights), seconds, most))
        return self

    def errors(self, windows, start, unknowns, *others):
        self.unknowns = unknowns
        self.names = [each.name for each in unknowns]
        return self

    def over(self, windows):
        return self

    def fit(self, errors, begin, turns):
        if self.wrong:
            raise self.wrong
        off = np.array(
            [self.moved.get(each.name, 0.0) * each.spread for each in self.unknowns]
        )
        return SimpleNamespace(
            noise=self.noise,
            spread=np.array([0.5, 0, 0, 0.2, 0, 0]),
            values=begin + off,
        )


@pytest.fixture
def window(monkeypatch):
    made = Window()
    parts = {
        "ClockedWindows": made.windows,
        "WindowErrors": made.errors,
        "on_clock": lambda flight, start, step, **_: SimpleNamespace(
            name=flight.name, step=step, voltage=np.ones(1)
        ),
        "clock_step": lambda flights, start: 0.002,
    }
    for name, part in parts.items():
        monkeypatch.setattr(identify_windows, name, part)
    monkeypatch.setattr(isolate_fault, "fit_windows", made.fit)
    monkeypatch.setattr(isolate_fault, "first_noise", lambda errors: made.white)
    return made


STILL = rows_of(
    "accelerometer",
    lambda rows: np.tile([[0.0, 0.0, 9.8], [0.0, 0.0, 9.9]], (len(rows) // 2, 1)),
)(SOUND)


def test_sizes_are_over_the_noise_that_a_sensor_shows_from_sample_to_sample(window):
    left = Leavings(VEHICLE).rows(STILL, 60, 40)
    change = 1.4826 * 0.1
    # of a mean over a period, as well
    noise = np.sqrt(0.01**2 + (change**2 - 2.0 * 0.01**2) / 12.0)
    assert left.sizes["gyro", 0] == pytest.approx(2.0)
    assert left.sizes["accelerometer", 2] == pytest.approx(0.02 / noise)
    assert left.sizes["unexplained force", 0] == pytest.approx(0.5)
    assert left.sizes["unexplained torque", 0] == pytest.approx(2.0)
    assert len(left.sizes) == 3 + 6
    fast = Leavings(VEHICLE).rows(
        times_of(tuple(STILL), lambda time: time / 20.0)(STILL), 60, 40
    )
    assert fast.sizes["gyro", 0] == pytest.approx(4.0), (
        "steps of 2 ms are means of four samples at 2 kHz"
    )
    window.white[0, 0], window.white[0, 1] = 0.0, 1.0
    left = Leavings(VEHICLE).rows(STILL, 60, 40)
    assert left.sizes["gyro", 0] == pytest.approx(0.02 / isolate_fault.LEAST["gyro"])
    assert left.sizes["accelerometer", 2] == pytest.approx(0.02), (
        "it is not quieter than it looks"
    )


def test_numbers_off_the_start_are_unusual(window):
    window.moved = {"delay": 3.0, "place.x": -4.0}
    left = Leavings(VEHICLE).rows(STILL, 60, 40)
    assert left.unusual == pytest.approx(25.0)
    assert left.delay == pytest.approx(0.005 + 3.0 * 0.01)


def test_changes_are_ranked_by_the_same_numbers_with_and_without_a_pose(window):
    window.rows = window.rows[:2]
    window.noise, window.white = window.noise[:, :2], window.white[:, :2]
    window.moved = {"drag.area.x": 3.0}
    blind = dataclasses.replace(
        STILL, channels={name: STILL[name] for name in STILL if name not in POSE}
    )
    for flight in (STILL, blind):
        assert Leavings(VEHICLE).rows(flight, 60, 40).unusual == pytest.approx(9.0)


def test_a_motion_that_is_no_number_leaves_infinite_sizes(window):
    window.wrong = np.linalg.LinAlgError()
    assert set(Leavings(VEHICLE).rows(STILL, 60, 40).sizes.values()) == {np.inf}
    window.wrong, window.noise[0, 1] = None, np.nan
    assert Leavings(VEHICLE).rows(STILL, 60, 40).largest == np.inf


def test_a_first_search_takes_coarse_steps_and_windows_hold_twelve_samples(window):
    leavings = Leavings(VEHICLE)
    for rate, most in ((100.0, 60), (100.0, 12), (400.0, 12)):
        leavings.rows(
            times_of(tuple(STILL), lambda time, rate=rate: time * 100.0 / rate)(STILL),
            most,
            4,
        )
    last, first, quick = window.made
    assert last == (pytest.approx(0.002), pytest.approx(0.12), 60)
    assert first == (pytest.approx(0.004), pytest.approx(0.12), 12)
    assert quick == (pytest.approx(0.004), pytest.approx(0.06), 12)


@pytest.mark.parametrize(
    ("rate", "flown"), [(19.0, False), (21.0, True), (9.9e3, True), (1.01e4, False)]
)
def test_a_gyro_of_an_odd_rate_is_not_flown(window, rate, flown):
    found = Leavings(VEHICLE).rows(
        times_of(tuple(STILL), lambda time: time * 100.0 / rate)(STILL), 60, 40
    )
    assert (found is not None) is flown


@pytest.mark.parametrize(("count", "flown"), [(3, False), (4, True)])
def test_a_flight_of_few_windows_is_not_flown(window, count, flown):
    window.count = count
    assert (Leavings(VEHICLE).rows(STILL, 60, 40) is not None) is flown


def test_a_pose_without_a_velocity_is_searched(monkeypatch):
    found = dataclasses.replace(
        SOUND, channels={name: SOUND[name] for name in SOUND if name != "velocity"}
    )
    wrong = rows_of("position", times(1, -1, -1))(found)
    (fault,), _ = isolated(
        monkeypatch,
        lambda flight: {"position": 9.0 if differs(flight, "position") else 1.0},
        wrong,
    )
    assert (fault.channel, fault.finding[:27]) == (
        "position",
        "the signs of y and z look t",
    )


def test_the_refused_come_first(monkeypatch):
    frozen = SOUND["position"].values.copy()
    frozen[400:500] = frozen[400]
    wrong = then(
        rows_of("position", lambda rows: frozen), rows_of("gyro", times(-1, 1, 1))
    )(SOUND)
    found, _ = isolated(
        monkeypatch,
        lambda flight: {"gyro": 9.0 if differs(flight, "gyro") else 1.0},
        wrong,
    )
    assert [(each.severity, each.channel) for each in found] == [
        (REFUSED, "gyro"),
        (WARNED, "position"),
    ]


@pytest.mark.parametrize(
    ("words", "amount", "near"),
    [
        ("gyro: is * times what fits", 1.4, 0.01),
        ("gyro: is * times what fits", 1.49, 0.01),
        ("accelerometer: is * times what fits", 0.7, 0.01),
        ("velocity: is * times what fits", 1.16, 0.01),
        ("position: is * times what fits", 0.86, 0.01),
        ("time: runs * times as fast", 1.75, 0.03),
        ("pose: stamps are off by * ms", 120.0, 5.0),
        ("velocity: stamps are off by * ms", 120.0, 5.0),
        ("rotor commands: stamps are off by * ms", -120.0, 5.0),
        ("joint_positions: stamps are off by * ms", 20.0, 5.0),
        ("rotor commands: begin at * % of the full signal", 10.0, 1.0),
        (f"joint_positions: zero of {ARM[1]} is off by *", 0.3, 0.02),
        ("gyro: and accelerometer: axes look turned by * deg about z", 30.0, 3.0),
        ("rotor commands: turn the vehicle as if it stood * deg about z", 130.0, 3.0),
        ("quaternion: axes look turned by * deg about z", -60.0, 3.0),
    ],
)
def test_amounts_between_those_of_the_table_are_looked_for(
    monkeypatch, words, amount, near
):
    pattern = re.escape(words).replace(r"\*", r"([+-]?[\d.]+)")

    def sizes(flight):
        (read,) = [
            float(found[1])
            for note in flight.notes
            if (found := re.match(pattern, note))
        ] or [np.inf]
        return dict.fromkeys(
            SENSORS, float(min(9.0, 2.0 + abs(read - amount) / abs(amount)))
        )

    monkeypatch.setattr(ChannelChange, "of", noted)
    (fault,), _ = isolated(monkeypatch, sizes)
    found = re.match(pattern, f"{fault.channel}: {fault.finding}")
    assert float(found[1]) == pytest.approx(amount, abs=near)
