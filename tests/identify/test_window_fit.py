"""Fits of numbers to windows: linear problems by dense least squares, and a quadrotor
from a flight with noise.
"""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from skyarm.flight_data.flight_data import Channel
from skyarm.identify.identified_parts import vehicle_with
from skyarm.identify.unknowns import Unknown, second_moments, unknowns_of
from skyarm.identify.window_errors import (
    OUTLIER,
    NormalEquations,
    WindowErrors,
    WindowStates,
)
from skyarm.identify.window_fit import (
    TURNS,
    Cost,
    WindowFit,
    at_least,
    blocks_of,
    bounded_step,
    first_noise,
    fit_windows,
    new_memory,
    new_noise,
    new_spread,
    reduce,
)
from skyarm.identify.windows import ClockedWindows, on_clock
from support.flights import GRAVITY, NOISE, ONE, QUAD, STEP, flown, measured

sqrtm = pytest.importorskip("scipy.linalg", reason="needs the extra 'identify'").sqrtm

OWN, WRENCH, COUNT = 3, 6, 4
"""Free numbers of a window beside its wrench, of the wrench, and numbers of all
windows."""


class Toy:
    """Windows whose errors are linear in all that is unknown, but for a bend of the
    numbers.

    Rows of each window y = A s + C w + bend(B theta) + noise, with s of any size and w
    of a spread.
    """

    def __init__(
        self,
        windows,
        steps,
        seed=1,
        bend=None,
        prior=1e3,
        noise=0.1,
        spread=0.5,
        flights=1,
        per_block=4,
    ):
        draw = np.random.default_rng(seed)
        self.rows = [("gyro", 0), ("gyro", 1), ("position", 0)]
        self.unknowns = [
            Unknown(name=f"a{i}", unit="", start=0.0, spread=prior)
            for i in range(COUNT)
        ]
        self.names = [each.name for each in self.unknowns]
        self.push, self.wrench = np.full(WRENCH, 0.3), OWN + np.arange(WRENCH)
        self.loose = np.concatenate([np.full(OWN, 1e4), self.push])
        shape = (steps, windows, len(self.rows))
        self.slopes = draw.normal(size=(*shape, OWN + WRENCH + COUNT))
        self.bend = bend or (lambda at: (at, np.ones_like(at)))
        self.truth = draw.normal(size=COUNT)
        step = 0.1
        size = windows // flights
        owners = np.repeat(np.arange(flights), size)
        begins = np.arange(windows) * round(2.0 / step / per_block)
        self.windows = SimpleNamespace(
            owners=owners,
            begins=begins,
            firsts=begins[::size],
            step=step,
            flights=[None] * flights,
            count=windows,
        )
        self.noise = np.broadcast_to(noise, (flights, len(self.rows)))
        free = np.concatenate(
            [
                draw.normal(size=(windows, OWN)),
                spread * draw.normal(size=(windows, WRENCH)),
            ],
            axis=1,
        )
        self.begun = free[:, :OWN] + 0.1 * draw.normal(size=(windows, OWN))
        self.data = np.zeros(shape)
        self.data = -self.errors_at(
            self.truth, WindowStates({"own": free[:, :OWN]}, free[:, OWN:])
        )[0]
        self.data += draw.normal(size=shape) * self.noise[owners]
        self.seen, self.given = [], []

    def take_samples(self, values):
        self.seen.append(values.copy())

    def first_states(self):
        count = self.windows.count
        return WindowStates({"own": self.begun}, np.zeros((count, WRENCH)))

    def errors_at(self, values, states):
        free = np.concatenate([states.parts["own"], states.beside], axis=1)
        part, at = np.split(self.slopes, [OWN + WRENCH], axis=-1)
        found = (
            self.data
            - np.einsum("twrx,wx->twr", part, free)
            - self.bend(at @ values)[0]
        )
        return found, np.ones(found.shape, dtype=bool)

    def innovations(self, found, there, memory):
        return found

    def normal(self, values, states, noise, memory=None):
        self.given.append(noise.copy())
        found, there = self.errors_at(values, states)
        part, at = np.split(self.slopes, [OWN + WRENCH], axis=-1)
        rows = -np.concatenate(
            [part, self.bend(at @ values)[1][..., None] * at], axis=-1
        )
        weight = 1.0 / noise[self.windows.owners] ** 2
        sums = np.einsum("twri,twrj,wr->wij", rows, rows, weight)
        pull = np.einsum("twri,twr,wr->wi", rows, found, weight)
        x = OWN + WRENCH
        of_rows = np.einsum("twri,twrj,wr->rwij", rows[..., :x], rows[..., :x], weight)
        return (
            found,
            there,
            NormalEquations(
                sums[:, :x, :x],
                sums[:, :x, x:],
                sums[:, x:, x:],
                pull[:, :x],
                pull[:, x:],
                of_rows,
            ),
        )


