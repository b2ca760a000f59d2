"""Mechanisms that are pushed in flight: both plants, every engine, logs, files and what
they refuse; the examples.
"""

from __future__ import annotations

import copy
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.dynamics.point_motion import PointMotion
from skyarm.log.log_columns import columns
from skyarm.log.periods import contact_pairs
from skyarm.plant.surroundings import Surroundings
from skyarm.records.leaves import leaves, rebuild
from skyarm.scenario.scenario_file import scenario_from
from skyarm.simulate.loop import run_in_python
from skyarm.world.contact import Contact, Gripper, Mechanism
from support.worlds import at_rest, fall, limp, states

EXAMPLES = Path(__file__).parents[3] / "examples"
FRICTION = "world.mechanisms.button.friction"


@pytest.fixture(scope="module")
def push():
    """The tip is led against a light button 0.1 s after the start, by a cheap law, and
    pushes it in.
    """
    found = tomllib.loads((EXAMPLES / "push_a_button.toml").read_text(encoding="utf-8"))
    found |= {"duration": 0.5, "controller": {"preset": "paper_ct"}}
    del found["reference"]["push"]
    found["reference"]["base"]["x"] = {
        "kind": "sequence",
        "start": 0.0,
        "segments": [[0.25, 0.05]],
    }
    (button,) = found["world"]["mechanisms"]
    button["position"][0] = 0.2125
    button |= {
        "friction": 0.05,
        "stiffness": 20.0,
        "detent": {"force": 0.2, "place": 0.001, "width": 0.002},
    }
    button["parts"] = [
        {
            "name": "rim",
            "shape": "sphere",
            "size": [0.002],
            "position": [0.0, 0.03, 0.0],
        }
    ]
    return found


@pytest.fixture(scope="module")
def pushed(push):
    return skyarm.run(scenario_from(push))


def test_a_button_goes_in_as_far_as_what_pushes_it_and_the_log_says_so(pushed):
    assert pushed.status == "completed"
    way, rate = pushed.mechanism_position[:, 0], pushed.mechanism_rate[:, 0]
    assert way.max() > 0.003, "past its click"
    touched = pushed.contact_force[:, 1] > 0.05
    depth = pushed.contact_depth[:, 1]
    # its front is at 0.2125 m: the tip stands as deep in it as the log says
    assert pushed.tip[touched, 0] - 0.2125 == pytest.approx(
        way[touched] + depth[touched], abs=1e-6
    )
    assert np.gradient(way, pushed.time)[5:-5] == pytest.approx(rate[5:-5], abs=0.05)
    names = {
        each.name: each.unit
        for each in columns(pushed)
        if each.name.startswith(("mechanism", "contact_f"))
    }
    assert names == {
        "contact_force_wall_tip": "N",
        "contact_force_button_tip": "N",
        "contact_force_rim_tip": "N",
        "contact_friction_wall_tip": "N",
        "contact_friction_button_tip": "N",
        "contact_friction_rim_tip": "N",
        "mechanism_position_button": "m",
        "mechanism_rate_button": "m/s",
    }
    assert contact_pairs(pushed) == (("wall", "tip"), ("button", "tip"), ("rim", "tip"))


def test_files_keep_what_a_mechanism_did_and_give_its_scenario_back(pushed, tmp_path):
    again = skyarm.load_log(pushed.save_npz(tmp_path / "a.npz"))
    assert np.array_equal(again.mechanism_position, pushed.mechanism_position)
    assert again.scenario.world == pushed.scenario.world


def test_both_plants_push_the_same(push, pushed):
    theirs = skyarm.run(scenario_from(push, replaced={"plant": "mujoco"}))
    assert np.abs(theirs.mechanism_position - pushed.mechanism_position).max() < 5e-5
    assert np.abs(theirs.position - pushed.position).max() < 5e-5


def test_python_floats_push_the_same_bits(push, pushed):
    slow = run_in_python(scenario_from({**push, "duration": 0.4}))
    assert np.array_equal(slow.mechanism_position, pushed.mechanism_position[:80])
    assert np.array_equal(slow.position, pushed.position[:80])
    assert slow.mechanism_position.max() > 1e-3


