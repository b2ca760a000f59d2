"""Wrong worlds of tasks in contact: drawn by the seed, kept within the limits of
physics, the same for every law.
"""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np
import pytest

from skyarm.algebra.scalars.philox import uniforms
from skyarm.control.catalogue import make_controller
from skyarm.scenario.controller_table import controller_by_name
from skyarm.studies.compare.contact_suite import ContactSuite, worlds_of
from skyarm.studies.compare.contact_tasks import (
    BEHIND,
    FLAGSHIP,
    FRICTION,
    LOAD,
    MOTION,
    RIVALS,
    TASKS,
    as_positions,
    document_of,
    flies_its_own,
    scenario_of,
)
from skyarm.studies.compare.contact_worlds import (
    CHANNEL,
    MOST_DISCARDED,
    NUMBERS,
    draw_worlds,
    feasible_worlds,
)
from skyarm.studies.compare.perturbed_plants import hardest
from skyarm.world.contact.material import Material
from support.studies import cell_of

COUNT = 60


def contact_flights(laws, tasks, worlds, **more):
    suite = ContactSuite(laws=laws, tasks=tasks, worlds=worlds, **more)
    return suite.plan_cells()[0]


@functools.lru_cache(maxsize=4)
def shipped(name):
    return scenario_of(TASKS[name], FLAGSHIP, noisy=False)


@pytest.fixture(scope="module")
def circle():
    """A task that slides sideways, its worlds by the last words of their paths."""
    worlds = draw_worlds(TASKS["slide_circle"], shipped("slide_circle"), COUNT, seed=3)
    return worlds, {
        path.removeprefix("world.surfaces.wall.material."): x
        for path, x in worlds.values.items()
    }


def test_worlds_stay_within_their_bounds_and_fill_them(circle):
    _, values = circle
    assert 500.0 <= values["stiffness"].min() < 1500.0
    assert 4e4 < values["stiffness"].max() <= 1e5
    assert 2e3 < np.median(values["stiffness"]) < 2e4, (
        "by its logarithm; evenly it would be 5e4"
    )
    assert values["delays.command"].min() >= 0.0
    assert 0.008 < values["delays.command"].max() <= 0.010
    normal = np.stack([values[f"reference.push.normal.{i}"] for i in range(3)])
    assert np.linalg.norm(normal, axis=0) == pytest.approx(np.ones(COUNT))
    wrong = np.degrees(np.arccos(-normal[0]))
    assert 8.0 < wrong.max() <= 10.0
    told = float(shipped("slide_circle").plant.vehicle.rotors[0].thrust_coefficient)
    thrust = values["plant.vehicle.rotors.0.thrust_coefficient"] / told
    assert 0.9 <= thrust.min() < 0.92
    assert 0.98 < thrust.max() <= 1.0


def test_what_physics_forbids_is_discarded(circle):
    """Wind over half of 1 N; friction whose torque at 0.2116 m is over half of the
    rotors' 0.1123 N m.
    """
    worlds, values = circle
    wind = np.sqrt(
        sum(values[f"environment.wind.force_W.{axis}"] ** 2 for axis in "xyz")
    )
    assert 0.4 < wind.max() <= 0.5
    assert values["friction"].max() * 0.2116 <= 0.5 * 0.11233 < 0.28 * 0.2116
    assert worlds.drawn > COUNT
    assert worlds.plain()["discarded"] <= MOST_DISCARDED * worlds.drawn
    task = dataclasses.replace(TASKS["slide_circle"], sideways=False)
    share = uniforms(
        3, np.arange(worlds.drawn), CHANNEL, np.zeros(1, dtype=int), NUMBERS
    ).reshape(-1, NUMBERS)
    friction, blown = 0.1 + 0.18 * share[:, 1], 0.6 * share[:, 2]
    possible = (blown <= 0.5) & (friction * 0.21160333 <= 0.5 * 0.11232733)
    assert int(possible.sum()) == COUNT, (
        "the count discarded is what was drawn and is not possible"
    )
    assert (
        draw_worlds(task, shipped("slide_circle"), COUNT, seed=3).drawn < worlds.drawn
    )


