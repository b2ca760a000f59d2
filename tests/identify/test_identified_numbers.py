"""Numbers with intervals from a fit: slopes of sums, shares of information, flights
that disagree, what goes back.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from made_up_fits import fit_of

from skyarm.identify.identified_numbers import (
    NOT_SHOWN,
    IdentifiedNumber,
    Scale,
    at_starts,
    bound_number,
    condition_on_start,
    disagreement,
    identified_numbers,
    scale_of,
)
from skyarm.identify.identified_parts import vehicle_with
from skyarm.identify.unknowns import Reported, Unknown
from support.flights import QUAD

pytest.importorskip("scipy", reason="needs the extra 'identify'")

UNKNOWNS = [
    Unknown(name="a", unit="m", start=2.0, spread=0.3, positive=True),
    Unknown(name="b", unit="m", start=3.0, spread=0.4, positive=True),
    Unknown(name="c", unit="rad", start=-0.5, spread=2.0),
]
REPORTED = [
    Reported(name="a", unit="m", parts=("a",)),
    Reported(name="a + b", unit="m", parts=("a", "b")),
    Reported(name="c", unit="rad", parts=("c",)),
]
AT = np.array([math.log(2.5), math.log(1.5), 0.25])


def test_slopes_are_those_of_logarithms_of_sums_and_of_the_numbers_themselves():
    """Against differences; the start is on the same scale."""
    fit = fit_of(AT, np.eye(3))
    scale = scale_of(fit, UNKNOWNS, REPORTED, {})
    assert scale.values == pytest.approx([2.5, 4.0, 0.25])
    assert scale.starts == pytest.approx([2.0, 5.0, -0.5])
    assert scale.positive.tolist() == [True, True, False]
    assert scale.off == pytest.approx([math.log(2.0 / 2.5), math.log(5.0 / 4.0), -0.75])

    def told(at):
        a, b = np.exp(at[:2])
        return np.array([np.log(a), np.log(a + b), at[2]])

    slopes = np.stack(
        [(told(AT + h) - told(AT - h)) / 2e-6 for h in 1e-6 * np.eye(3)], axis=1
    )
    assert scale.rows == pytest.approx(slopes, abs=1e-9)
    # variances before: of a sum by both parts, as they are independent
    assert scale.before == pytest.approx(
        [0.3**2, (0.625 * 0.3) ** 2 + (0.375 * 0.4) ** 2, 4.0]
    )


def test_what_is_known_of_a_sum_is_added_and_has_no_slope():
    scale = scale_of(fit_of(AT[1:], np.eye(2)), UNKNOWNS[1:], REPORTED, {"a": 6.0})
    assert [each.name for each in scale.reported] == ["a + b", "c"]
    assert scale.values == pytest.approx([7.5, 0.25])
    assert scale.starts == pytest.approx([9.0, -0.5])
    assert scale.rows == pytest.approx(np.array([[1.5 / 7.5, 0.0], [0.0, 1.0]]))
    other = scale_of(fit_of(AT[::2], np.eye(2)), UNKNOWNS[::2], REPORTED, {"b": 6.0})
    assert [each.name for each in other.reported] == ["a", "a + b", "c"]
    assert (other.values[1], other.starts[1]) == pytest.approx((8.5, 8.0))


def test_intervals_are_of_95_percent_and_what_little_data_tell_is_as_before():
    """Of logarithms by a factor; a number that the flights hardly tell has the interval
    that it had before.
    """
    curvature = np.diag([0.01, 0.02, 5.0]) ** 2
    numbers, correlation = identified_numbers(
        fit_of(AT, curvature),
        scale_of(fit_of(AT, curvature), UNKNOWNS, REPORTED, {}),
        0.002,
    )
    student = 2.0930240544  # of 19 degrees of freedom
    first, total, hidden = numbers
    assert (first.name, first.unit, first.start) == ("a", "m", 2.0)
    assert first.high / first.value == pytest.approx(first.value / first.low)
    assert math.log(first.high / first.value) == pytest.approx(student * 0.01, rel=1e-6)
    deviation = math.hypot(0.625 * 0.01, 0.375 * 0.02)
    assert math.log(total.high / total.value) == pytest.approx(
        student * deviation, rel=0.05
    )
    assert first.data_share == pytest.approx(
        1.0 - (student / 1.959964 * 0.01 / 0.3) ** 2
    )
    assert (hidden.low, hidden.value, hidden.high) == pytest.approx(
        (0.25 - 3.919928, 0.25, 0.25 + 3.919928)
    )
    assert (hidden.data_share, hidden.reason, hidden.is_known) == (
        pytest.approx(0.0, abs=1e-9),
        NOT_SHOWN,
        False,
    )
    assert (first.reason, first.is_known, first.widened) == ("", True, 1.0)
    assert correlation[0, 1] == pytest.approx(0.625 * 0.01 / deviation)
    assert correlation.diagonal() == pytest.approx(1.0)
    assert correlation[0, 2] == 0.0


@pytest.mark.parametrize(("share", "known"), [(0.49, False), (0.51, True)])
def test_a_number_shows_if_the_flights_give_half_of_its_information(share, known):
    unknown = Unknown(name="c", unit="", start=0.0, spread=1.0)
    fit = fit_of([0.3], np.array([[1.0 - share]]), blocks=2000)
    (number,), _ = identified_numbers(
        fit, scale_of(fit, [unknown], [REPORTED[2]], {}), 0.0
    )
    assert number.data_share == pytest.approx(share, abs=2e-3)
    assert number.is_known == known


def test_an_accelerometer_s_delay_is_not_better_known_than_to_half_a_sample():
    """Which is no share of its information: that is of the flights."""
    unknown = Unknown(name="accelerometer_delay", unit="s", start=0.0, spread=0.005)
    other = dataclasses.replace(unknown, name="delay")
    fit = fit_of([1e-3, 1e-3], np.diag([1e-4, 1e-4]) ** 2)
    scale = scale_of(
        fit,
        [unknown, other],
        [Reported(name=n, unit="s", parts=(n,)) for n in (unknown.name, "delay")],
        {},
    )
    (felt, plain), _ = identified_numbers(fit, scale, 0.01)
    half = 0.5 * (plain.high - plain.low)
    assert 0.5 * (felt.high - felt.low) == pytest.approx(math.hypot(half, 0.005))
    assert felt.data_share == plain.data_share
    assert felt.value == plain.value == 1e-3


def test_scores_that_spread_less_than_the_noise_narrow_no_interval():
    """Of many blocks: by the curvature, and the flights' disagreement is measured by
    it.
    """
    curvature = np.array([[0.04]])
    unknown = Unknown(name="c", unit="", start=0.0, spread=1e3)
    fit = fit_of([0.0], curvature, blocks=50, covariance=1e-4 * curvature)
    scale = scale_of(fit, [unknown], [REPORTED[2]], {})
    half = 1.959964 * 0.2
    assert identified_numbers(fit, scale, 0.0)[0][0].high == pytest.approx(half)
    scores = np.array([[5.0], [-5.0]])
    fit = dataclasses.replace(
        fit, stretch_information=np.full((2, 1, 1), 12.5), stretch_scores=scores
    )
    wide = identified_numbers(fit, scale, 0.0, ["one", "two"])[0][0]
    # each flight is 0.4 off, known to 0.08: chi squared of 4
    assert wide.widened == pytest.approx(2.0)
    assert wide.high == pytest.approx(2.0 * half)


def by_flights(seed, known, spread=1.0):
    """Linear problem of three flights in four stretches: fit of all, and the estimate
    of each flight alone.
    """
    draw = np.random.default_rng(seed)
    slopes = [draw.normal(size=(30, 2)) for _ in range(4)]
    truths = spread * draw.normal(size=(4, 2))
    truths[1] = truths[0]  # one flight in two stretches
    data = [
        part @ truth + 0.1 * draw.normal(size=30)
        for part, truth in zip(slopes, truths, strict=True)
    ]
    prior = np.diag(known)

    def estimate(which):
        information = sum(slopes[k].T @ slopes[k] for k in which) / 0.01 + prior
        return (
            np.linalg.solve(
                information, sum(slopes[k].T @ data[k] for k in which) / 0.01
            ),
            information,
        )

    values, total = estimate(range(4))
    fit = fit_of(
        values,
        np.linalg.inv(total),
        prior_information=prior,
        stretch_information=np.stack([part.T @ part / 0.01 for part in slopes]),
        stretch_scores=np.stack(
            [
                -part.T @ (rows - part @ values) / 0.01
                for part, rows in zip(slopes, data, strict=True)
            ]
        ),
    )
    return fit, [estimate(which) for which in ((0, 1), (2,), (3,))]


@pytest.mark.parametrize(
    "known",
    [(1e-6, 1e-6), (300.0, 800.0)],
    ids=["little known before", "much known before"],
)
@pytest.mark.parametrize("wide", [1.0, 3.0])
def test_flights_that_disagree_widen_intervals_by_the_ratio_of_birge(known, wide):
    """Root of chi squared over its degrees of freedom, of each flight's own estimate
    (Particle Data Group).
    """
    fit, alone = by_flights(4, known)
    rows = np.array([[1.0, 0.0], [0.6, -0.8]])
    scale = Scale(
        REPORTED[:2],
        np.zeros(2),
        np.zeros(2),
        np.zeros(2, dtype=bool),
        rows,
        np.full(2, 1e6),
    )
    after = wide**2 * np.einsum("kp,pq,kq->k", rows, fit.curvature, rows)
    found = disagreement(fit, scale, after, ["one", "one", "two", "three"])
    for row, ratio in zip(rows, found, strict=True):
        values = np.array([row @ value for value, _ in alone])
        variances = wide**2 * np.array(
            [row @ np.linalg.solve(information, row) for _, information in alone]
        )
        mean = (values / variances).sum() / (1.0 / variances).sum()
        assert ratio == pytest.approx(
            math.sqrt((((values - mean) ** 2) / variances).sum() / 2.0), rel=1e-6
        )
        assert ratio > 2.0
    # two stretches of one flight are no flights that disagree
    assert disagreement(fit, scale, after, ["one"] * 4).tolist() == [1.0, 1.0]
    assert disagreement(fit, scale, after, []).tolist() == [1.0, 1.0]


def test_flights_that_agree_narrow_nothing_and_those_without_a_number_do_not_count():
    fit, _ = by_flights(4, (1e-6, 1e-6), spread=0.0)
    rows, names = np.eye(2), ["one", "one", "two", "three"]
    scale = Scale(
        REPORTED[:2],
        np.zeros(2),
        np.zeros(2),
        np.zeros(2, dtype=bool),
        rows,
        np.full(2, 1e6),
    )
    after = np.diag(fit.curvature)
    assert disagreement(fit, scale, 100.0 * after, names).tolist() == [1.0, 1.0]
    fit, alone = by_flights(4, (1e-6, 1e-6))
    variance = [np.linalg.inv(information)[0, 0] for _, information in alone]
    # half of the information: a flight of a variance above half of that before shows
    # nothing
    least = np.sort(variance)
    for before, flights in ((2.01 * least[1], 2), (1.99 * least[1], 1)):
        told = disagreement(
            fit,
            dataclasses.replace(scale, before=np.array([before, 1e6])),
            after,
            names,
        )[0]
        chosen = [
            value[0]
            for (value, _), each in zip(alone, variance, strict=True)
            if each <= 0.5 * before
        ]
        assert len(chosen) == flights
        if flights == 1:
            assert told == 1.0
        else:
            sizes = [each for each in variance if each <= 0.5 * before]
            # of a number that none shows, too
            least_known = dataclasses.replace(scale, before=np.array([1e-9, 1e6]))
            assert disagreement(fit, least_known, after, names)[0] == 1.0
            assert told == pytest.approx(
                abs(chosen[0] - chosen[1]) / math.sqrt(sum(sizes)), rel=1e-6
            )


def test_a_number_goes_back_up_to_half_of_its_information():
    """Not one of which the flights give as much, or that shows once the others are at
    their starts.
    """
    made = (
        np.array([2.0, 3.0]),
        np.diag([0.504, 0.3]),
        np.eye(2),
        np.array([-2.0, -3.0]),
        np.ones(2),
    )
    assert condition_on_start(*made, np.array([0.496, 0.7]), [[0, 1]]).replaced == [0]
    assert condition_on_start(*made, np.array([0.5, 0.7]), [[0, 1]]).replaced == []


@pytest.mark.parametrize("seed", [1, 3, 13])
def test_what_goes_back_is_held_and_the_others_are_as_the_data_have_them_beside_it(
    seed,
):
    """Of sums with shares of their own scale: the mean of a normal distribution under
    those conditions.
    """
    draw = np.random.default_rng(seed)
    root, rows = draw.normal(size=(4, 4)), draw.normal(size=(4, 4))
    spread, values, off = root @ root.T, draw.normal(size=4), draw.normal(size=4)
    variances = np.einsum("kp,pq,kq->k", rows, spread, rows)
    before = variances / np.array([0.8, 0.2, 0.9, 0.3])
    # told by blocks, whose scores spread twice as far
    shares = 1.0 - 2.0 * variances / before
    found = condition_on_start(values, spread, rows, off, before, shares, [range(4)])
    replaced, now = list[int](), spread
    for _ in range(4):
        left = [i for i in range(4) if shares[i] < 0.5 and i not in replaced]
        told = {i: 1.0 - 2.0 * float(rows[i] @ now @ rows[i]) / before[i] for i in left}
        if not told or min(told.values()) >= 0.5:
            break
        replaced.append(min(told, key=told.__getitem__))
        part = rows[replaced]
        now = spread - spread @ part.T @ np.linalg.solve(
            part @ spread @ part.T, part @ spread
        )
    assert list(found.replaced) == replaced
    assert replaced[0] == 2
    assert len(replaced) >= 2
    # the rest shows beside that with which it hangs together most
    sizes = np.sqrt(variances)
    alike = np.abs(rows @ spread @ rows.T) / np.outer(sizes, sizes)
    (left,) = {i for i in range(4) if shares[i] < 0.5} - set(replaced)
    assert found.beside == {left: max(replaced, key=lambda j: alike[left, j])}
    part = rows[replaced]
    wanted = values + spread @ part.T @ np.linalg.solve(
        part @ spread @ part.T, off[replaced]
    )
    assert found.values == pytest.approx(wanted)
    assert rows[replaced] @ (found.values - values) == pytest.approx(off[replaced])


@pytest.mark.parametrize(
    ("low", "value", "high", "after"),
    [
        (-2.0, -0.5, 0.3, (0.0, 0.0, 0.3)),
        (-2.0, 0.1, 0.3, (0.0, 0.1, 0.3)),
        (0.0, 0.1, 0.3, (0.0, 0.1, 0.3)),
        (0.05, 0.1, 0.3, (0.05, 0.1, 0.3)),
    ],
)
def test_an_interval_ends_where_physics_does(low, value, high, after):
    number = IdentifiedNumber(
        name="a", unit="", value=value, low=low, high=high, start=0.0, data_share=0.9
    )
    found = bound_number(number, 0.0)
    assert (found.low, found.value, found.high, found.reason) == (*after, "")
    # what the flights do not show keeps its interval, and one that is excluded whole is
    # not shown
    hidden = dataclasses.replace(number, reason=NOT_SHOWN)
    assert bound_number(hidden, 0.0) is hidden
    assert bound_number(number, high) == dataclasses.replace(number, reason=NOT_SHOWN)


def test_of_several_numbers_beside_which_one_shows_the_nearest_is_named():
    """Both sums are known well; each of the three alone is as before. Those that go
    back are of the group before.
    """
    near = np.array([[1.0, 0.0, -0.9], [0.0, 1.0, 0.4], [-0.9, 0.4, 1.0]])
    spread = 0.99 * near + 0.01 * np.eye(3)
    found = condition_on_start(
        np.zeros(3),
        spread,
        np.eye(3),
        np.ones(3),
        np.ones(3),
        np.zeros(3),
        [[0, 1], [2]],
    )
    assert list(found.replaced) == [0, 1]
    assert found.beside == {2: 0}


def test_a_sum_goes_back_beside_a_known_part():
    """Of a + b at its start of 5 with a known, b is the rest; a sum with fewer unknowns
    than sums stays as found.
    """
    scale = scale_of(fit_of(AT[1:], np.eye(2)), UNKNOWNS[1:], REPORTED, {"a": 1.0})
    plain = {"a": 1.0, "b": 1.5, "c": 0.25}
    assert at_starts(plain, scale, [0], ["b", "c"], {}, plain) == pytest.approx(
        {"a": 1.0, "b": 3.0, "c": 0.25}
    )
    assert at_starts(plain, scale, [1], ["b", "c"], {}, plain) == pytest.approx(
        {"a": 1.0, "b": 1.5, "c": -0.5}
    )
    fewer = dataclasses.replace(scale, reported=scale.reported[:1])
    assert at_starts(plain, fewer, [0], ["b", "c"], {}, plain) == plain


def test_a_number_of_the_rotors_is_that_of_the_first_and_the_others_keep_their_ratio():
    rotors = [
        dataclasses.replace(each, thrust_coefficient=(1.0 + 0.1 * i) * 1e-5)
        for i, each in enumerate(QUAD.rotors)
    ]
    start = dataclasses.replace(QUAD, rotors=tuple(rotors))
    found = vehicle_with(start, {"rotors.thrust_coefficient": 2e-5}, checked=True)
    assert [each.thrust_coefficient for each in found.rotors] == pytest.approx(
        [2e-5, 2.2e-5, 2.4e-5, 2.6e-5]
    )