def fit(toy, noise=0.2, begin=0.0, **options):
    given = np.full(toy.noise.shape, noise)
    return fit_windows(toy, np.full(COUNT, begin), noise=given, **options)


def dense(toy, noise, spread, kept, prior=1e3):
    """Numbers and their covariance by one least-squares problem of all windows that are
    kept, and what is known.
    """
    x, count = OWN + WRENCH, len(kept)
    loose = np.concatenate([np.full(OWN, 1e4), spread])
    weight = 1.0 / noise[toy.windows.owners[kept]]
    rows = np.zeros((count, len(toy.slopes), len(toy.rows), count * x + COUNT))
    for i, w in enumerate(kept):
        rows[i, ..., i * x : (i + 1) * x] = toy.slopes[:, w, :, :x]
        rows[i, ..., count * x :] = toy.slopes[:, w, :, x:]
    rows *= weight[:, None, :, None]
    data = np.moveaxis(toy.data[:, kept], 1, 0) * weight[:, None, :]
    known = np.diag(
        np.concatenate([np.tile(1.0 / loose, count), np.full(COUNT, 1.0 / prior)])
    )
    whole = np.concatenate([rows.reshape(-1, rows.shape[-1]), known])
    found = np.linalg.lstsq(
        whole, np.concatenate([data.ravel(), np.zeros(len(known))]), rcond=None
    )[0]
    return found[-COUNT:], np.linalg.inv(whole.T @ whole)[-COUNT:, -COUNT:]


def test_a_window_s_own_numbers_are_eliminated_as_by_one_dense_problem():
    """Numbers, their covariance and each window's own numbers, of windows of few
    samples.
    """
    toy = Toy(windows=5, steps=4)
    states = WindowStates({"own": np.ones((5, OWN))}, 0.1 * np.ones((5, WRENCH)))
    values, prior = np.full(COUNT, 0.2), np.full(COUNT, 2.0)
    noise, loose = (
        np.full((1, 3), 0.1),
        np.concatenate([np.full(OWN, 1e4), np.full(WRENCH, 0.3)]),
    )
    found, _, normal = toy.normal(values, states, noise)
    reduced = reduce(normal, states.beside, loose, prior)
    change = -np.linalg.solve(
        reduced.total, reduced.scores.sum(axis=0) + values / prior**2
    )
    wanted, covariance = dense(toy, noise, np.full(WRENCH, 0.3), np.arange(5), 2.0)
    assert values + change == pytest.approx(wanted, rel=1e-6, abs=1e-8)
    assert np.linalg.inv(reduced.total) == pytest.approx(covariance, rel=1e-6)
    # the states beside them: no shorter step is any better
    after = states.moved_by(-reduced.shift - reduced.slopes @ change)
    cost = Cost(
        np.ones(found.shape, dtype=bool),
        np.full((5, 3), 1e3),
        np.zeros(COUNT),
        prior,
        loose,
    )
    assert (
        np.abs(toy.normal(values + change, after, noise)[2].pull[:, :OWN]).max() < 1e-3
    )
    assert toy.normal(values + change, after, noise)[2].pull[:, OWN:] == pytest.approx(
        -after.beside / 0.3**2, abs=1e-4
    )
    assert np.isfinite(cost.at(found, values, states))
    assert reduced.inverse[0] == pytest.approx(
        np.linalg.inv(normal.own[0] + np.diag(loose**-2.0))
    )


@pytest.mark.parametrize(
    "prior", [1e3, 0.01], ids=["little known before", "much known before"]
)
def test_a_fit_is_that_of_the_dense_problem(prior):
    """Wherever the search begins."""
    toy = Toy(windows=24, steps=12, prior=prior)
    found = fit(toy, begin=5.0 * prior if prior < 1.0 else 0.0)
    assert found.settled
    wanted, covariance = dense(toy, toy.given[-1], found.spread, np.arange(24), prior)
    assert found.values == pytest.approx(wanted, abs=0.05 * np.sqrt(covariance[0, 0]))
    assert found.curvature == pytest.approx(
        covariance, rel=0.05, abs=1e-3 * covariance[0, 0]
    )
    if prior > 1.0:
        assert found.values == pytest.approx(
            toy.truth, abs=5.0 * np.sqrt(covariance[0, 0])
        )


def test_a_fit_holds_to_what_was_known_before_wherever_its_zero_is():
    """Numbers, starts and data that are all shifted: the same fit, shifted."""
    plain, shifted, shift = (
        Toy(windows=12, steps=6, prior=0.05),
        Toy(windows=12, steps=6, prior=0.05),
        np.full(COUNT, 3.0),
    )
    shifted.data = shifted.data + shifted.slopes[..., OWN + WRENCH :] @ shift
    shifted.unknowns = [
        dataclasses.replace(each, start=3.0) for each in shifted.unknowns
    ]
    found, again = fit(plain), fit(shifted, begin=3.0)
    assert found.settled
    assert again.values - shift == pytest.approx(found.values, abs=1e-6)
    assert again.covariance == pytest.approx(found.covariance, rel=1e-4, abs=1e-9)
    assert np.abs(found.values - plain.truth).max() > 0.01, (
        "what was known before counts"
    )


