"""Flights with objects and grippers: files, starts at rest, plants, lanes, logs, and
what is refused.
"""

from __future__ import annotations

import copy
import dataclasses
import json
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.log.log_columns import columns
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.largest_step import divisions
from skyarm.plant.mujoco import MujocoPlant
from skyarm.scenario.numbers import with_numbers
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import first_state
from skyarm.scenario.unlikely_numbers import part_warnings
from skyarm.simulate.loop import run_in_python
from skyarm.world.contact import Contact, FreeObject, Material, Surface
from support.cases import sampled
from support.logs import with_components
from support.worlds import BIRD, GRAVITY, Scene, energy, with_object

EXAMPLE = Path(__file__).parents[3] / "examples" / "pick_and_place_box.toml"
DOCUMENT = tomllib.loads(EXAMPLE.read_text(encoding="utf-8"))


ELASTIC = Material(dissipation=0.0, friction=0.0)


def elastic_ball(radius, **numbers):
    return FreeObject(
        name="ball",
        shape="sphere",
        size=(radius,),
        mass=0.2,
        material=ELASTIC,
        **numbers,
    )


@pytest.mark.parametrize("kind", [RigidBodyPlant, MujocoPlant])
def test_an_elastic_ball_keeps_its_energy_from_every_height(kind):
    """Within 0.02 % at any speed of leaving the ground, and so at any phase of the
    control periods.
    """
    ground = Contact(
        surfaces=(Surface(name="ground", material=ELASTIC),),
        objects=(elastic_ball(0.05),),
    )
    scene = Scene(ground, kind=kind)
    for height in (
        0.05,
        0.1,
        0.2,
        0.3,
        0.4,
        0.5,
        0.8,
        1.0,
        1.5,
        *np.linspace(1.6, 3.0, 12),
    ):
        dropped = with_object(ground, position=Vec3(0.0, 0.0, 0.05 + float(height)))
        _, rows = scene.fly(
            dropped,
            0.005 * round((1.5 * math.sqrt(2.0 * height / GRAVITY) + 0.05) / 0.005),
        )
        kept = energy(rows[:, 0], dropped.objects[0], GRAVITY)
        assert rows[-1, 0, 2] > 0.055 > rows[:, 0, 2].min(), "it bounced"
        assert kept[-1] / kept[0] == pytest.approx(1.0, abs=2e-4), height


def test_a_ball_that_crosses_a_hole_is_stopped_by_the_wall_before_the_nearer_bottom():
    """6 mm above the bottom and 30 mm from the wall, which it meets within a period; it
    stays elastic to 0.2 %.
    """
    hole = Surface(
        name="plate", shape="hole", size=(0.04, 0.05, 0.005, 0.2, 0.1), material=ELASTIC
    )
    inside = Contact(
        surfaces=(hole,), objects=(elastic_ball(0.01, position=Vec3(0.0, 0.0, -0.034)),)
    )
    scene = Scene(inside, gravity=0.0)
    for speed in (1.0, 3.5, 4.5):
        _, rows = scene.fly(
            with_object(inside, velocity=Vec3(0.6 * speed, 0.8 * speed, 0.0)), 0.2
        )
        away = np.hypot(rows[:, 0, 0], rows[:, 0, 1])
        assert away.max() < 0.065
        assert energy(rows[away < 0.025, 0], inside.objects[0]) == pytest.approx(
            0.1 * speed**2, rel=2e-3
        )
        assert rows[away < 0.025, 0, 7].min() < 0.0, "it bounced"


@pytest.mark.parametrize("period", [0.02, 0.05])
def test_a_ball_that_hangs_above_the_ground_meets_it_within_a_long_period(period):
    """At rest it falls by 12 mm in 50 ms: energy with that of the contact's spring,
    whose bend is smoothed.
    """
    ground = Contact(
        surfaces=(Surface(name="ground", material=ELASTIC),),
        objects=(elastic_ball(0.05),),
    )
    scene = Scene(ground)
    for height in (0.006, 0.01, 0.015):
        _, rows = scene.fly(
            with_object(ground, position=Vec3(0.0, 0.0, 0.05 + height)),
            1.0,
            step=period,
        )
        spring = 0.5 * ELASTIC.stiffness * np.maximum(0.05 - rows[:, 0, 2], 0.0) ** 2
        kept = energy(rows[:, 0], ground.objects[0], GRAVITY) + spring
        assert kept == pytest.approx(kept[0], rel=3e-3), height


