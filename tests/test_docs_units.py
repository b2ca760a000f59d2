"""Units in the tables of the pages are those that the fields of the records state."""

from __future__ import annotations

import pytest

import skyarm
from skyarm.control.blocks.attitude import BaseGains
from skyarm.control.blocks.disturbance_observer import ObserverGains
from skyarm.control.catalogue import LAWS, make_controller
from skyarm.control.laws.centroidal.parameters import (
    CenterGains,
    CentroidalParameters,
    TipGains,
)
from skyarm.control.laws.centroidal.tilting.sideways_force import SidewaysGains
from skyarm.control.laws.predictive.cost import Weights
from skyarm.control.laws.predictive.observer import Bandwidths
from skyarm.control.model import TORQUE_GAINS, GeometricGains, JointGains, Model
from skyarm.control.safety.limits import Limits
from skyarm.records.units import units
from skyarm.vehicle.linkage import Body, Joint
from skyarm.vehicle.tilt import Tilt
from skyarm.vehicle.vehicle_records import BodyDrag, Rotor
from support.pages import cells_of, law_rows, unit_of
from website.generated_blocks import heads, made

DESCRIBED = {
    "joint": Joint,
    "rotors": Rotor,
    "drag": BodyDrag,
    "body": Body,
    "tilt": Tilt,
}
"""Block of the page on vehicle files -> record."""


def words_of(kind: type) -> list[str]:
    """Units of a record's fields; the observer's threshold of leaps is no option."""
    return [unit.unit for name, unit in units(kind).items() if name != "jump"]


def test_the_keys_that_change_a_joint_are_those_from_lower_to_stop_damping() -> None:
    rows = [row[0].strip("`") for row in cells_of(made("vehicle joint"))]
    placed = {"name", "kind", "axis", "position", "rotation"}
    changed = [name for name in units(Joint) if name not in placed]
    assert rows[rows.index("lower") : rows.index("stop_damping") + 1] == changed


@pytest.mark.parametrize("block", DESCRIBED)
def test_every_unit_of_the_tables_of_vehicle_files_is_its_field_s(block: str) -> None:
    assert f"vehicle {block}" in heads()
    rows = {row[0].strip("`"): row[1] for row in cells_of(made(f"vehicle {block}"))}
    named = {
        name: unit
        for name, unit in units(DESCRIBED[block]).items()
        if name in rows and name != "direction"
    }
    assert {name: unit.unit or "-" for name, unit in named.items()} == {
        name: unit_of(rows[name]) for name in named
    }
    assert len(named) >= 2


@pytest.mark.parametrize("law", [law for law in LAWS if law != "centroidal"])
def test_units_of_a_law_s_options_are_those_of_its_constants(law: str) -> None:
    model = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"))
    own = units(type(make_controller(law, model).par))
    torque = law in ("decoupled_pd", "admittance_pd")
    records = {
        "gains": dict(units(GeometricGains)),
        "joint_gains": dict(TORQUE_GAINS if torque else units(JointGains)),
        "bandwidths": dict(units(Bandwidths)),
        "weights": dict(units(Weights)),
    }
    seen = 0
    for option, row in law_rows(law).items():
        of, _, field = option.partition(".")
        unit = (
            records[of][field].unit
            if field
            else own[option].unit
            if option in own
            else None
        )
        if of == "observer":
            unit = ", ".join(dict.fromkeys(words_of(ObserverGains)))
        if unit is not None:
            assert unit_of(row["type and unit"]) == (unit or "-"), option
            seen += 1
    assert seen > 5


def test_units_of_the_centroidal_law_s_options_are_those_of_its_constants() -> None:
    records = (TipGains, CenterGains, SidewaysGains, CentroidalParameters)
    own = {
        name: unit
        for record in records
        for name, unit in units(record).items()
        if name != "bandwidth"
    }
    shown = {
        option: unit_of(row["type and unit"])
        for option, row in law_rows("centroidal").items()
    }
    rows = ("base", "arm", "tip", "observer")
    seen = {
        option: unit
        for option, unit in shown.items()
        if option in own and option not in rows
    }
    assert {option: own[option].unit or "-" for option in seen} == seen
    assert len(seen) > 5, seen
    assert shown["base"] == ", ".join(words_of(BaseGains)[:4])
    assert shown["arm"] == ", ".join(words_of(JointGains))
    assert shown["tip"] == ", ".join(words_of(TipGains)[:2])
    assert shown["observer"] == ", ".join(dict.fromkeys(words_of(ObserverGains)))


def test_units_of_the_safety_layer_s_limits_are_those_of_its_record() -> None:
    assert sum(head.startswith("words controller.safety ") for head in heads()) == 3
    shown = {
        row[0].strip("`"): unit_of(row[1])
        for row in cells_of(made("words controller.safety"))
    }
    assert {name: unit.unit for name, unit in units(Limits).items()} == {
        name: shown[name] for name in units(Limits)
    }
    assert shown["stow"] == "rad or m"
