"""Units in the tables of the pages are those that the fields of the records state."""

from __future__ import annotations

import re
from typing import Any

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
from skyarm.control.laws.predictive.observer import Bandwidths
from skyarm.control.model import TORQUE_GAINS, GeometricGains, JointGains, Model
from skyarm.control.safety.limits import Limits
from skyarm.records.units import units
from skyarm.vehicle.linkage import Joint
from skyarm.vehicle.vehicle_records import BodyDrag, Rotor
from support.pages import EXACT_ROWS, LAW_ROWS, laws_of, rows_of

DESCRIBED = {"links.joint": Joint, "rotors": Rotor, "drag": BodyDrag}
"""Record of the rows from one that begins with this table on."""


def words_of(kind: type) -> list[str]:
    return [unit.unit for unit in units(kind).values()]


def test_every_unit_of_the_table_of_vehicle_files_is_its_field_s() -> None:
    kind: Any = None
    seen: set[tuple[type, str]] = set()
    for head, allowed, *_ in rows_of("vehicle_files.md", "| field | allowed | left out |"):
        table, *named = re.findall(r"`([\w.]+)`", head)
        kind = DESCRIBED.get(table, kind if table not in ("joints", "frames", "rotor_defaults") else None)
        for name in (table, *named):
            unit = units(kind).get(name) if kind else None
            if unit is not None and unit.unit:
                # in words of its own, not as a part of another unit
                assert re.search(rf"(?<![\w/^]){re.escape(unit.unit)}(?![\w/^])", allowed), (head, unit.unit)
                seen.add((kind, name))
    for kind, names in (
        (Joint, {"position", "lower", "upper", "effort_limit", "damping", "coulomb", "coulomb_rate"}),
        (Rotor, {name for name, unit in units(Rotor).items() if unit.unit} - {"position"}),
        (BodyDrag, {"area", "air_density"}),
    ):
        assert names <= {name for each, name in seen if each is kind}


@pytest.mark.parametrize("law", [law for law in LAWS if law != "centroidal"])
def test_units_of_a_law_s_options_are_those_of_its_constants(law: str) -> None:
    model = Model(vehicle=skyarm.load_vehicle("hummingbird_arm2"))
    own = units(type(make_controller(law, model).par))
    joints = [unit.unit.split(" or ")[0] for unit in TORQUE_GAINS.values()]
    records = {
        "gains": ", ".join(words_of(GeometricGains)),
        "joint_gains": f"{', '.join(words_of(JointGains))}; {', '.join(joints)} for `decoupled_pd` and `admittance_pd`",
        "observer": ", ".join(dict.fromkeys(words_of(ObserverGains))),
        "bandwidths": ", ".join(dict.fromkeys(words_of(Bandwidths))),
    }
    seen = 0
    for laws, cell, unit, *_ in LAW_ROWS:
        option = cell.strip("`")
        if law in laws_of(laws) and (option in own or option in records):
            assert unit == (records.get(option) or own[option].unit or "-"), option
            seen += 1
    assert seen > (1 if law != "nmpc" else 0)


def test_units_of_the_centroidal_law_s_options_are_those_of_its_constants() -> None:
    records = (TipGains, CenterGains, SidewaysGains, CentroidalParameters)
    own = {name: unit for record in records for name, unit in units(record).items() if name != "bandwidth"}
    seen = {option: row[1] for option, row in EXACT_ROWS.items() if option in own}
    assert {option: own[option].unit or "-" for option in seen} == seen
    assert len(seen) > 5, seen
    assert EXACT_ROWS["base"][1] == ", ".join(words_of(BaseGains)[:4])
    assert EXACT_ROWS["arm"][1] == ", ".join(words_of(JointGains))
    assert EXACT_ROWS["tip"][1] == ", ".join(words_of(TipGains)[:2])
    assert EXACT_ROWS["observer"][1] == ", ".join(dict.fromkeys(words_of(ObserverGains)))


def test_units_of_the_safety_layer_s_limits_are_those_of_its_record() -> None:
    seen: set[str] = set()
    for head, said, *_ in rows_of("scenario_files.md", "| limit | unit | left out |"):
        named = [name for name in re.findall(r"`(\w+)`", head) if name in units(Limits)]
        given = re.split(r"[,;:] ", said)
        for name, text in zip(named, given, strict=False):
            assert re.match(rf"{re.escape(units(Limits)[name].unit)}(?![\w/^]| or )", text), (name, text)
            seen.add(name)
    assert seen == set(units(Limits))
