"""Counter-based noise: known answers, layout, statistics."""

import math

import numpy as np
import pytest

from skyarm.algebra.scalars import philox

# Random123 1.14.0, tests/kat_vectors, lines "philox4x32 10": counter, key, expected
KNOWN_ANSWERS = [
    (
        "00000000 00000000 00000000 00000000 00000000 00000000 6627e8d5 e169c58d"
        " bc57ac4c 9b00dbd8"
    ),
    (
        "ffffffff ffffffff ffffffff ffffffff ffffffff ffffffff 408f276d 41c83b0e"
        " a20bc7c6 6d5451fd"
    ),
    (
        "243f6a88 85a308d3 13198a2e 03707344 a4093822 299f31d0 d16cfe09 94fdcceb"
        " 5001e420 24126ea1"
    ),
]


def python_philox(counter, key):
    """The cipher over Python integers: an oracle without fixed-width arithmetic."""
    c, k = list(counter), list(key)
    for _ in range(10):
        p, q = 0xD2511F53 * c[0], 0xCD9E8D57 * c[2]
        c = [(q >> 32) ^ c[1] ^ k[0], q % 2**32, (p >> 32) ^ c[3] ^ k[1], p % 2**32]
        k = [(k[0] + 0x9E3779B9) % 2**32, (k[1] + 0xBB67AE85) % 2**32]
    return c


@pytest.mark.parametrize("line", KNOWN_ANSWERS)
def test_known_answers_of_random123(line):
    words = [int(word, 16) for word in line.split()]
    result = philox.philox4x32(tuple(words[:4]), tuple(words[4:6]))
    assert [int(word) for word in result] == words[6:]


def test_layout_is_the_documented_one():
    seed, episode, channel, step = (
        0x0123456789ABCDEF,
        0xE0000007,
        0xC0000005,
        0x80000003,
    )
    drawn = philox.uniforms(seed, episode, channel, step, 4)
    for j in range(4):
        w = python_philox((j // 2, step, channel, episode), (0x89ABCDEF, 0x01234567))
        low, high = (w[0], w[1]) if j % 2 == 0 else (w[2], w[3])
        # exact: no tolerance
        assert drawn[j] == (2 * ((high * 2**32 + low) >> 12) + 1) / 2**53
    a, b = drawn[:2]
    first, second = philox.normal(seed, episode, channel, step, 2)
    radius = math.sqrt(-2.0 * math.log(a))
    # 1e-15: NumPy's and the C library's log, sin and cos may differ in the last digit
    assert first == pytest.approx(
        radius * math.cos(2.0 * math.pi * b), rel=1e-14, abs=1e-15
    )
    assert second == pytest.approx(
        radius * math.sin(2.0 * math.pi * b), rel=1e-14, abs=1e-15
    )


def test_uniforms_stay_inside_the_open_interval_and_are_symmetric():
    zero, ones = np.uint64(0), np.uint64(0xFFFFFFFF)
    assert philox._unit(zero, zero) == 2.0**-53
    assert philox._unit(ones, ones) == 1.0 - 2.0**-53


def test_a_batch_equals_a_loop_of_singles():
    episodes, steps = np.arange(3)[:, None], np.arange(100, 105)
    batch = philox.normal(9, episodes, 2, steps, 3)
    assert batch.shape == (3, 5, 3)
    for i in range(3):
        for k in range(5):
            assert np.array_equal(batch[i, k], philox.normal(9, i, 2, 100 + k, 3))


def test_more_numbers_do_not_change_the_first_ones():
    many = philox.normal(1, 2, 3, np.arange(4), 7)
    assert np.array_equal(philox.normal(1, 2, 3, np.arange(4), 3), many[:, :3])
    assert np.array_equal(
        philox.uniform(1, 2, 3, np.arange(4)),
        philox.uniforms(1, 2, 3, np.arange(4), 5)[:, 0],
    )


def test_no_numbers_are_an_empty_axis():
    assert philox.normal(1, 2, 3, np.arange(4), 0).shape == (4, 0)


@pytest.mark.parametrize("seed", [0, 1, 2**32, 2**64 - 1])
def test_uniform_and_normal_have_their_distributions(seed):
    stats = pytest.importorskip("scipy.stats")
    # fixed seeds, so the outcome is fixed; 1e-3 is the chance that a good generator
    # would have been refused
    assert (
        stats.kstest(philox.uniform(seed, 0, 0, np.arange(50_000)), "uniform").pvalue
        > 1e-3
    )
    assert (
        stats.kstest(
            philox.normal(seed, 0, 0, np.arange(25_000), 2).ravel(), "norm"
        ).pvalue
        > 1e-3
    )


def test_seed_episode_channel_step_and_index_are_independent():
    n = 40_000
    steps = np.arange(n)
    base = philox.normal(5, 1, 1, steps, 2)
    others = {
        "index": base[:, 1],
        "step": philox.normal(5, 1, 1, steps + 1, 1)[:, 0],
        "channel": philox.normal(5, 1, 2, steps, 1)[:, 0],
        "episode": philox.normal(5, 2, 1, steps, 1)[:, 0],
        "low seed": philox.normal(6, 1, 1, steps, 1)[:, 0],
        "high seed": philox.normal(5 + 2**63, 1, 1, steps, 1)[:, 0],
    }
    for name, other in others.items():
        for a, b in ((base[:, 0], other), (base[:, 0] ** 2 - 1.0, other**2 - 1.0)):
            correlation = np.mean(a * b) / (np.std(a) * np.std(b))
            # 4.5 sigma of the estimate
            assert abs(correlation) < 4.5 / math.sqrt(n), name


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ((-1, 0, 0, 0), "seed"),
        ((2**64, 0, 0, 0), "seed"),
        ((1.5, 0, 0, 0), "seed"),
        ((0, 2**32, 0, 0), "episode"),
        ((0, 0, -1, 0), "channel"),
        ((0, 0, 0, np.array([0, 2**32])), "step"),
        ((0, 0, 0, np.array([0.0])), "step"),
    ],
)
def test_numbers_outside_their_range_are_refused_by_name(arguments, named):
    with pytest.raises(ValueError, match=f"^{named} = .*must be whole numbers"):
        philox.uniform(*arguments)
