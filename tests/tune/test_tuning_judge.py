"""What a judge of gains adds up: the mean cost of all flights but the late ones, and one for each of those lost."""

from __future__ import annotations

import math

import numpy as np
import pytest

from skyarm.tune import candidate_costs as tuning
from skyarm.tune.one_law import Alone
from skyarm.tune.trials import Score, Together


def score(base, joint, completed, jitter=(0.0, 0.0)):
    return Score(
        base=np.array(base), joint=np.array(joint), jitter=np.array(jitter), completed=np.array(completed, dtype=bool)
    )


def test_costs_are_a_mean_of_flights_and_a_count_of_the_late_ones_that_were_lost(monkeypatch):
    quiet = tuning.QUIET
    flown = [
        ("perfect", score((0.01, 0.02), (0.0, 0.1), (1, 1))),
        ("noisy", score((0.03, 0.01), (0.02, 0.0), (1, 0), jitter=(3.0 * quiet, 0.5 * quiet))),
        ("late", score((0.0, 0.0), (0.0, 0.0), (1, 0))),
        ("late", score((10.0, 0.0), (0.0, 10.0), (1, 1))),
        ("perfect", score((0.05, 0.04), (0.01, 0.02), (1, 1))),
    ]
    trials = [tuning.Trial(case="case1", sensing=sensing, seed=0) for sensing, _ in flown]

    class Flyer:
        def fly_all(self, asked, factors):
            assert list(asked) == trials
            assert all(np.allclose(each, np.exp([0.5, -0.5])) for each in factors.values())
            return [found for _, found in flown]

    monkeypatch.setattr(tuning, "_flyer", lambda law, workers: Flyer())
    law = "paper_ct" if "paper_ct" in tuning.KNOBS else next(iter(tuning.KNOBS))
    found = tuning.Judge(law, trials).costs(np.array([[0.5], [-0.5]]).repeat(len(tuning.KNOBS[law]), axis=1))

    def one(base, joint):
        return math.log(base + tuning.ARM * joint + tuning.FLOOR)

    first = one(0.01, 0.0) + (one(0.03, 0.02) + 2.0) + one(0.05, 0.01)
    second = one(0.02, 0.1) + math.log(tuning.LOST + tuning.FLOOR) + one(0.04, 0.02)
    # the first candidate loses the second late flight, the other one both
    assert found == pytest.approx([first / 3.0 + 1.0, second / 3.0 + 2.0], rel=1e-12)


@pytest.mark.parametrize("law", sorted(tuning.KNOBS))
def test_laws_over_scalars_fly_their_candidates_together_and_others_one_by_one(law):
    assert isinstance(tuning._flyer(law, 1), Together if tuning.untuned(law).compiled else Alone)
