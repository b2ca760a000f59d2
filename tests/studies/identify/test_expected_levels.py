"""Expected accuracy and designs allow each stretch a trim torque of its own, as the search for the numbers does."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from skyarm.studies.identify import design, information
from skyarm.studies.identify.identify_vehicle import RATES

SEARCH = SimpleNamespace(errors=None, begin=None, prior=None, steps=None, block=1, used=())


@pytest.mark.parametrize(
    ("module", "name"), [(information, "expected_numbers"), (design, "measured_noise")], ids=["information", "design"]
)
def test_levels_of_the_rates_are_those_of_the_search(monkeypatch, module, name):
    def expected_fit(errors, start, prior, steps, block, used=(), levels=()):
        assert tuple(levels) == RATES
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "search_of", lambda *_, **__: SEARCH)
    monkeypatch.setattr(module, "expected_fit", expected_fit)
    with pytest.raises(KeyboardInterrupt):
        getattr(module, name)([], None)