@pytest.mark.thorough
def test_every_lane_of_a_batch_pushes_the_bits_of_a_session(push):
    short, values = scenario_from({**push, "duration": 0.4}), np.array([0.02, 0.05])
    batch = skyarm.Batch(short, [FRICTION], bit_exact=True, effort=0)
    x, z = (
        getattr(batch.fly({FRICTION: values}).state.velocity, axis) for axis in "xz"
    )
    single = skyarm.Session(short)
    while single.running:
        single.step()
    assert (x[1], z[1]) == (single.state.velocity.x, single.state.velocity.z)
    assert x[0] != x[1]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"kind": "gate"}, "kind = 'gate': must be one of hinge"),
        ({"name": "wall"}, "world.mechanisms: name = 'wall': must be of one only"),
        (
            {"parts": [{"name": "button", "shape": "sphere", "size": [1]}]},
            "name = 'button': must be of one only",
        ),
        ({"detent": {"force": 1.0, "width": 0.0}}, "width = 0.0: must be above 0"),
        ({"detent": {"width": 0.1}}, "force: is missing"),
        ({"weight": 1.0}, "weight = 1.0: unknown field"),
        (
            {
                "parts": [
                    {
                        "name": "p",
                        "shape": "sphere",
                        "size": [1],
                        "motion": [
                            0,
                            0,
                            {"kind": "sine", "amplitude": 1, "frequency_hz": 1},
                        ],
                    }
                ]
            },
            "motion: must be left out",
        ),
        (
            {"stop_stiffness": 1e11},
            "world: mechanism 'button' asks for integration steps of",
        ),
        ({"friction": 1e9}, "world: mechanism 'button' asks for integration steps of"),
        (
            {"kind": "door", "size": [0.8, 2.0, 0.04], "mass": 0.0},
            "mass: is missing; a door must have one above 0, or an",
        ),
        (
            {
                "kind": "hinge",
                "axis": [0, 0, 1],
                "size": [],
                "mass": 0.0,
                "inertia": 1.0,
                "parts": [{"name": "p", "shape": "sphere", "size": [1e300]}],
            },
            r"parts\[0\].size\[0\] = 1e\+300: must be at most 1e\+07",
        ),
        ({"mass": 1e-12}, "world: the mass of 'button' asks for integration steps of"),
        (
            {"position": [0.2, 0.0, 0.83]},
            "point 'tip' starts .* inside 'button'.* must start outside$",
        ),
        (
            {"kind": "slide", "axis": [0, 0, 1], "size": [], "parts": []},
            r"mechanisms\[0\].parts: is missing; nothing of",
        ),
        ({"upper": -1.0}, "lower = 0.0: must be below upper = -1.0"),
    ],
)
def test_mechanisms_that_cannot_be_are_refused_in_one_line(push, change, words):
    found = copy.deepcopy(push)
    found["world"]["mechanisms"][0] |= change
    with pytest.raises(skyarm.ScenarioError, match=words) as error:
        scenario_from(found)
    assert "\n" not in str(error.value)


@pytest.mark.thorough
def test_the_examples_fly_as_their_first_lines_say():
    door = skyarm.run(skyarm.load_scenario(EXAMPLES / "push_a_door.toml"))
    angle, pushing = (
        door.mechanism_position[:, 0],
        (door.time > 2.0) & (door.time < 7.0),
    )
    assert door.status == "completed"
    assert angle.max() == pytest.approx(0.7, abs=0.01)
    assert door.contact_force[pushing, 0].mean() == pytest.approx(1.0, abs=0.06)
    assert angle[-1] < 0.65, "its closer draws it back"
    button = skyarm.run(skyarm.load_scenario(EXAMPLES / "push_a_button.toml"))
    way = button.mechanism_position[:, 0]
    held = (button.time > 2.0) & (button.time < 4.0)
    assert (button.status, np.median(way[held])) == (
        "completed",
        pytest.approx(0.005, abs=2.5e-4),
    )
    assert way.max() < 0.0056, (
        "the click lets it go, and the stop gives way by half a millimetre"
    )
    assert way[-100:] == pytest.approx(np.zeros(100), abs=2e-4)
    assert button.contact_force[:, 0].max() == 0.0, "the wall was not touched"


