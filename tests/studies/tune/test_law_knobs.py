"""Knobs are a law's gains and nothing else, for any law: those of the catalogue, and
someone's own.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated

import pytest

from skyarm.algebra import Vec3
from skyarm.algebra.scalars import Scalar
from skyarm.control.catalogue import LAWS, make_controller, make_named, tuned_factors
from skyarm.control.controller import Controller
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Mixer
from skyarm.records.leaves import is_leaf, is_record, part, parts, walk
from skyarm.records.units import NUMBER, Unit, declared_fields
from skyarm.studies.tune.law_knobs import (
    GAIN,
    NOT_GAINS,
    KnobError,
    find_knobs,
    inner_place,
)
from skyarm.vehicle.vehicle_files import load_vehicle

MODEL = Model(vehicle=load_vehicle("hummingbird_arm2"))

TRACED = [name for name in LAWS if name != "nmpc"]


@dataclass(frozen=True, kw_only=True)
class Constants:
    """Of a law that nobody knows."""

    model: Model
    mixer: Mixer
    pair: tuple[float, float] = (16.0, 8.0)
    arm: tuple[float, ...] = (200.0, 100.0)
    pull: Annotated[Vec3, Unit("1/s^2")] = Vec3(3.0, 3.0, 0.0)
    longest: Annotated[Scalar, Unit("m/s", "speed of the way back", bound=True)] = 2.0
    pace: Annotated[Scalar, Unit("1/s", "gain that reaches the largest speed")] = 0.7
    reach: Annotated[Scalar, Unit("m", "of the arm")] = 0.3
    off: float = 0.0
    count: int = 3


def own() -> Controller:
    made = make_named("decoupled_pd", MODEL)
    return Controller(
        name="own", law=made.law, par=Constants(model=MODEL, mixer=made.par.mixer)
    )


@pytest.mark.parametrize("law", TRACED)
def test_every_law_of_the_catalogue_has_knobs_on_positive_numbers_of_its_constants(law):
    made = make_named(law, MODEL)
    knobs = find_knobs(made, law)
    assert knobs
    for knob in knobs:
        for place, number in knob.numbers:
            assert number > 0.0
            assert part(made.par, place) == number
            assert place[0] not in ("model", "mixer")
    paths = [place for knob in knobs for place, _ in knob.numbers]
    assert len(set(paths)) == len(paths)
    if law in tuned_factors():
        assert {knob.path for knob in knobs} <= set(tuned_factors()[law])


def test_knobs_of_an_unknown_law_are_numbers_with_the_unit_of_a_gain_or_without_any():
    knobs = {knob.path: dict(knob.numbers) for knob in find_knobs(own())}
    # items of a fixed pair mean different things, those of a list the same; a zero
    # axis, limits and lengths stay
    assert knobs == {
        "pair.0": {("pair", "0"): 16.0},
        "pair.1": {("pair", "1"): 8.0},
        "arm": {("arm", "0"): 200.0, ("arm", "1"): 100.0},
        "pull": {("pull", "x"): 3.0, ("pull", "y"): 3.0},
        "pace": {("pace",): 0.7},
    }


LIMIT = re.compile(
    r"\b(largest|smallest|least|lowest|highest|most|limits?|bounds?|adapted)\b"
)
OPTIONS = {
    "centroidal": (
        {"mode": "tip", "interaction": (0.3, 0.1)},
        {"mode": "tip", "load": 0.6},
        {"adaptation": 0.0},
    ),
}


def declared(record, place=()):
    """Place, unit and declaration of each number of constants that may be a gain by its
    unit.
    """
    units = declared_fields(type(record)) if is_record(record) else {}
    for name, value in (
        parts(record).items() if is_record(record) or isinstance(record, tuple) else ()
    ):
        if place or name not in NOT_GAINS:
            unit = units.get(name, (None, NUMBER))[1]
            if GAIN.search(unit.unit):
                yield (*place, name), unit
            yield from declared(value, (*place, name))


@pytest.mark.parametrize("law", TRACED)
def test_a_limit_of_a_law_is_declared_as_a_bound(law):
    """The words of its meaning decided before; who writes them declares it now."""
    for options in ({}, *OPTIONS.get(law, ())):
        made = make_controller(law, MODEL, **options)
        found = dict(declared(part(made.par, inner_place(made))))
        assert [
            place
            for place, unit in found.items()
            if unit.bound != bool(LIMIT.search(unit.meaning))
        ] == []


def test_chosen_knobs_are_named_by_their_path_or_its_beginning():
    made = make_named("ct_ladder", MODEL)
    assert [
        knob.path for knob in find_knobs(made, made.name, ["observer", "gains.rate"])
    ] == [
        "gains.rate",
        "observer.force",
        "observer.torque",
        "observer.joints",
    ]
    with pytest.raises(
        KnobError,
        match=r"--knobs: 'observr': did you mean .*must be one of gains.position",
    ):
        find_knobs(made, made.name, ["observr"])


def test_the_flagships_limits_and_lengths_are_no_knobs():
    made = make_named("centroidal_tip", MODEL)
    found = {knob.path for knob in find_knobs(made, made.name)}
    assert {"base.position", "base.rate", "tip.position", "observer.force"} <= found
    assert (
        not {"tip.reach", "thrust_floor", "tip_mass_limit", "reference_period", "tilt"}
        & found
    )
    assert len([at for at, value in walk(made.par) if is_leaf(value)]) > 5 * len(found)
