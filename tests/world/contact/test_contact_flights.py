"""Flights that touch: both plants, engines, logs, endings, starts at rest, files and
what they refuse.
"""

from __future__ import annotations

import copy
import dataclasses
import tomllib
from pathlib import Path

import numpy as np
import pytest

import skyarm
from skyarm.log.log_columns import columns
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.unlikely_numbers import part_warnings
from skyarm.simulate.first_state import first_loop_state, first_surroundings
from skyarm.simulate.loop import run_in_python

EXAMPLES = Path(__file__).parents[3] / "examples"


def document(name):
    return tomllib.loads((EXAMPLES / f"{name}.toml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def press():
    """The tip meets the wall 0.2 s after the start."""
    found = document("press_a_wall")
    found["duration"] = 0.6
    found["controller"]["preset"] = "paper_ct"  # half the time of the example's law
    found["reference"]["base"]["x"] = {
        "kind": "sequence",
        "start": 0.0,
        "segments": [[0.3, 0.03]],
    }
    found["world"]["surfaces"][0]["position"][0] = 0.263
    return found


@pytest.fixture(scope="module")
def pressed(press):
    return skyarm.run(scenario_from(press))


def test_the_tip_is_stopped_by_the_wall_and_the_log_says_how_strongly(pressed):
    assert pressed.status == "completed"
    force, friction, depth = (
        pressed.contact_force[:, 0],
        pressed.contact_friction[:, 0],
        pressed.contact_depth[:, 0],
    )
    assert 1.0 < force.max() < 20.0
    assert depth == pytest.approx(np.maximum(pressed.tip[:, 0] - 0.213, 0.0), abs=1e-9)
    still = (depth > 1e-4) & (
        np.abs(np.gradient(pressed.tip[:, 0], pressed.time)) < 0.01
    )
    assert still.sum() > 5
    assert force[still] == pytest.approx(5000.0 * depth[still], rel=0.03)
    assert (friction <= 0.3 * force + 1e-12).all()
    assert friction.max() > 0.1
    assert (force[depth == 0.0] < 0.1).all()
    assert np.abs(pressed.wind_force).max() == 0.0, "contact is no wind"


def test_far_from_every_surface_a_flight_has_the_bits_and_the_steps_of_a_free_one(
    press,
):
    away = copy.deepcopy(press) | {"duration": 0.3}
    away["world"]["surfaces"][0]["position"][0] = 0.5
    scenario = scenario_from(away)
    near, free = (
        skyarm.run(scenario),
        skyarm.run(dataclasses.replace(scenario, world=None)),
    )
    assert np.array_equal(near.position, free.position)
    assert np.array_equal(near.joints, free.joints)
    around = first_surroundings(scenario, first_loop_state(scenario))
    steps = RigidBodyPlant(scenario.plant, around).substeps(0.005)
    assert steps[:6] == (4, 1, 3, True, scenario.world.hit_steps, 0)


def test_columns_are_named_by_surface_and_point_and_files_keep_them(pressed, tmp_path):
    named = {each.name: each for each in columns(pressed)}
    for word, unit in (("force", "N"), ("friction", "N"), ("depth", "m")):
        assert named[f"contact_{word}_wall_tip"].unit == unit
    again = skyarm.load_log(pressed.save_npz(tmp_path / "a.npz"))
    assert np.array_equal(again.contact_force, pressed.contact_force)
    assert again.scenario.world == pressed.scenario.world


def test_both_plants_fly_the_same(press, pressed):
    """To 20 um and 150 mN after touches of 0.2 s: steps of 1.25 ms of Verlet's method,
    1 ms of Runge-Kutta's.
    """
    theirs = skyarm.run(scenario_from(press, replaced={"plant": "mujoco"}))
    assert np.abs(theirs.position - pressed.position).max() < 2e-5
    assert theirs.contact_force[-20:] == pytest.approx(
        pressed.contact_force[-20:], abs=0.15
    )


def test_python_floats_and_every_lane_of_a_batch_fly_the_same_bits(press, pressed):
    short, stiffness = (
        scenario_from({**press, "duration": 0.45}),
        "world.surfaces.wall.material.stiffness",
    )
    slow = run_in_python(short)
    assert np.array_equal(slow.contact_force, pressed.contact_force[:90])
    assert np.array_equal(slow.position, pressed.position[:90])
    assert slow.contact_force.max() > 0.5
    values = np.array([3000.0, 5000.0])
    batch = skyarm.Batch(short, [stiffness], bit_exact=True, effort=0)
    x, z = (
        getattr(batch.fly({stiffness: values}).state.velocity, axis) for axis in "xz"
    )
    assert x[0] != x[1]
    single = skyarm.Session(short)
    while single.running:
        single.step()
    assert (x[1], z[1]) == (single.state.velocity.x, single.state.velocity.z)


def test_a_lane_that_is_too_stiff_for_the_steps_is_refused(press):
    path = "world.surfaces.wall.material.stiffness"
    words = r"stiffness.* = 50000: requires steps of .* compile it from a scenario"
    batch = skyarm.Batch(scenario_from({**press, "duration": 0.01}), [path], effort=0)
    with pytest.raises(ValueError, match=words):
        batch.fly({path: np.array([5000.0, 5e4])})


def test_a_log_of_contact_gives_the_scenario_back_and_a_session_continues_from_it(
    press, pressed
):
    session = skyarm.Session(scenario_from(press))
    for _ in range(80):
        session.step()
    held = session.snapshot()
    for _ in range(10):
        session.step()
    first = session.state
    session.restore(held)
    for _ in range(10):
        session.step()
    assert session.state == first
    assert np.array_equal(session.log.contact_force, pressed.contact_force[:90])


def test_a_rotor_that_comes_to_a_wall_ends_the_flight_with_its_cause(press):
    near = copy.deepcopy(press)
    near["world"]["surfaces"][0] |= {
        "size": [0.1, 2.0, 3.0],
        "position": [0.2716 + 0.06, 0.0, 0.45],
    }
    log = skyarm.run(scenario_from(near))
    assert log.status == "rotor_contact"
    assert log.info["cause"] == "rotor 'front' touched surface 'wall'"
    assert log.position[-1, 0] == pytest.approx(0.2816 - 0.27, abs=2e-3)
    near["world"]["rotor_radius"] = 0.0
    near["duration"] = 0.1
    assert skyarm.run(scenario_from(near)).status == "completed"


@pytest.mark.thorough
def test_lanes_of_a_batch_say_which_of_them_touched_with_a_rotor(press):
    near = copy.deepcopy(press)
    near["world"]["surfaces"][0] |= {
        "size": [0.1, 2.0, 3.0],
        "position": [0.2716 + 0.06, 0.0, 0.45],
    }
    near["duration"] = 0.5
    radii = np.array([0.05, 0.1, 0.08])
    batch = skyarm.Batch(scenario_from(near), ["world.rotor_radius"], effort=0)
    flown = batch.fly({"world.rotor_radius": radii})
    assert flown.status.tolist() == ["completed", "rotor_contact", "completed"]
    assert flown.end_time[1] == skyarm.run(scenario_from(near)).info["end_time"]


@pytest.mark.thorough
def test_a_base_that_comes_into_a_surface_ends_the_flight(press):
    ball = {
        "name": "ball",
        "shape": "sphere",
        "size": [0.02],
        "position": [0.025, 0.0, 1.0],
    }
    found = {**press, "world": {"surfaces": [ball]}, "duration": 0.4}
    log = skyarm.run(scenario_from(found))
    assert (log.status, log.info["cause"]) == (
        "body_contact",
        "the base is inside surface 'ball'",
    )


@pytest.fixture(scope="module")
def landing():
    found = document("land_on_skids")
    found["duration"] = 0.5
    return found


def test_what_stands_at_rest_does_not_jump(landing):
    """With a law that gives nothing its joints would move: the bodies' motion of the
    first 20 ms is looked at.
    """
    scenario = scenario_from(landing)
    weight = float(scenario.plant.vehicle.mass) * float(scenario.plant.gravity)
    log = skyarm.run(
        scenario_from({**landing, "duration": 0.05, "delays": {"command": 0.05}})
    )
    assert log.contact_force[0].sum() == pytest.approx(weight, rel=1e-9)
    assert [*log.position[0, :2], log.euler[0, 2]] == pytest.approx(
        [0.0] * 3, abs=1e-12
    )
    assert (log.contact_force[0] > 0.0).all()
    assert np.abs(log.velocity).max() < 2e-4
    assert log.contact_force.sum(axis=1) == pytest.approx(
        np.full(len(log.time), weight), rel=5e-3
    )


@pytest.mark.thorough
def test_beside_turbulence_and_a_payload_every_engine_keeps_what_contact_remembers(
    landing,
):
    """Memories of other components stand before and behind the contact's: floats,
    machine code and MuJoCo.
    """
    wind = {
        "mode": "moving_air",
        "velocity": [2, 0, 0],
        "turbulence": {"altitude": 6, "wind_20ft": 4},
    }
    load = {"name": "a", "mass": 0.02, "pick": 0.02, "kind": "hanging"}
    found = scenario_from(
        {**landing, "duration": 0.1, "environment": {"wind": wind}, "payloads": [load]}
    )
    quick, slow = skyarm.run(found), run_in_python(found)
    assert np.array_equal(quick.contact_friction, slow.contact_friction)
    assert np.array_equal(quick.position, slow.position)
    theirs = skyarm.run(dataclasses.replace(found, kind="mujoco"))
    assert quick.contact_friction[3:8].max() > 1e-3
    assert theirs.contact_friction[:8] == pytest.approx(
        quick.contact_friction[:8], abs=0.02
    )


def test_the_ground_of_the_world_takes_the_place_of_the_ground_that_ends_a_flight(
    landing,
):
    standing = {**landing, "duration": 0.05}
    assert skyarm.run(scenario_from(standing)).status == "completed"
    low = copy.deepcopy(standing)
    low["initial"] = {"position": [0.0, 0.0, 0.01]}
    low["world"] = {
        "surfaces": [
            {"name": "wall", "shape": "box", "size": [1, 1, 1], "position": [9, 0, 0]}
        ]
    }
    assert skyarm.run(scenario_from(low)).status == "ground", "a wall is no ground"


@pytest.mark.thorough
def test_the_examples_fly_as_their_first_lines_say():
    landed = skyarm.run(skyarm.load_scenario(EXAMPLES / "land_on_skids.toml"))
    assert landed.status == "completed"
    assert landed.contact_force[800].max() == 0.0 < landed.contact_force[0].min()
    assert landed.position[800, 2] > 0.5
    assert (landed.contact_force[-100:].sum(axis=1) > 0.0).mean() > 0.5
    pressed = skyarm.run(skyarm.load_scenario(EXAMPLES / "press_a_wall.toml"))
    assert (pressed.status, pressed.info["cause"]) == (
        "rotor_contact",
        "rotor 'front' touched surface 'wall'",
    )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"surfaces": []}, "world.surfaces: is missing"),
        (
            {"points": [{"name": "p", "body": "wing"}]},
            r"world.points\[0\].body = 'wing': must be one of base, link1, link2",
        ),
        (
            {"points": [{"name": "p", "frame": "nose"}]},
            r"world.points\[0\].frame = 'nose': .*no frame 'nose'",
        ),
        ({"points": [{"name": "p"}]}, r"world.points\[0\].body: is missing"),
        (
            {"points": [{"name": "p", "body": "base"}] * 2},
            "world.points: name = 'p': must be of one only",
        ),
        (
            {"points": [{"name": "p", "body": "base", "radius": -0.1}]},
            "radius = -0.1: must be at least 0",
        ),
        ({"gravity": 3}, "world.gravity = 3: unknown field"),
        (
            {"surfaces": [{"name": "g", "material": {"stiffness": -1.0}}]},
            "stiffness = -1.0: must be above 0",
        ),
        (
            {"surfaces": [{"name": "g", "material": {"friction": -1.0}}]},
            "friction = -1.0: must be at least 0",
        ),
        ({"surfaces": [{"name": "g", "shape": "box"}]}, "size = .*must be 3 numbers"),
        (
            {"surfaces": [{"name": "g", "motion": [0, 0]}]},
            "motion = .*must be a list of three signals",
        ),
        (
            {"surfaces": [{"name": "g", "material": {"stiffness": 1e11}}]},
            "the material of surface 'g' asks .* s",
        ),
        (
            {"surfaces": [{"name": "g", "position": [0, 0, 1.2]}]},
            "point 'tip' starts .* inside surface 'g'",
        ),
        (
            {
                "surfaces": [
                    {
                        "name": "g",
                        "shape": "sphere",
                        "size": [0.1],
                        "position": [0.17, 0.0, 1.0],
                    }
                ]
            },
            "rotor 'front' touched surface 'g' at the start: must start outside",
        ),
    ],
)
def test_worlds_that_cannot_be_are_refused_in_one_line(press, change, words):
    with pytest.raises(skyarm.ScenarioError, match=words) as error:
        scenario_from({**press, "world": {**press["world"], "points": [], **change}})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("initial", "words"),
    [
        (
            {"standing": True, "velocity": [1, 0, 0]},
            "initial.velocity: must be left out",
        ),
        ({"standing": 1}, "initial.standing = 1: must be true or false"),
        (
            {"standing": True, "position": [0, 0, -5]},
            "must begin above what it is set down on",
        ),
        (
            {"standing": True, "position": [0, 0, 4]},
            "nothing carries it within 3 m below",
        ),
        ({"standing": True, "joints": [1.5, 0.0]}, "tips over"),
    ],
)
def test_starts_that_cannot_stand_are_refused(landing, initial, words):
    found = copy.deepcopy(landing) | {"initial": initial}
    if "tips over" in words:
        found["world"]["points"] = found["world"]["points"][:1]
    with pytest.raises(skyarm.ScenarioError, match=words):
        scenario_from(found)