def lifting(duration=0.6):
    """The tip begins on a box of 30 g, the magnet takes it at 0.1 s, and it is
    lifted.
    """
    found = copy.deepcopy(DOCUMENT) | {"duration": duration}
    found["world"]["objects"][0]["mass"] = 0.03
    path = found["reference"]["tip"]["path"]
    path["position"], path["acceleration"] = [0.2, 0.0, 0.811], 3.0
    path["phases"] = [{"kind": "go_to", "position": [0.2, 0.0, 0.86], "duration": 0.5}]
    found["world"]["grippers"][0]["closed"] = {
        "kind": "constant",
        "value": 1,
        "start": 0.1,
        "stop": 0.5,
    }
    return found


@pytest.fixture(scope="module")
def lifted():
    return skyarm.run(scenario_from(lifting()))


def test_the_box_goes_along_while_it_is_held_and_falls_when_it_is_let_go(lifted):
    assert lifted.status == "completed"
    (grasp,) = lifted.grasp_periods
    assert (grasp.gripper, grasp.held, grasp.gave_way) == ("magnet", "box", False)
    assert (grasp.start, grasp.end) == (0.1, 0.5)
    held = (lifted.time >= 0.1) & (lifted.time < 0.5)
    assert np.array_equal(lifted.gripper_taken[:, 0] > 0.5, held)
    above = np.linalg.norm((lifted.tip - lifted.object_position)[held], axis=1)
    assert np.ptp(above) < 1e-3
    assert lifted.object_position[held][-1, 2] > 0.8
    assert grasp.peak == lifted.gripper_force[held].max() > 0.3
    assert lifted.gripper_force[~held].max() == 0.0
    falls = lifted.object_velocity[lifted.time >= 0.5, 2]
    assert np.diff(falls)[:10] == pytest.approx(-9.81 * 0.005, abs=1e-6)


def test_columns_are_named_after_objects_and_grippers_and_files_keep_them(
    lifted, tmp_path
):
    named = {each.name: each for each in columns(lifted)}
    for name, unit in (
        ("object_position_box_z", "m"),
        ("object_quaternion_box_w", ""),
        ("object_rate_box_x", "rad/s"),
        ("object_velocity_box_y", "m/s"),
        ("gripper_taken_magnet", ""),
        ("gripper_force_magnet", "N"),
        ("gripper_lost_magnet", ""),
        ("contact_force_box_tip", "N"),
    ):
        assert named[name].unit == unit
    assert np.array_equal(
        named["object_position_box_z"].of(lifted), lifted.object_position[:, 2]
    )
    again = skyarm.load_log(lifted.save_npz(tmp_path / "a.npz"))
    assert np.array_equal(again.object_quaternion, lifted.object_quaternion)
    assert again.scenario.world == lifted.scenario.world
    assert again.grasp_periods == lifted.grasp_periods


def test_what_a_gripper_held_is_said(lifted):
    from skyarm.log.flight_summary import facts, sentences

    (line,) = [line for line in sentences(facts(lifted)) if " took " in line]
    assert line.startswith("magnet took box at 0.1 s: let go at 0.5 s, largest force ")
    (told,) = json.loads(json.dumps(facts(lifted)["grasps"]))
    assert (told["gripper"], told["held"], told["end"]) == ("magnet", "box", 0.5)
    lost = with_components(
        lifted, gripper_lost=lifted.gripper_lost + (lifted.time >= 0.5)[:, None]
    )
    assert "gave way at 0.5 s" in "".join(sentences(facts(lost)))
    assert "holds it to the end" in "".join(
        sentences(facts(skyarm.run(scenario_from(lifting(0.3)))))
    )


@pytest.mark.thorough
def test_both_plants_lift_the_same(lifted):
    theirs = skyarm.run(scenario_from(lifting(0.3), replaced={"plant": "mujoco"}))
    count = len(theirs.time)
    # steps of 0.7 and 0.5 ms
    assert theirs.object_position == pytest.approx(
        lifted.object_position[:count], abs=5e-5
    )
    assert theirs.gripper_force == pytest.approx(lifted.gripper_force[:count], abs=2e-2)