def test_a_task_beyond_the_vehicle_is_refused_in_one_line():
    wide = dataclasses.replace(TASKS["slide_circle"], friction=FRICTION)
    with pytest.raises(
        ValueError,
        match=(
            r"^task slide_circle: \d+ of \d+ worlds are discarded: must be at most"
            r" 30 %$"
        ),
    ):
        draw_worlds(wide, shipped("slide_circle"), COUNT, seed=0)


def test_a_load_or_a_push_beyond_the_joints_is_discarded():
    """The upper arm holds m g 0.2116 and the arm's own weight: from 0.8 of 0.5 N m on,
    no world is kept.
    """
    task, scenario = TASKS["pick_and_carry"], shipped("pick_and_carry")
    mass = np.linspace(0.5, 4.0, 71)
    found = feasible_worlds(
        task,
        scenario,
        {"wind": np.full(71, 2.0), "friction": np.full(71, 0.8), "mass": mass},
    )
    most = 0.1 * mass[found].max()
    arm = 0.5 * 0.8 - most * 9.81 * 0.2116
    assert found[0]
    assert not found[-1]
    assert 0.0 < arm < 0.12, f"{most} kg"
    hard = dataclasses.replace(TASKS["press_and_hold"], push=2.6)
    drawn = {"wind": np.zeros(1), "friction": np.full(1, 0.1)}
    assert not feasible_worlds(hard, shipped("press_and_hold"), drawn).any(), (
        "2.6 N at 0.168 m take 0.44 of 0.5 N m"
    )
    assert feasible_worlds(
        TASKS["press_and_hold"], shipped("press_and_hold"), drawn
    ).all()


def test_the_first_worlds_do_not_depend_on_how_many_fly():
    few, many = (
        draw_worlds(TASKS["open_door"], shipped("open_door"), n, seed=1)
        for n in (4, 12)
    )
    for path, column in few.values.items():
        assert np.array_equal(column, many.values[path][:4])
    place = [few.values[f"world.mechanisms.door.position.{i}"] for i in (0, 1)]
    away = np.stack(place) - np.array([[0.5724], [0.5]])
    assert np.abs(np.cross(np.append(away[:, 0], 0.0), [0.26, 0.5, 0.0])[2]) < 1e-9, (
        "along the closed door"
    )
    assert 0.0 < np.linalg.norm(away, axis=0).max() <= 0.06 * math.hypot(0.26, 0.5)


def test_a_handle_resists_otherwise_on_another_arc_in_another_hand():
    worlds = draw_worlds(TASKS["turn_valve"], shipped("turn_valve"), 40, seed=2)
    values = worlds.values
    assert worlds.plain()["discarded"] == 0
    away = np.stack(
        [values[f"world.mechanisms.valve.position.{i}"] for i in (1, 2)]
    ) - [[-0.106066], [1.163934]]
    assert away[0] == pytest.approx(away[1]), "along the lever"
    assert "world.mechanisms.valve.position.0" not in values
    assert 0.055 < np.hypot(*away).max() / 0.15 <= 0.06
    friction, damping = (
        values[f"world.mechanisms.valve.{name}"] for name in ("friction", "damping")
    )
    for shares in (friction / 0.1, damping / 0.5):
        assert 0.5 <= shares.min() < 0.6
        assert 1.7 < shares.max() <= 2.0
    assert abs(np.corrcoef(np.log(friction), np.log(damping))[0, 1]) < 0.4
    assert "world.mechanisms.valve.stiffness" not in values, "it has no closer"
    assert values["world.grippers.hand.stiffness"].max() > 5e4
    first = contact_flights((FLAGSHIP, MOTION, LOAD), ("turn_valve",), 40, seed=2)
    assert {each.entrant.law for each in first} == {FLAGSHIP, MOTION}
    scenario = first[0].scenario()
    assert hardest(scenario, first[0].values(scenario))[
        "world.grippers.hand.stiffness"
    ] == (values["world.grippers.hand.stiffness"].max())