def test_without_weight_nothing_stands(landing):
    with pytest.raises(
        skyarm.ScenarioError, match="gravity leaves no weight to stand with"
    ):
        scenario_from({**landing, "plant": {**landing["plant"], "gravity": 0.0}})


def test_standing_needs_a_world(press):
    without = {name: part for name, part in press.items() if name != "world"}
    with pytest.raises(
        skyarm.ScenarioError,
        match=r"initial.standing = true: must be false without a \[world\]",
    ):
        scenario_from({**without, "initial": {"standing": True}})


def test_periods_of_contact_are_read_from_the_log_and_said(pressed, capsys):
    from skyarm.log.flight_summary import facts, sentences

    periods, force = pressed.contact_periods, pressed.contact_force[:, 0]
    assert len(periods) >= 2
    assert all(each.end is not None for each in periods[:-1])
    for each in periods:
        inside = (pressed.time >= each.start) & (pressed.time < (each.end or 9.0))
        assert (force[inside] > 0.0).all()
        assert (each.peak, each.mean) == (force[inside].max(), force[inside].mean())
    assert (
        sum(
            ((pressed.time >= p.start) & (pressed.time < (p.end or 9.0))).sum()
            for p in periods
        )
        == (force > 0).sum()
    )
    (told,) = facts(pressed)["contacts"]
    assert (told["surface"], told["point"], told["peak"]) == (
        "wall",
        "tip",
        force.max(),
    )
    assert told["losses"] == sum(p.end is not None for p in periods)
    (line,) = sentences(facts(pressed))
    assert line.startswith(
        f"wall touched tip at {periods[0].start:g} s: lost {told['losses']} times,"
        " largest force "
    )


def test_steps_shorter_than_the_clock_are_said(press):
    assert part_warnings(scenario_from(press)) == ()
    stiff = copy.deepcopy(press)
    stiff["world"]["surfaces"][0]["material"]["stiffness"] = 1e5
    (told,) = part_warnings(scenario_from(stiff))
    assert (
        "surface 'wall' asks for integration steps of 0.38 ms in contact; they are"
        " taken by themselves" in told
    )
    assert "about 3 in place of each of rates.physics" in told


def test_a_film_shows_what_may_be_touched(pressed):
    from skyarm.view.film.filmed_flight import film_flights
    from skyarm.view.picture.marks import vehicle_solids

    solids = vehicle_solids(film_flights([pressed], pressed.time[::40])[0])
    (wall,) = (solid for solid in solids if solid.shape.role == "surface")
    assert (wall.shape.kind, wall.shape.size) == ("box", (0.05, 1.0, 0.45))
    assert np.array_equal(wall.position, np.tile([0.263, 0.0, 0.45], (3, 1)))
    assert np.array_equal(wall.rotation[1], np.eye(3))