@pytest.mark.thorough
def test_floats_lift_the_same_bits(lifted):
    slow = run_in_python(scenario_from(lifting(0.15)))
    count = len(slow.time)
    for name in ("object_position", "object_quaternion", "gripper_force", "position"):
        assert np.array_equal(getattr(slow, name), getattr(lifted, name)[:count])


@pytest.mark.thorough
def test_lanes_of_a_batch_lift_each_its_own_box():
    """Masses, holding forces and starts differ from lane to lane: each as it flies
    alone.
    """
    scenario = scenario_from(lifting(0.15))
    values = {
        "world.objects.box.mass": np.array([0.03, 0.06]),
        "world.grippers.magnet.force": np.array([10.0, 0.2]),
        "world.objects.box.position.x": np.array([0.2, 0.203]),
    }
    light = with_numbers(scenario, {"world.objects.box.mass": 0.03})
    lanes = (
        skyarm.Batch(scenario, list(values), stiffest=light, log_every=1)
        .fly(values)
        .log
    )
    positions = np.stack([*lanes.state.position], axis=-1)  # (lanes, samples, 3)
    for lane in range(2):
        alone = skyarm.run(
            with_numbers(
                scenario, {path: float(each[lane]) for path, each in values.items()}
            )
        )
        assert alone.gripper_lost[-1] == [0.0, 1.0][lane]
        # steps of the lightest, of second order
        assert positions[lane] == pytest.approx(alone.position, abs=1e-6)
        assert np.abs(positions[lane] - positions[1 - lane]).max() > 1e-5


def handled(*phases, **gripper):
    """The example with other phases that grasp and release; its tip begins on the box
    of 30 g.
    """
    found = lifting(0.4)
    found["reference"]["tip"]["path"]["phases"] = [
        {"gripper": "magnet", "dwell": 0.1} | phase for phase in phases
    ]
    del found["world"]["grippers"][0]["closed"]
    found["world"]["grippers"][0] |= gripper
    return found


def test_phases_close_and_open_a_gripper_half_way_through_their_dwell():
    scenario = scenario_from(
        handled({"kind": "grasp"}, {"kind": "release"}, {"kind": "grasp"})
    )
    closed = scenario.world.grippers[0].closed
    found = [bool(closed.at(t)) for t in (0.045, 0.05, 0.145, 0.15, 0.245, 0.25, 9.0)]
    assert found == [False, True, True, False, False, True, True]
    once = (
        scenario_from(handled({"kind": "grasp"}, {"kind": "release"}))
        .world.grippers[0]
        .closed
    )
    assert [bool(once.at(t)) for t in (0.045, 0.05, 0.145, 0.15)] == [
        False,
        True,
        True,
        False,
    ]


@pytest.mark.parametrize(
    ("phases", "gripper", "words"),
    [
        (
            [{"kind": "grasp", "gripper": "claw"}],
            {},
            "phases\\[0\\].gripper = 'claw': must be .* there are magnet",
        ),
        (
            [{"kind": "grasp", "gripper": ""}],
            {},
            "phases\\[0\\].gripper = '': must be the name of a gripper",
        ),
        (
            [{"kind": "grasp", "payload": "box"}],
            {},
            "phases\\[0\\].payload = 'box': unknown field",
        ),
        (
            [{"kind": "grasp"}] * 2,
            {},
            "phases\\[1\\].gripper = 'magnet': .*it holds something already",
        ),
        (
            [{"kind": "release"}],
            {},
            "phases\\[0\\].gripper = 'magnet': .*it holds nothing",
        ),
        (
            [{"kind": "grasp"}],
            {"kind": "hook"},
            "must be a gripper without a command of its own",
        ),
        (
            [{"kind": "grasp"}],
            {"closed": 0},
            "must be a gripper without a command of its own",
        ),
    ],
)
def test_phases_that_a_gripper_cannot_follow_are_refused_in_one_line(
    phases, gripper, words
):
    with pytest.raises(skyarm.ScenarioError, match=words) as caught:
        scenario_from(handled(*phases, **gripper))
    assert "\n" not in str(caught.value)


