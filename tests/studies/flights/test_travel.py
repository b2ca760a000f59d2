"""Laws made inside functions travel to other processes, with what they were closed
over.
"""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.records.registry.plugins import load_plugin
from skyarm.records.travel import pack
from skyarm.simulate.loop import run
from support.components import registry_kept, same_logs
from support.flights import elsewhere

MADE_INSIDE = """
import skyarm

GAIN = 2.0

@skyarm.register.law("mine")
def make(model, *, push: float = 3.0):
    base = skyarm.preset("paper_pd", model)

    def scaled(speeds, factor=1.0, *, more=1.0):
        return tuple(s * factor * more for s in speeds)

    def law(memory, measurement, reference, dt, *, par):
        memory, command = base.law(memory, measurement, reference, dt, par=par)
        more = scaled(command.rotor_speeds, more=1.001)
        speeds = tuple(s + push * GAIN for s in more)
        return memory, skyarm.Command(rotor_speeds=speeds, efforts=command.efforts)

    return skyarm.Controller(name="mine", law=law, par=base.par, memory=base.memory)
"""


def test_a_law_made_inside_a_function_flies_in_a_worker_as_it_does_here(
    tmp_path: Path,
) -> None:
    file = tmp_path / "mine.py"
    file.write_text(MADE_INSIDE, "utf-8")
    with registry_kept():
        load_plugin(file)
        planned = skyarm.load_scenario("case1", controller="mine", duration=0.1)
        with pytest.raises((AttributeError, pickle.PicklingError)):
            pickle.dumps(planned)
        theirs = elsewhere(run, planned)
        ours = run(planned)
    assert same_logs(theirs, ours)
    assert not same_logs(
        ours, run(skyarm.load_scenario("case1", controller="paper_pd", duration=0.1))
    )


def _countdown():
    steps = []

    def count(n, /, step=1, *, seen=steps):
        seen.append(n)
        return count(n - step) if n > 0 else tuple(seen)

    return count


def test_a_function_closed_over_itself_travels_with_its_defaults() -> None:
    again = pickle.loads(pack({"a": (_countdown(),)}))["a"][0]
    assert again(3) == (3, 2, 1, 0)
    assert again.__qualname__ == "_countdown.<locals>.count"


def test_a_function_used_twice_stays_one() -> None:
    one = _countdown()
    first, second = pickle.loads(pack([one, one]))
    assert first is second


def test_records_travel_as_by_pickle() -> None:
    state = skyarm.load_scenario("case3").reference
    assert pickle.loads(pack(state)) == state
    assert np.array_equal(pickle.loads(pack(np.arange(3))), np.arange(3))


def test_what_cannot_travel_is_one_line() -> None:
    values = (x for x in ())

    def law(*_: object) -> object:
        return values

    with pytest.raises(
        ValueError,
        match=(
            r"^workers: cannot pickle 'generator' object; what flies in other processes"
        ),
    ):
        pack(law)
