"""Parts of a log's scenario by the words of its file: each word leads to the field that
it is read into.
"""

from __future__ import annotations

import pytest

import skyarm
from skyarm.log.flown_scenario import restored_at, written_at
from skyarm.records.leaves import part
from skyarm.records.plain import plain
from skyarm.records.words import Slot, slots
from skyarm.scenario.scenario_record import Scenario

SCENARIO = skyarm.load_scenario("case3", duration=0.02)
INFO = skyarm.run(SCENARIO).info
WORDS = [each for each in slots(Scenario) if each.path != "sensors.*"]


@pytest.mark.parametrize("slot", WORDS, ids=lambda each: each.path)
def test_a_word_leads_to_its_field(slot: Slot) -> None:
    held = part(SCENARIO, slot.record)
    # where there are none, or the usual one
    left_out = slot.path in ("payloads", "changes", "plant.closure", "plant.contact")
    assert written_at(INFO, slot.table) == (None if left_out else plain(held))
    if slot.path in ("plant", "reference", "delays"):
        assert restored_at(INFO, slot.path) == held


def test_a_path_goes_on_through_fields_and_ends_where_none_is() -> None:
    assert written_at(INFO, "plant.vehicle.name") == "hummingbird_arm2_rotors"
    assert written_at(INFO, "delays.command") == SCENARIO.delays.command
    assert written_at(INFO, "controller.gains.position.x") == float(
        SCENARIO.controller.par.gains.position.x
    )
    for path in ("plant.vehicle.wings", "wings", "plant.vehicle.name.first"):
        assert written_at(INFO, path) is None
    assert written_at({}, "plant.vehicle") is None
    assert (
        restored_at(
            {"scenario_record": {"agent": {"plant": {"type": "none:Such"}}}}, "plant"
        )
        is None
    )