@pytest.mark.thorough
def test_where_phases_wait_a_gripper_closes_when_they_come_to_it():
    """The guard holds the reference for 0.1 s: the tip is never within a nanometre of
    its goal.
    """
    waits = {"kind": "grasp", "until": {"error": 1e-12, "timeout": 0.1}}
    flown = [
        skyarm.run(scenario_from(handled(each))) for each in (waits, {"kind": "grasp"})
    ]
    starts = [log.grasp_periods[0].start for log in flown]
    assert starts == pytest.approx([0.15, 0.05], abs=0.0051)


def resting(**numbers):
    """The example's table and an object on it, 5 mm above."""
    found = copy.deepcopy(DOCUMENT) | {"duration": 0.1}
    found["reference"]["tip"]["path"]["phases"] = [{"kind": "hold", "duration": 1.0}]
    found["world"]["objects"][0] |= {"position": [0.2, 0.0, 0.785]} | numbers
    return found


@pytest.mark.parametrize(
    "numbers",
    sampled(
        [
            {"com": [0.01, -0.02, 0.0]},
            {"shape": "sphere", "size": [0.03]},
            {"shape": "cylinder", "size": [0.03, 0.06]},
            {
                "shape": "cylinder",
                "size": [0.03, 0.06],
                "angles": [1.5707963267948966, 0.0, 0.3],
            },
            {"angles": [0.0, 0.0, 0.5], "mass": 2.0},
            {},
        ],
        every=3,
    ),
)
def test_an_object_that_is_standing_begins_as_its_weight_presses_it(numbers):
    """Nothing accelerates: the sum of what the table does is the weight, without a
    moment.
    """
    scenario = scenario_from(resting(**numbers))
    body, memory = scenario.world.objects[0], scenario.world.start(0.005, ())
    motion = PointMotion(scenario.plant.vehicle, first_state(scenario), gravity=9.81)
    rates = scenario.world.slope(memory, 0.0, motion, ()).carried[0]
    assert [*rates.velocity] == pytest.approx([0.0] * 3, abs=1e-8)
    assert [*rates.rate] == pytest.approx([0.0] * 3, abs=1e-5)
    pressed = 0.785 - float(body.position.z)
    assert 0.005 < pressed < 0.0065


def test_one_that_stands_already_stays_where_it_is():
    from skyarm.world.contact.static_equilibrium import with_standing_objects

    contact = scenario_from(resting()).world
    assert with_standing_objects(contact, 9.81) == contact


def test_one_that_begins_a_little_inside_is_lifted_first():
    above, inside = (
        scenario_from(resting(position=[0.2, 0.0, z])).world.objects[0]
        for z in (0.785, 0.7791)
    )
    assert float(inside.position.z) == pytest.approx(float(above.position.z), abs=1e-12)