def test_noise_is_that_of_the_sensors_though_free_numbers_take_a_part_of_it():
    """Of two flights: 9 free numbers of 30 samples a window would leave 0.84 of the
    noise to plain means.
    """
    noise = np.array([[0.1, 0.3, 0.06], [0.2, 0.1, 0.05]])
    found = fit(
        Toy(windows=300, steps=10, noise=noise, flights=2, spread=3.0), noise=1.0
    )
    assert found.settled
    assert found.noise / noise == pytest.approx(np.ones((2, 3)), abs=0.08)
    assert np.mean(found.noise / noise) == pytest.approx(1.0, abs=0.02)
    assert found.stretch_information.sum(axis=0) == pytest.approx(
        found.block_information.sum(axis=0)
    )
    blocks = len(found.block_information) // 2
    assert found.stretch_information[0] == pytest.approx(
        found.block_information[:blocks].sum(axis=0)
    )


def test_outliers_make_little_noise():
    """Of 400 samples one at a hundred standard deviations: it counts by three times its
    size, not by its square.
    """
    z = np.ones((400, 1, 3))
    z[7, 0, 1] = 100.0
    errors = SimpleNamespace(
        windows=SimpleNamespace(owners=np.zeros(1, dtype=int)),
        rows=[("gyro", 0), ("gyro", 1), ("position", 0)],
    )
    there = np.ones(z.shape, dtype=bool)
    there[:200, 0, 2] = False
    noise = np.array([[0.1, 0.2, 0.3]])
    normal = NormalEquations(
        *(np.zeros((1, 2, 2)),) * 3, *(np.zeros((1, 2)),) * 2, np.zeros((3, 1, 2, 2))
    )
    found = new_noise(errors, z * noise, there, noise, normal, np.eye(2)[None])
    assert found / noise == pytest.approx(
        np.array([[1.0, np.sqrt((399.0 + 300.0) / 400.0), 1.0]])
    )
    # of a row that the windows' own numbers take, nothing is seen, and its noise stays
    taken = dataclasses.replace(
        normal, of_rows=np.array([0.0, 0.0, 80.0])[:, None, None, None] * np.eye(2)
    )
    found = new_noise(errors, 2.0 * noise * z, there, noise, taken, np.eye(2)[None])
    assert found[0, 2] == 0.3
    assert found[0, 0] == pytest.approx(0.2)


class Lasting(WindowErrors):
    """Errors of 40 windows at uneven times, of which those of all rows but the last
    fade within 80 ms.
    """

    def __init__(self):
        draw = np.random.default_rng(8)
        self.windows = SimpleNamespace(
            owners=np.repeat([0, 1], 20), length=100, step=0.02
        )
        self.when = np.cumsum(draw.uniform(0.002, 0.018, size=(100, 40, 3)), axis=0)
        self.there = draw.uniform(size=self.when.shape) < 0.8
        self.found = draw.normal(size=self.when.shape)
        for k in range(1, 100):
            left = np.exp((self.when[k - 1] - self.when[k]) / [0.08, 0.08, 1e-9])
            self.found[k] = (
                left * self.found[k - 1] + np.sqrt(1.0 - left**2) * self.found[k]
            )

    def times(self):
        return self.when


def test_what_lasts_beyond_a_window_is_given_a_quarter_of_it():
    """A random walk's size and memory would grow together, from turn to turn."""
    errors = Lasting()
    walk = np.cumsum(np.random.default_rng(1).normal(size=errors.found.shape), axis=0)
    memory = new_memory(errors, walk, errors.there, np.full((2, 3), 5.0))
    assert memory == pytest.approx(np.full((2, 3), 0.25 * 2.0))


