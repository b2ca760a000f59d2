"""Every metric has words and a unit; no unit is said that its name contradicts."""

from __future__ import annotations

import dataclasses

import pytest

import skyarm
from skyarm.log.metrics.metric_catalogue import measures, metric_words
from skyarm.records.registry.registrations import SHIPPED, add, names
from support.components import registry_kept


@pytest.mark.parametrize("name", sorted(measures(2)))
def test_every_metric_of_the_catalogue_has_words_and_a_unit(name: str) -> None:
    words, unit = metric_words(name)
    assert unit in (
        "m",
        "m s",
        "s",
        "rad",
        "rad s",
        "rad/s",
        "N m",
        "phases",
        "N",
        "losses",
        "",
    )
    assert unit or name in (
        "contact_held",
        "rotor_saturation",
        "joint_saturation",
        "mechanism_last",
        "mechanism_furthest",
        "load_share_mean",
    )
    assert "_" not in words
    for part, named in (
        ("ee_", "tip"),
        ("joint_error", "joint"),
        ("pitch", "pitch"),
        ("tau2", "joint 2"),
    ):
        assert part not in name or named in words
    assert ("gust" in words) == name.startswith("gust_")
    assert ("continuous" in words) == name.endswith("_continuous")
    assert ("integral" in words) == ("iae" in name) == unit.endswith(" s")


def test_a_metric_of_one_s_own_is_called_by_its_name() -> None:
    assert metric_words("own_energy") == ("own energy", "")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Turns(skyarm.Metric):
    """Control instants of the window."""

    words, unit = "instants", "periods"

    def start(self):
        return (0.0,)

    def count(self, memory, now):
        return (memory[0] + 1.0,)

    def result(self, memory, instants, period):
        return memory[0]


def test_a_metric_that_ships_is_one_row_of_the_registry_with_its_own_words() -> None:
    log = skyarm.run(dataclasses.replace(skyarm.load_scenario("case1"), duration=0.5))
    with registry_kept():
        add("metric", "turns", Turns, "instants of the flight", SHIPPED)
        skyarm.register.metric("own_turns")(Turns)
        assert metric_words("turns") == ("instants", "periods")
        assert skyarm.score(log, ["turns"])["turns"] == 100.0
        assert names("metric") == ("turns", "own_turns")
        assert names("metric", shipped=False) == ("own_turns",)


def test_a_metric_that_is_registered_anew_counts_as_it_is_now(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log = skyarm.run(dataclasses.replace(skyarm.load_scenario("case1"), duration=0.5))
    with registry_kept():
        skyarm.register.metric("own_turns")(Turns)
        assert skyarm.score(log, ["own_turns"])["own_turns"] == 100.0
        monkeypatch.setattr(Turns, "count", lambda _, memory, now: (memory[0] + 2.0,))
        assert skyarm.score(log, ["own_turns"])["own_turns"] == 200.0