def test_every_law_meets_the_same_worlds():
    flights = contact_flights(
        (FLAGSHIP, MOTION, "paper_ct"), ("press_and_hold", "perch_on_shelf"), 5
    )
    names = [
        (each.case.name, each.entrant.name, each.condition.name) for each in flights
    ]
    assert ("press_and_hold", MOTION, "noisy") in names
    assert (
        "perch_on_shelf",
        MOTION,
        "noisy",
    ) not in names, "without a push there is no interaction to leave out"
    assert [
        flies_its_own(TASKS[name], LOAD)
        for name in ("pick_and_carry", "press_and_hold")
    ] == [True, False]
    first, *others = [
        each.worlds() for each in flights if each.case.name == "press_and_hold"
    ]
    assert all(each is first for each in others)
    other = worlds_of("press_and_hold", 5, 1).values
    assert other.keys() == first.values.keys()
    assert not np.array_equal(other["delays.command"], first.values["delays.command"])


def test_rivals_that_press_fly_the_task_as_it_is_shipped_with_tuned_gains():
    own = shipped("press_and_hold")
    for law in RIVALS:
        found = scenario_of(TASKS["press_and_hold"], law, noisy=False)
        assert found.controller.name == law
        assert found.controller == controller_by_name(found, f"{law}_tuned")
        assert (
            found.controller.par.gains
            != make_controller(law, found.controller.par.model).par.gains
        )
        assert found.reference == own.reference


def test_a_law_of_positions_is_led_behind_the_surface_and_waits_for_no_force():
    task = TASKS["press_and_hold"]
    path = as_positions(task, document_of(task))["reference"]["tip"]["path"]
    hold, led, press, retreat = path["phases"]
    assert (hold["kind"], led["kind"], press["kind"], retreat["kind"]) == (
        "hold",
        "go_to",
        "press",
        "retreat",
    )
    assert led["position"] == pytest.approx([0.2 + 0.092 + BEHIND, 0.0, 0.83])
    assert set(press["until"]) == {"error", "hold", "timeout", "on_timeout"}
    assert retreat["position"] == [0.2, 0.0, 0.83]
    written = as_positions(TASKS["write_on_wall"], document_of(TASKS["write_on_wall"]))
    points = written["reference"]["tip"]["path"]["phases"][3]["points"]
    assert [point[0] for point in points] == pytest.approx([0.302] * 4)


@pytest.mark.thorough
@pytest.mark.parametrize("task", ["press_and_hold", "pick_and_carry"])
@pytest.mark.parametrize("law", [FLAGSHIP, "paper_ct"])
def test_a_cell_equals_single_flights(task, law):
    flights = next(
        each for each in contact_flights((law,), (task,), 2) if each.condition.noisy
    )
    cell = cell_of(flights)
    single = cell_of(dataclasses.replace(flights.work(), alone=True))
    numbers = hardest(flights.scenario(), flights.values(flights.scenario()))
    assert numbers[next(path for path in numbers if path.endswith("stiffness"))] <= 1e5
    for k in range(2):
        assert cell.status[k] == single.status[k]
        for name in ("contact_error_mean", "object_last_x", "phases_done"):
            # single flights take the steps of their own world, the batch those of the
            # hardest
            assert float(cell.metrics[name][k]) == pytest.approx(
                single.metrics[name][k], abs=0.02, nan_ok=True
            ), name


def test_the_stiffest_world_takes_the_steps_of_the_one_that_needs_the_shortest():
    """Of this seed the hardest wall is smooth and another, rougher one asks for shorter
    steps.
    """
    case = next(
        each for each in contact_flights((FLAGSHIP,), ("press_and_hold",), 200, seed=7)
    )
    scenario = case.scenario()
    values = case.values(scenario)
    at = "world.surfaces.wall.material"
    material = {name: values[f"{at}.{name}"] for name in ("stiffness", "friction")}
    steps = [
        Material(stiffness=k, friction=mu).largest_step
        for k, mu in zip(*material.values(), strict=True)
    ]
    taken = Material(
        **{name: hardest(scenario, values)[f"{at}.{name}"] for name in material}
    )
    assert taken.largest_step == pytest.approx(min(steps), rel=1e-12)
    assert np.argmin(steps) != np.argmax(material["stiffness"])


def test_a_task_that_no_world_allows_is_refused_after_so_many_as_the_limit_needs():
    """One world, sixteen to spare and twice the worlds that may be discarded of one,
    rounded up: 19.
    """
    slick = dataclasses.replace(TASKS["slide_circle"], friction=(50.0, 60.0))
    with pytest.raises(ValueError, match="19 of 19 worlds are discarded"):
        draw_worlds(slick, shipped("slide_circle"), 1, seed=0)
