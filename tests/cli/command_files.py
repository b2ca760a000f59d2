"""Files that the commands are given, and changes of them."""

from __future__ import annotations

from skyarm.scenario.scenario_file import LIBRARY as SCENARIOS
from skyarm.vehicle.vehicle_files import LIBRARY as VEHICLES
from support.commands import Outcome

CASE1 = (SCENARIOS / "case1.toml").read_text("utf-8")
VEHICLE = (VEHICLES / "hummingbird_arm2_rotors.toml").read_text("utf-8")


def changed(text: str, old: str, new: str) -> str:
    assert old in text, old
    return text.replace(old, new, 1)


def succeeded(result: Outcome) -> str:
    assert result.code == 0, result.err
    assert not result.err
    assert "\x1b" not in result.out, "no colours into a pipe"
    return result.out


SHORT = """
schema = 1
name = "short"
duration = 0.5
[plant]
vehicle = "hummingbird_arm2_rotors"
gravity = 9.81
[model]
vehicle = "hummingbird_arm2"
[controller]
preset = "paper_pd"
[reference]
base = { kind = "hover", position = [0.0, 0.0, 1.0] }
"""
FALLS = (
    SHORT.replace("duration = 0.5", "duration = 5.0")
    + "[initial]\nposition = [0, 0, 1]\nvelocity = [0, 0, -20]\n"
)
