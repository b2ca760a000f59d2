"""A gripper whose fingers close evenly is an ordinary tool: its joint moves neither tip nor centre of mass."""

from __future__ import annotations

import shutil
from pathlib import Path

from skyarm.studies.assess.arm_poses import arm_poses
from skyarm.studies.assess.finding import WARNING
from skyarm.studies.assess.joints import arm_workspace
from skyarm.vehicle.vehicle_files import load_vehicle

PICKER = Path(__file__).parents[3] / "examples" / "picker.urdf"


def carrier(folder: Path, mimic: str):
    shutil.copy(PICKER, folder)
    file = folder / "carrier.toml"
    file.write_text(
        f'schema = 1\nname = "carrier"\nairframe = "tilted_hexarotor"\nmimic = "{mimic}"\nend_effector = "grasp_tip"\n'
        '[[attach]]\narm = "picker.urdf"\nposition = [0.0, 0.0, -0.05]\n',
        "utf-8",
    )
    return load_vehicle(file)


def warned(vehicle):
    return [each.field for each in arm_workspace(arm_poses(vehicle)) if each.level == WARNING]


def test_fingers_that_follow_each_other_are_no_fault_of_the_arm(tmp_path):
    vehicle = carrier(tmp_path, "couple")
    assert [each.name for each in vehicle.followers] == ["right_finger"]
    assert warned(vehicle) == []