def test_the_chamfer_of_the_example_leads_its_peg_into_the_hole():
    """In the posture of the flight the rim lies level, and it is the chamfer that moves
    the tip, before the bottom.
    """
    log = skyarm.run(skyarm.load_scenario(EXAMPLES / "insert_a_peg.toml", duration=5.0))
    (plate,) = log.scenario.world.surfaces
    _, depth, chamfer, *_ = plate.size
    mouth = plate.position.z
    on_chamfer = (log.contact_force > 0.01).any(axis=1) & (
        log.tip[:, 2] > mouth - chamfer
    )
    assert on_chamfer.sum() > 3
    assert abs(log.tip[: on_chamfer.argmax(), 1]).max() < 1e-4, (
        "1.5 mm beside the hole's axis"
    )
    inside = (log.tip[:, 2] < mouth - chamfer) & (log.tip[:, 2] > mouth - 0.9 * depth)
    assert log.tip[inside, 1].min() > 3e-4, "within the 1 mm of clearance"
    assert log.tip[-1, 2] == pytest.approx(mouth - depth, abs=1e-3)
    assert ((log.contact_force[-1] > 0.01).sum(), log.status) == (
        pytest.approx(3, abs=1),
        "completed",
    )


@pytest.mark.parametrize(
    "kind", [pytest.param("drawer", marks=pytest.mark.thorough), "valve"]
)
def test_a_gripper_on_a_handle_moves_the_mechanism_and_is_moved_by_it(kind):
    """A limp vehicle without weight that flies off with a handle: momentum along the
    slide, or about the hinge.
    """
    bird = limp("hummingbird_arm2_rotors")
    start = at_rest(bird, (0.0, 0.0, 0.0), (-0.45, -0.9), velocity=Vec3(0.2, 0.0, 0.0))
    tip = PointMotion(bird, start).position(*bird_tip(bird))
    lever = 0.15 if kind == "valve" else 0.0
    place = Vec3(float(tip.x), float(tip.y) + lever, float(tip.z))
    size, angles = (
        ((0.3, 0.2, 0.1), (0.0, 0.0, 0.0))
        if lever == 0.0
        else ((0.15, 0.02, 0.02), (0.0, 0.0, -math.pi / 2))
    )
    handled = Mechanism(
        name="m", kind=kind, size=size, position=place, angles=angles, mass=0.6
    )
    contact = Contact(
        mechanisms=(handled,),
        grippers=(Gripper(name="ball", kind="ball", stiffness=4000.0, force=99.0),),
    )
    motion = PointMotion(bird, start)
    memory = contact.act(contact.start(0.005, ()), 0.0, 0.005, motion)
    assert float(memory.grips[0].taken) == 1.0
    around = Surroundings(components=(contact,), memories=(memory,))
    rows = fall(bird, start, around, 0.3, gravity=0.0)
    found = states(start, rows)
    held = [
        rebuild(memory, iter(row[len(leaves(start)) :].tolist())).carried[0]
        for row in rows
    ]

    def momentum(state, coordinate, rate):
        return (
            axis_momentum(bird, state, place, lever)
            + handled.generalized_inertia * rate
        )

    before, after = (
        momentum(start, 0.0, 0.0),
        [momentum(s, h.coordinate, h.rate) for s, h in zip(found, held, strict=True)],
    )
    assert after == pytest.approx([before] * len(after), rel=2e-4)
    assert held[-1].rate > 0.02, "it is pulled along"
    grip = contact.gripping.frames(PointMotion(bird, found[-1]))[0].position
    handle = handled.frame(held[-1]).position + handled.frame(held[-1]).rotation.apply(
        Vec3(lever, 0.0, 0.0)
    )
    assert [*grip] == pytest.approx([*handle], abs=2e-3)


def bird_tip(bird):
    tip = bird.frame()
    return tip.position, tip.link


def axis_momentum(bird, state, place, lever):
    """Of the vehicle along x, or about a z axis through a place, as the sum over its
    bodies.
    """
    motion, total = PointMotion(bird, state), 0.0
    for index, body in [
        (-1, bird.base),
        *((i, link.body) for i, link in enumerate(bird.links)),
    ]:
        middle, velocity = (
            motion.position(body.com, index),
            motion.velocity(body.com, index),
        )
        if lever == 0.0:
            total += float(body.mass) * float(velocity.x)
        else:
            spin = motion.to_world(
                body.inertia.apply(motion.angular_velocity(index)), index
            ).z
            total += float(body.mass) * float(
                (middle - place).cross(velocity).z
            ) + float(spin)
    return total