def test_a_plate_stands_on_the_corners_of_a_smaller_box():
    from skyarm.world.contact.static_equilibrium import with_standing_objects

    box = FreeObject(
        name="box", size=(0.1, 0.1, 0.1), mass=0.5, position=Vec3(0.0, 0.0, 0.05)
    )
    plate = FreeObject(
        name="plate",
        size=(0.3, 0.3, 0.01),
        mass=0.2,
        standing=True,
        position=Vec3(0.01, 0.02, 0.12),
    )
    contact = Contact(surfaces=(Surface(name="ground"),), objects=(box, plate))
    settled = with_standing_objects(contact, 9.8).objects[1]
    weight, tilting = 0.2 * 9.8, 4.0 * 5000.0 * 0.05**2
    assert float(settled.angles.x) == pytest.approx(-0.02 * weight / tilting, rel=0.01)
    assert float(settled.angles.y) == pytest.approx(0.01 * weight / tilting, rel=0.01)
    sunk = weight / 20000.0 + (0.02**2 + 0.01**2) * weight / tilting
    assert float(settled.position.z) == pytest.approx(0.105 - sunk, abs=1e-6)
    again = with_standing_objects(
        dataclasses.replace(contact, objects=(box, settled)), 9.8
    )
    assert again.objects[1] == settled


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        (
            {"position": [0.2, 1.0, 0.8]},
            (
                r"world.objects\[0\].standing = true: must be above a surface; nothing"
                r" carries"
            ),
        ),
        ({"position": [0.2, 0.0, 0.75]}, "must begin outside of what carries it"),
        ({"angles": [0.5, 0.3, 0.0], "position": [0.2, 0.0, 0.85]}, "it tips over"),
        (
            {"standing": False, "position": [0.2, 0.0, 0.77]},
            "'box' starts .* m inside 'table'",
        ),
        ({"standing": 3}, r"world.objects\[0\].standing = 3: must be true or false"),
        ({"mass": "heavy"}, r"world.objects\[0\].mass = 'heavy'"),
        ({"mass": -1.0}, r"world.objects\[0\].mass = -1.0: must be above 0"),
        ({"mass": float("nan")}, r"world.objects\[0\]"),
        ({"colour": "red"}, r"world.objects\[0\].colour = 'red': unknown field"),
        ({"mass": 1e-12}, "world: the mass of 'box' asks for integration steps of"),
        (
            {"mass": 1e3},
            r"world.objects\[0\].mass = 1000.0: must be about 48 kg or less",
        ),
        ({"name": "table"}, "world.objects: name = 'table': must be of one only"),
        ({"size": 0.06}, r"world.objects\[0\].size = 0.06"),
    ],
)
def test_objects_that_cannot_be_are_refused_in_one_line(numbers, words):
    with pytest.raises(skyarm.ScenarioError, match=words) as caught:
        scenario_from(resting(**numbers))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ({"frame": "claw"}, r"world.grippers\[0\].frame = 'claw': .*no frame 'claw'"),
        ({"kind": "glue"}, r"^world.grippers\[0\].kind = 'glue': must be one of"),
        ({"closed": "yes"}, r"world.grippers\[0\].closed = 'yes'"),
        ({"closed": {"kind": "wave"}}, r"world.grippers\[0\].closed.kind = 'wave'"),
        ({"name": ""}, r"^world.grippers\[0\].name = '': must not be empty"),
        (
            {"radius": 1e308},
            r"^world.grippers\[0\].radius = 1e\+308: must be at most 1e\+07",
        ),
        ({"reach": -1.0}, r"grippers\[0\].reach = -1.0: must be above 0"),
        ({"name": "box"}, "world.grippers: name = 'box': must be of one only"),
        ({"stiffness": 1e11}, "world: gripper 'magnet' asks for integration steps of"),
    ],
)
def test_grippers_that_cannot_be_are_refused_in_one_line(numbers, words):
    found = resting()
    found["world"]["grippers"][0] |= numbers
    with pytest.raises(skyarm.ScenarioError, match=words) as caught:
        scenario_from(found)
    assert "\n" not in str(caught.value)


def test_weightless_objects_do_not_stand():
    found = resting()
    found["plant"]["gravity"] = 0.0
    with pytest.raises(
        skyarm.ScenarioError,
        match=r"world.objects\[0\].standing = true: .*gravity leaves no weight",
    ):
        scenario_from(found)


def test_an_object_that_nothing_can_touch_asks_for_no_steps():
    alone = {
        "name": "alone",
        "duration": 0.1,
        "plant": {"vehicle": "hummingbird"},
        "controller": {"preset": "rotors_sim_hummingbird"},
        "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}},
        "world": {
            "objects": [
                {
                    "name": "box",
                    "size": [0.1] * 3,
                    "mass": 0.1,
                    "position": [1.0, 0.0, 1.0],
                }
            ]
        },
    }
    assert part_warnings(scenario_from(alone)) == ()


def test_what_asks_for_short_steps_is_named():
    assert part_warnings(scenario_from(resting(mass=0.5))) == ()
    # 0.8 ms in place of 1 ms are not worth a line
    assert part_warnings(scenario_from(DOCUMENT)) == ()
    light = scenario_from(resting(mass=0.005))
    assert [
        divisions(0.005, float(each.world.largest_step))
        for each in (scenario_from(resting()), light)
    ] == [7, 22]
    (told,) = part_warnings(light)
    assert (
        "the mass of 'box' asks for integration steps of 0.24 ms in contact; they are"
        " taken by themselves" in told
    )
    assert "about 4 in place of each" in told
    found = resting()
    found["world"]["grippers"][0]["stiffness"] = 5e4
    (told,) = part_warnings(scenario_from(found))
    assert "gripper 'magnet' asks for integration steps of 0.36 ms" in told


