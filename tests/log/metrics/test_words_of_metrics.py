"""Every metric has words and a unit; no unit is said that its name contradicts."""

from __future__ import annotations

import pytest

from skyarm.log.metrics.metric_catalogue import measures, metric_words


@pytest.mark.parametrize("name", sorted(measures(2)))
def test_every_metric_of_the_catalogue_has_words_and_a_unit(name: str) -> None:
    words, unit = metric_words(name)
    assert unit in ("m", "m s", "s", "rad", "rad s", "rad/s", "N m", "phases", "N", "losses", "")
    assert unit or name in ("contact_held", "mechanism_last", "mechanism_furthest")
    assert "_" not in words
    for part, named in (("ee_", "tip"), ("joint_error", "joint"), ("pitch", "pitch"), ("tau2", "joint 2")):
        assert part not in name or named in words
    assert ("gust" in words) == name.startswith("gust_")
    assert ("continuous" in words) == name.endswith("_continuous")
    assert ("integral" in words) == ("iae" in name) == unit.endswith(" s")


def test_a_metric_of_one_s_own_is_called_by_its_name() -> None:
    assert metric_words("own_energy") == ("own energy", "")
