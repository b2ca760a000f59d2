"""Remedies of a loop that is short of margin: of the groups of gains with which a hover settles, and of no other."""

from __future__ import annotations

from types import SimpleNamespace

from skyarm.studies.tune.explain import ALL, _Probe
from skyarm.studies.tune.law_knobs import Knob

KNOBS = tuple(
    Knob(path=f"{name}.k", unit=unit, numbers=(((f"{name}.k",), 2.0),)) for name, unit in (("a", "1/s^2"), ("b", "1/s"))
)


def remedies(settles):
    """Remedies of a loop three times short, whose margins are met where a hover settles."""
    probe = _Probe.__new__(_Probe)
    probe._knobs, probe._required = KNOBS, None
    probe._edges = lambda gains: SimpleNamespace(shortness=lambda _: 0.5) if settles(gains) else None
    return probe._remedies(SimpleNamespace(shortness=lambda _: 3.0))


def test_gains_with_which_no_hover_settles_are_no_remedy():
    assert remedies(lambda _: False) == []


def test_every_group_of_gains_with_which_one_settles_is_a_remedy():
    found = remedies(lambda _: True)
    assert found[-1].part == ALL
    assert all(each.meets and each.share in (0.8, 1.25) for each in found), "the least change that is enough"
    slower = remedies(lambda gains: all(value < 2.0 for value in gains.values()))
    assert slower
    assert all(each.share == 0.8 for each in slower)


def test_a_group_with_which_none_settles_keeps_no_other_one_from_being_a_remedy():
    for path in ("controller.a.k", "controller.b.k"):
        (found,) = remedies(lambda gains, path=path: list(gains) == [path])
        assert list(found.gains) == [path]