def test_the_semi_implicit_method_neither_heats_nor_holds_back_what_lies_there():
    """Explicit, a box on a frictionless ground of this stiffness gains 10 % of its
    speed each step of 1 ms.
    """
    contact = Contact(
        surfaces=(Surface(name="ground"),),
        objects=(
            FreeObject(
                name="box",
                size=(0.1, 0.1, 0.1),
                mass=0.1,
                position=Vec3(0.0, 0.0, 0.05),
            ),
        ),
    )
    spinning = with_object(
        contact, position=Vec3(0.0, 0.0, 2.0), angular_velocity=Vec3(0.0, 0.0, 10.0)
    )
    scene = Scene(contact, integrator="euler")
    _, rests = scene.fly(contact, 0.2)
    assert np.abs(rests[-10:, 0, 2] - 0.05 + 4.9e-5).max() < 6e-5
    _, falls = scene.fly(spinning, 0.1)
    assert falls[-1, 0, 2] == pytest.approx(2.0 - 0.5 * 9.8 * 0.01, abs=6e-4)
    assert 2.0 * np.arctan2(falls[-1, 0, 6], falls[-1, 0, 3]) == pytest.approx(
        1.0, abs=1e-6
    )
    assert float(BIRD.mass) > 0.0


@pytest.mark.parametrize("integrator", ["rk4", "euler"])
def test_on_both_plants_a_ball_rolls_and_falls_the_same(integrator):
    """With the first method one takes Verlet's steps and one Runge-Kutta's, of 1 ms
    both; with the second the same.
    """
    ball = FreeObject(
        name="ball",
        shape="sphere",
        size=(0.05,),
        mass=0.1,
        position=Vec3(0.0, 0.0, 0.06),
        velocity=Vec3(0.3, 0.0, -0.1),
    )
    contact = Contact(surfaces=(Surface(name="ground"),), points=(), objects=(ball,))
    ours, theirs = (
        Scene(contact, kind=kind, integrator=integrator).fly(contact, 0.1)[1]
        for kind in (RigidBodyPlant, MujocoPlant)
    )
    assert ours[-1, 0, 11] > 1.0, "it touched"
    if integrator == "euler":
        assert theirs == pytest.approx(ours, abs=1e-12)
    assert theirs[-1, 0, :10] == pytest.approx(ours[-1, 0, :10], abs=6e-3)


@pytest.mark.thorough
def test_the_example_carries_its_box_to_the_place():
    log = skyarm.run(skyarm.load_scenario(EXAMPLE))
    assert log.status == "completed"
    assert log.object_position[-1, :2] == pytest.approx([0.6, 0.0], abs=0.01)
    assert log.object_position[-1, 2] == pytest.approx(0.77995, abs=2e-5)
    (grasp,) = log.grasp_periods
    assert not grasp.gave_way
    assert grasp.end is not None


def test_a_default_step_ends_where_fine_ones_end_one_second_after_a_hit():
    """A cylinder that tumbles on the ground at 1 m/s: within 1 mm, and finer steps are
    nearer.
    """
    thrown = FreeObject(
        name="it",
        shape="cylinder",
        size=(0.04, 0.1),
        mass=0.2,
        position=Vec3(0.0, 0.0, 0.15),
        angles=Vec3(0.4, 0.9, 0.0),
        velocity=Vec3(0.5, -0.3, -1.0),
        angular_velocity=Vec3(3.0, -2.0, 4.0),
    )
    ends = []
    for steps in (3, 12, 48):
        contact = Contact(
            surfaces=(Surface(name="ground"),), objects=(thrown,), hit_steps=steps
        )
        _, rows = Scene(contact).fly(contact, 1.1)
        ends.append(rows[:, 0, :3])
    assert np.abs(ends[1] - ends[2]).max() < 1e-3
    coarse, default = (np.abs(each - ends[-1])[:50].max() for each in ends[:2])
    assert Contact().hit_steps == 12
    assert 1e-8 < default < 0.25 * coarse
    assert ends[-1][-1, 2] < 0.11, "it hit"