def test_squares_of_errors_less_what_is_left_are_those_of_their_whole_covariance():
    """Of every window and row e' C^-1 e, where C = exp(-|t - t'| / memory), at uneven
    times.
    """
    errors = Lasting()
    memory = np.array([[0.03, 0.07, 0.4], [0.2, 0.01, 0.0005]])
    white = errors.innovations(errors.found, errors.there, memory)
    for window, row in ((0, 0), (7, 2), (19, 1), (20, 0), (39, 2)):
        there = errors.there[:, window, row]
        time, found = (each[there, window, row] for each in (errors.when, errors.found))
        covariance = np.exp(-np.abs(time[:, None] - time) / memory[window // 20, row])
        expected = found @ np.linalg.solve(covariance, found)
        assert (white[there, window, row] ** 2).sum() == pytest.approx(
            expected, rel=1e-9
        )


def test_the_memory_of_errors_is_found_and_taken_off():
    """What is left is as large as the errors, and of none of them anything is left in
    the next one.
    """
    errors = Lasting()
    memory = new_memory(errors, 0.2 * errors.found, errors.there, np.full((2, 3), 0.2))
    assert memory[:, :2] == pytest.approx(np.full((2, 2), 0.08), rel=0.25)
    assert (memory[:, 2] < 0.005).all()
    assert errors.innovations(errors.found, errors.there, None) is errors.found
    white = errors.innovations(errors.found, errors.there, memory)
    assert np.std(white[errors.there]) == pytest.approx(
        np.std(errors.found[errors.there]), rel=0.1
    )
    both = errors.there[1:] & errors.there[:-1]
    for rows, least, most in ((errors.found, 0.75, 1.0), (white, -0.05, 0.05)):
        assert least < np.mean((rows[1:] * rows[:-1])[..., :2][both[..., :2]]) < most


def test_first_noise_is_the_white_part_of_the_samples():
    """Of a sine beside it nothing; of attitudes as rotations, which are twice the
    quaternion's x, y, z.
    """
    draw, time = np.random.default_rng(3), STEP * np.arange(4000)
    slow = np.sin(6.0 * time)[:, None]
    rows = {
        "gyro": slow + 0.02 * draw.normal(size=(4000, 3)) * [5.0, 3.0, 1.0],
        "quaternion": (
            np.array([1.0, 0.0, 0.0, 0.0])
            + 0.005 * draw.normal(size=(4000, 4)) * [0.0, 1.0, 4.0, 2.0]
        ),
        "position": np.tile(slow, (1, 3)),
    }
    flight = SimpleNamespace(
        channels={
            name: Channel(time=time, values=values, source=name)
            for name, values in rows.items()
        }
    )
    errors = SimpleNamespace(
        windows=SimpleNamespace(flights=[flight]),
        rows=[
            ("gyro", 2),
            ("quaternion", 0),
            ("quaternion", 2),
            ("position", 1),
            ("accelerometer", 0),
        ],
    )
    found = first_noise(errors)[0]
    assert found[:3] == pytest.approx([0.02, 0.01, 0.02], rel=0.1)
    assert found[3] == 1e-4
    assert found[4] == 1.0


def test_blocks_are_of_two_seconds_of_one_flight():
    begins = np.array([0, 100, 199, 200, 500, 600, 790, 1000])
    windows = SimpleNamespace(
        owners=np.array([0, 0, 0, 0, 1, 1, 1, 1]),
        begins=begins,
        firsts=np.array([0, 500]),
        step=0.01,
    )
    assert [each.tolist() for each in blocks_of(windows)] == [
        [0, 1, 2],
        [3],
        [4, 5],
        [6],
        [7],
    ]


def test_the_spread_of_the_wrench_is_that_over_the_windows():
    """Whether it is more or less than what was thought, and though each wrench is
    uncertain by a good part of it.
    """
    for spread in (0.04, 1.5):
        noise = 1.5 * spread
        found = fit(Toy(windows=400, steps=8, spread=spread, noise=noise), noise=noise)
        assert found.spread / spread == pytest.approx(np.ones(WRENCH), abs=0.2)
        assert np.mean(found.spread / spread) == pytest.approx(1.0, abs=0.08)


def by_blocks(found, moves, centred):
    """Covariance by blocks (CR2), and that without what the estimate follows of them,
    from fits that leave one out.
    """
    total, identity = np.linalg.inv(found.curvature), np.eye(COUNT)
    scores = [
        (total - part) @ move
        for part, move in zip(found.block_information, moves, strict=True)
    ]
    scores = np.array(scores) - centred * np.mean(scores, axis=0)
    kept = [
        np.linalg.inv(sqrtm(identity - part @ found.curvature))
        for part in found.block_information
    ]
    rows = np.array(
        [
            found.curvature @ share @ score
            for share, score in zip(kept, scores, strict=True)
        ]
    )
    plain = scores @ found.curvature
    return rows.T @ rows, plain.T @ plain


def test_intervals_are_by_the_errors_of_blocks():
    """Errors that hang together in a block: its fit is refitted without it, by the
    dense problem, for every block.
    """
    toy = Toy(windows=32, steps=6, noise=0.02, per_block=4)
    blocks = blocks_of(toy.windows)
    assert [len(each) for each in blocks] == [4] * 8
    draw = np.random.default_rng(5)
    for block in blocks:
        at = toy.slopes[:, block][..., OWN + WRENCH :]
        toy.data[:, block] += at @ (0.3 * draw.normal(size=COUNT))
    found = fit(toy)
    whole, _ = dense(toy, toy.given[-1], found.spread, np.arange(32))
    moves = [
        dense(toy, toy.given[-1], found.spread, np.setdiff1d(np.arange(32), block))[0]
        - whole
        for block in blocks
    ]
    wanted, plain = by_blocks(found, moves, centred=False)
    assert (np.diag(plain) < 0.9 * np.diag(wanted)).any()
    assert (np.diag(wanted) < 0.9 * np.einsum("bp,bp->p", moves, moves)).any(), (
        "less than the jackknife's"
    )
    assert (np.diag(wanted) > np.diag(found.curvature)).all()
    assert found.covariance == pytest.approx(
        wanted, rel=0.05, abs=0.05 * np.diag(wanted).max()
    )
    assert found.block_information.shape == (8, COUNT, COUNT)
    assert found.block_information.sum(axis=0) == pytest.approx(
        found.stretch_information.sum(axis=0)
    )


def test_what_was_known_before_is_no_spread_of_blocks():
    """Its pull on every block is alike: scores count about their mean, and the prior by
    its own information.
    """
    toy = Toy(windows=32, steps=6, noise=0.5, per_block=4, prior=0.02)
    found, known = fit(toy), np.eye(COUNT) / 0.02**2
    whole, _ = dense(toy, toy.given[-1], found.spread, np.arange(32), 0.02)
    kept = [np.setdiff1d(np.arange(32), block) for block in blocks_of(toy.windows)]
    moves = np.stack(
        [
            dense(toy, toy.given[-1], found.spread, each, 0.02)[0] - whole
            for each in kept
        ]
    )
    of_prior = found.curvature @ known @ found.curvature
    wanted, plain = (
        by_blocks(found, moves, centred)[0] + of_prior for centred in (True, False)
    )
    assert np.diag(found.covariance) == pytest.approx(np.diag(wanted), rel=0.1)
    assert (np.diag(plain) > 1.2 * np.diag(found.covariance)).any()


def test_scores_of_flights_are_those_after_the_last_step(monkeypatch):
    """Of one turn of a linear problem: at its minimum they add up to the pull of what
    was known before.
    """
    found = fit(Toy(windows=16, steps=8, flights=2, prior=2.0), turns=1)
    assert np.abs(found.values).max() > 0.5
    sizes = np.sqrt(np.diag(found.stretch_information.sum(axis=0)))
    assert (
        found.stretch_scores.sum(axis=0) + found.values / 2.0**2
    ) / sizes == pytest.approx(np.zeros(COUNT), abs=1e-6)
    assert found.prior_information == pytest.approx(np.eye(COUNT) / 2.0**2)


def test_intervals_are_never_narrower_than_the_curvature():
    """Of data without noise the least noise of a sensor is left."""
    found = fit(Toy(windows=16, steps=8, noise=0.0))
    assert (np.diag(found.covariance) < 0.01 * np.diag(found.curvature)).all()
    # that of the noise is known by all samples, not by a few blocks
    many = dataclasses.replace(
        found, block_information=np.repeat(found.block_information / 10.0, 10, axis=0)
    )
    assert many.half_widths(np.eye(COUNT)) == pytest.approx(
        1.959964 * np.sqrt(np.diag(found.curvature))
    )
    few = dataclasses.replace(
        found, block_information=np.repeat(found.block_information[:1], 9, axis=0)
    )
    assert (
        few.half_widths(np.eye(COUNT)) > 2.2 * np.sqrt(np.diag(found.curvature))
    ).all()
    assert found.noise[0] == pytest.approx([1e-4, 1e-4, 1e-4], rel=0.3)


def fit_with(block_information):
    """Fit of one number whose blocks tell so much of it."""
    blocks = np.array(block_information, dtype=float)[:, None, None]
    curvature = np.linalg.inv(blocks.sum(axis=0))
    empty = np.zeros((1, 1))
    states = WindowStates({}, empty)
    of_blocks = np.zeros(1), curvature, curvature, empty, blocks, blocks, empty
    return WindowFit(*of_blocks, empty, np.zeros(6), empty, empty > 0, states, True)


def test_quantiles_are_wide_for_what_few_blocks_tell():
    rows = np.ones((1, 1))

    def quantiles(blocks):
        found = fit_with(blocks)
        return found.half_widths(rows) / np.sqrt(found.covariance[0, 0])

    assert quantiles([1.0] * 11) == pytest.approx(2.2281389)
    # ten blocks of which two tell all: two squares, of which the mean takes one part in
    # ten
    assert quantiles([1.0, 1.0] + [0.0] * 8) == pytest.approx(4.7948814)
    assert quantiles([1.0] + [1e-9] * 9) == pytest.approx(12.706205)


def test_a_fit_to_expect_of_more_windows_is_sharper_by_the_root_of_their_number():
    """But for what was known before; what the blocks' spread says beyond the curvature
    stays.
    """
    found = dataclasses.replace(
        fit_with([3.0] * 11), covariance=np.array([[4.0 / 33.0]])
    )
    more = found.of_more(9.0)
    assert more.curvature[0, 0] == pytest.approx(found.curvature[0, 0] / 9.0)
    assert more.covariance[0, 0] == pytest.approx(4.0 * more.curvature[0, 0])
    assert more.half_widths(np.ones((1, 1))) == pytest.approx(
        found.half_widths(np.ones((1, 1))) / 3.0
    )
    known = dataclasses.replace(found, prior_information=np.array([[11.0]])).of_more(
        1.0
    )
    assert known.curvature[0, 0] == pytest.approx(1.0 / 44.0)


@pytest.mark.parametrize("bounds", [1, 3])
def test_no_step_passes_a_bound_and_the_others_are_fitted_to_it(bounds):
    """With one bound as SciPy's bounded solver; with several none is passed, and the
    free slopes vanish.
    """
    lsq_linear = pytest.importorskip("scipy.optimize").lsq_linear
    draw = np.random.default_rng(4)
    for _ in range(20):
        slope, error = draw.normal(size=(12, 5)), draw.normal(size=12)
        least = np.where(np.arange(5) < bounds, -0.05, -np.inf)
        found = bounded_step(slope.T @ slope, slope.T @ error, least)
        assert (found >= least).all()
        uphill = slope.T @ (slope @ found + error)
        assert uphill[found > least] == pytest.approx(
            np.zeros((found > least).sum()), abs=1e-9
        )
        if bounds == 1:
            assert found == pytest.approx(
                lsq_linear(slope, -error, (least, np.inf), tol=1e-14).x, abs=1e-5
            )


def test_a_search_ends_at_a_bound_wherever_it_begins():
    """A number that the data would have below none is none, and the others are fitted
    to that.
    """
    toy = Toy(windows=24, steps=12)
    (below, *_), others = np.flatnonzero(toy.truth < -0.1), np.ones(COUNT, dtype=bool)
    others[below] = False
    toy.unknowns[below] = dataclasses.replace(toy.unknowns[below], least=0.0)
    found = fit(toy, begin=0.7)
    assert found.settled
    assert found.values[below] == pytest.approx(0.0, abs=1e-12)
    free, covariance = dense(toy, toy.given[-1], found.spread, np.arange(24))
    wanted = free - covariance[:, below] / covariance[below, below] * free[below]
    assert found.values[others] == pytest.approx(
        wanted[others], abs=0.1 * np.sqrt(covariance[0, 0])
    )
    assert np.abs(found.values - free)[others].max() > 0.0
    # of a positive number the logarithm is searched, which knows no bound
    toy.unknowns[below] = dataclasses.replace(
        toy.unknowns[below], least=0.0, positive=True, start=1.0
    )
    assert fit(toy, begin=0.7).values[below] == pytest.approx(
        toy.truth[below], abs=0.05
    )


def test_a_spread_is_that_of_estimates_and_of_what_they_leave_open():
    """Sum of squares over the number of windows that tell it (MacKay 1992); a turn
    changes it fivefold at most.
    """
    draw = np.random.default_rng(9)
    errors = SimpleNamespace(wrench=2 + np.arange(WRENCH), push=np.full(WRENCH, 0.3))
    wrench, spread = draw.normal(scale=0.2, size=(50, WRENCH)), np.full(WRENCH, 0.4)
    uncertain = draw.uniform(0.0, 0.1, size=(50, WRENCH))

    def told(wrench, uncertain, spread=spread):
        inverse = np.zeros((50, 8, 8))
        inverse[:, errors.wrench, errors.wrench] = uncertain
        return new_spread(
            errors, WindowStates({}, np.pad(wrench, ((0, 0), (0, 3)))), spread, inverse
        )

    wanted = np.sqrt((wrench**2).sum(axis=0) / (50.0 - uncertain.sum(axis=0) / 0.16))
    assert told(wrench, uncertain) == pytest.approx(wanted)
    # the fixed point: of windows that tell all, the root mean square
    assert told(wrench, 0.0 * uncertain) == pytest.approx(
        np.sqrt((wrench**2).mean(axis=0))
    )
    assert told(100.0 * wrench, uncertain) == pytest.approx(np.full(WRENCH, 2.0))
    assert told(0.001 * wrench, uncertain) == pytest.approx(np.full(WRENCH, 0.08))
    # windows that tell nothing, or by rounding less than that
    for more in (0.0, 1e-12):
        nothing = np.full((50, WRENCH), 0.25 * (1.0 + more))
        assert told(0.0 * wrench, nothing, np.full(WRENCH, 0.5)) == pytest.approx(
            np.full(WRENCH, 0.1)
        )
    # not below a thousandth of what it is thought to be
    assert told(0.0 * wrench, uncertain, np.full(WRENCH, 5e-4)) == pytest.approx(
        np.full(WRENCH, 3e-4)
    )


def test_cost_is_by_huber_and_by_what_is_known_before():
    cost = Cost(
        np.ones((1, 1, 3), dtype=bool),
        np.full((1, 3), 0.5),
        np.array([-3.0]),
        np.array([2.0]),
        np.ones(8),
    )
    states = WindowStates(
        {"own": np.zeros((1, 2))}, np.array([[0.0, 0.0, 3.0, 0.0, 0.0, 0.0]])
    )
    found = cost.at(np.array([[[0.5, 1.5, -5.0]]]), np.array([1.0]), states)
    assert found == pytest.approx(1.0 + 9.0 + OUTLIER * (20.0 - OUTLIER) + 4.0 + 9.0)
    missing = dataclasses.replace(cost, there=np.array([[[True, False, True]]]))
    assert missing.at(
        np.array([[[0.5, np.nan, -5.0]]]), np.array([1.0]), states
    ) == pytest.approx(found - 9.0)


def arctangent(at):
    return np.arctan(4.0 * at), 4.0 / (1.0 + 16.0 * at**2)


def test_a_search_that_would_overshoot_takes_shorter_steps():
    """Gauss-Newton's whole steps from afar run away where an arctangent is flat."""
    toy = Toy(windows=40, steps=6, bend=arctangent, noise=0.01)
    toy.data = arctangent(toy.slopes[..., OWN + WRENCH :] @ np.full(COUNT, 0.1))[0]
    found = fit_windows(toy, np.full(COUNT, 3.0), noise=np.full((1, 3), 0.01))
    assert found.settled
    assert found.values == pytest.approx(np.full(COUNT, 0.1), abs=1e-3)


def test_no_number_goes_by_more_than_what_is_known_of_it_in_a_turn():
    toy = Toy(windows=20, steps=6, prior=0.1)
    toy.truth = toy.truth / np.abs(toy.truth).max()
    fit(toy)
    moves = np.abs(np.diff(np.unique(np.array(toy.seen), axis=0), axis=0))
    assert moves.max() <= 0.1 * (1.0 + 1e-9)
    assert moves.max() > 0.05


def test_progress_is_one_line_a_turn():
    lines = []
    fit(Toy(windows=20, steps=12), progress=lines.append)
    assert len(lines) >= 3
    assert lines[0].startswith(f"turn 1 of at most {TURNS}: by at most ")
    assert all("\n" not in each for each in lines)


def slopes_at_start(vehicle, driven, noise, seconds, most):
    """Normal equations of the numbers alone at the start vehicle, of a flight whose
    joint stands still.
    """
    log = flown(vehicle, 2.0, 0.0062, 0.0047, swing=0.0)
    flight = measured(log, without=("velocity",))
    windows = ClockedWindows(
        [on_clock(flight, vehicle, STEP, sections=[(0.0, 2.0)])], vehicle, seconds, most
    )
    unknowns = unknowns_of(
        vehicle,
        curve=False,
        velocity=True,
        voltage=False,
        driven=driven,
        servoed=[False],
    )
    errors = WindowErrors(windows, vehicle, unknowns, {}, driven, [False], GRAVITY)
    begin, prior = (
        np.array([getattr(each, name) for each in unknowns])
        for name in ("begin", "spread")
    )
    states, sizes = (
        errors.first_states(),
        np.array([[noise * NOISE[name] for name, _ in errors.rows]]),
    )
    loose = (
        np.where(np.isin(np.arange(len(errors.free)), errors.wrench), 1e-2, 1.0)
        * errors.loose
    )
    loose[errors.wrench] = 1e-2 * errors.push
    return (
        errors.names,
        reduce(errors.normal(begin, states, sizes)[2], states.beside, loose, prior),
        prior,
    )


def test_a_sum_of_numbers_that_a_flight_does_not_show_stays_as_it_was_known():
    """A joint that stands still does not show what of it is mass, reach and inertia: a
    share of 0.01 of what is known.

    Forward differences of a thousandth leave a curvature in their place that looks like
    more information than that.
    """
    names, reduced, prior = slopes_at_start(ONE, [True], 0.004, 0.06, 8)
    told = reduced.information.sum(axis=0) * np.outer(prior, prior)
    sizes, directions = np.linalg.eigh(told)
    shares = sizes / (1.0 + sizes)
    assert shares[0] < 0.05
    assert shares[1] > 0.5
    of_link = [
        names.index(f"links.link1.{each}") for each in ("mass", "com.z", "inertia")
    ]
    assert np.linalg.norm(directions[of_link, 0]) > 0.99


PLANTED = {
    "rotors.thrust_coefficient": 1.1 * float(QUAD.rotors[0].thrust_coefficient),
    "rotors.time_constant_up": 0.016,
    "base.second_moment.x": 1.2 * second_moments(QUAD.base)[0],
    "base.com.x": 0.004,
    "delay": 0.0062,
}


def test_a_planted_quadrotor_is_found_within_its_intervals():
    """Of 12 s with the noise of good sensors, all other numbers known: forty windows of
    60 ms.
    """
    log = flown(vehicle_with(QUAD, PLANTED, checked=True), 12.0, PLANTED["delay"])
    flight = measured(log, noise=1.0, without=("velocity",))
    windows = ClockedWindows([on_clock(flight, QUAD, STEP)], QUAD, 0.06, 40)
    unknowns = [
        each
        for each in unknowns_of(
            QUAD, curve=False, velocity=True, voltage=False, driven=[], servoed=[]
        )
        if each.name in PLANTED
    ]
    errors = WindowErrors(windows, QUAD, unknowns, {}, [], [], GRAVITY)
    found = fit_windows(errors, np.array([each.begin for each in unknowns]))
    assert found.settled
    truth = np.array(
        [np.log(PLANTED[u.name]) if u.positive else PLANTED[u.name] for u in unknowns]
    )
    halves = found.half_widths(np.eye(len(truth)))
    assert (np.abs(found.values - truth) < 1.3 * halves).all()
    assert (halves < 0.01).all()
    wanted = np.array([NOISE[name] for name, _ in errors.rows])
    assert found.noise[0] / wanted == pytest.approx(np.ones(len(wanted)), abs=0.2)
    # no wind blew: what nothing explains is less than a thousandth of the weight
    assert (found.spread[:3] < 1e-3 * GRAVITY * float(QUAD.mass)).all()


def test_a_missing_library_is_named_before_the_search(monkeypatch):
    def missing():
        raise ValueError("scipy: is missing")

    monkeypatch.setattr("skyarm.identify.window_fit.student_quantile", missing)
    with pytest.raises(ValueError, match=r"^scipy: is missing$"):
        fit_windows(None, np.zeros(1))


def test_a_step_that_does_not_lower_the_cost_is_not_taken():
    """Slopes of the wrong sign: the search stays where it began, and says that it did
    not come to rest.
    """
    toy = Toy(windows=40, steps=6, bend=lambda at: (at, -np.ones_like(at)))
    toy.truth = np.zeros(COUNT)
    found = fit_windows(toy, np.full(COUNT, 2.0), noise=np.full((1, 3), 0.1), turns=4)
    assert not found.settled
    assert found.values == pytest.approx(np.full(COUNT, 2.0))


def test_rounding_takes_no_information_away():
    """A flight that shows one direction with 1e12, and less than nothing in another by
    rounding.
    """
    before, turn = (
        np.diag([4.0, 100.0, 1e6]),
        np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0],
    )
    healthy = before + turn @ np.diag([1e12, 3.0, 0.0]) @ turn.T
    assert at_least(healthy, before) is healthy
    assert at_least(healthy, np.diag([4.0, 0.0, 1e6])) is healthy
    assert at_least(np.zeros((0, 0)), np.zeros((0, 0))).shape == (0, 0)
    wrong = healthy - 130.0 * np.outer(turn[:, 2], turn[:, 2])
    mended = at_least(wrong, before)
    assert np.linalg.eigvalsh(wrong)[0] < 0.0
    np.linalg.cholesky(mended)
    size = np.sqrt(np.diag(before))
    assert np.linalg.eigvalsh(mended / np.outer(size, size))[0] == pytest.approx(
        1.0, rel=1e-3
    )
    assert turn[:, 0] @ mended @ turn[:, 0] == pytest.approx(1e12, rel=1e-6)
    np.linalg.cholesky(
        at_least(wrong + 1e24 * np.outer(turn[:, 0], turn[:, 0]), before)
    )


def test_a_search_over_what_a_flight_does_not_show_has_the_information_of_before():
    """Windows whose own unknowns explain all but rounding: the reduced normal equations
    keep what was known.
    """
    rng = np.random.default_rng(4)
    columns = rng.normal(size=(3, 12, 2)) * 1e9  # what the windows' own unknowns do
    rows = columns @ rng.normal(size=(3, 2, 3)) + rng.normal(size=(3, 12, 3)) * 1e-8
    free, numbers, zeros = (
        columns.transpose(0, 2, 1),
        rows.transpose(0, 2, 1),
        np.zeros((3, 3)),
    )
    normal = NormalEquations(
        own=free @ columns,
        mixed=free @ rows,
        common=numbers @ rows,
        pull=zeros[:, :2],
        push=zeros,
        of_rows=zeros,
    )
    prior = np.array([0.5, 0.1, 1e-3])
    total = reduce(normal, np.zeros((3, 0)), np.full(2, 1e3), prior).total
    size = 1.0 / prior
    np.linalg.cholesky(total)
    assert np.linalg.eigvalsh(total / np.outer(size, size))[0] >= 0.5
