"""Several vehicles in the studio: each is drawn, pushed and moved by its sliders; one
is chosen for the panels.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tab import TOKEN, Open, Tab

import skyarm
from skyarm.records.path_names import agent_of
from skyarm.scenario.scenario_record import Change
from skyarm.view.studio.fleet import Fleet, Flight, FlownAgent, is_of_law, pushes_of
from skyarm.view.studio.knobs import knobs_of
from skyarm.view.studio.page import Page
from skyarm.view.studio.picture import NEWTON, VIEWS, FleetPicture
from support.peers import Scene as Nodes
from support.teams import TEAMS, team

PUSHED = 60
"""Control period in which the right vehicle is pushed."""


class Handle(contextlib.AbstractContextManager["Handle"]):
    """An input of a page without a browser: what it was made with, and what a user
    does.
    """

    order, max = 1.0, 30.0

    def __init__(self, panels: Panels, *given: Any, **words: Any) -> None:
        self.given, self.words, self.value, self.gone = (
            given,
            words,
            words.get("initial_value"),
            False,
        )
        self._panels, self._inside = panels, list[Handle]()

    def on_update(self, work: Any) -> None:
        self._work = work

    def use(self, value: Any) -> None:
        """Choose a value as a user."""
        self.value = value
        asyncio.run(self._work(SimpleNamespace(client_id=1, target=self)))

    def add_tab(self, *_: Any) -> Handle:
        return Handle(self._panels)

    def remove(self) -> None:
        self.gone = True
        for each in self._inside:
            each.remove()

    def __enter__(self) -> Handle:
        self._before = len(self._panels.made)
        return self

    def __exit__(self, *_: Any) -> None:
        self._inside += self._panels.made[self._before :]


class Panels:
    """Inputs and plots of a page without a browser, by their labels."""

    def __init__(self) -> None:
        self.made: list[Handle] = []

    def __getattr__(self, _name: str) -> Any:
        def add(*given: Any, **words: Any) -> Handle:
            handle = Handle(self, *given, **words)
            self.made.append(handle)
            return handle

        return add

    def called(self, label: str) -> list[Handle]:
        """Inputs that are on the page under a label."""
        return [
            each for each in self.made if each.given[:1] == (label,) and not each.gone
        ]

    def hints(self) -> list[str]:
        """Paths of the sliders on the page."""
        return [
            str(each.words.get("hint")).partition(":")[0]
            for each in self.made
            if not each.gone
        ]

    def slider(self, path: str) -> Handle:
        """The slider on the page of a path."""
        (slider,) = (
            each
            for each in self.made
            if str(each.words.get("hint")).startswith(path) and not each.gone
        )
        return slider

    def legends(self) -> set[str]:
        """Names of the curves of all plots."""
        shown = [
            each.given[1]
            for each in self.made
            if "scales" in each.words and not each.gone
        ]
        return {
            str(series["label"]).split(" least")[0]
            for rows in shown
            for series in rows[1:2]
        }


def page_of(source: str, folder: Path) -> tuple[Page, Panels, Nodes]:
    """A page of a scenario on a server without a browser, whose flight is made."""
    panels, nodes = Panels(), Nodes()
    server: Any = SimpleNamespace(
        scene=nodes,
        gui=panels,
        initial_camera=SimpleNamespace(),
        atomic=contextlib.nullcontext,
        dark=False,
    )
    page = Page(server, Fleet(source), [None], folder)
    fly(page)
    return page, panels, nodes


def fly(page: Page, ticks: int = 0) -> None:
    """Execute what was ordered, and fly on."""
    page._handle_inputs()
    while page._making:
        time.sleep(0.01)
        page._handle_inputs()
    page.fleet.go(page.fleet.tick + ticks)
    page._picture.hurry()
    page._draw()
    page._draw_slowly()


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Page, Panels, Nodes]:
    return page_of(str(TEAMS / "bar.toml"), tmp_path_factory.mktemp("saved"))


@pytest.fixture
def bar(shown: tuple[Page, Panels, Nodes]) -> Iterator[tuple[Page, Panels, Nodes]]:
    page, _, _ = shown
    page.fleet.reset()
    page.choose_agent("left")
    fly(page)
    yield shown
    page.fleet.reset()


@cache
def plain() -> skyarm.Log:
    """The bar's flight without a studio."""
    return skyarm.run(team("bar", duration=0.5))


def test_every_vehicle_and_the_body_stand_where_the_log_has_them(
    bar: tuple[Page, Panels, Nodes],
) -> None:
    page, _, nodes = bar
    fly(page, 40)
    for name, log in plain().agents.items():
        np.testing.assert_allclose(
            nodes.nodes[f"/stage/law1_{name}"].position, log.position[40], atol=1e-4
        )
        ghost = nodes.nodes[f"/stage/ghost_{name}"].position
        np.testing.assert_allclose(ghost, log.position_reference[40], atol=1e-4)
        assert nodes.nodes[f"/stage/label1_{name}"].text == f"centroidal_joint, {name}"
    thing = nodes.nodes["/stage/scene1_left/world/bar"].position
    np.testing.assert_allclose(thing, plain().object_position[40], atol=1e-4)
    assert not [
        each for each in nodes.nodes if each.startswith("/stage/scene1_right/")
    ], "what all share is drawn once"
    assert {each for each in nodes.nodes if each.endswith(("left", "right"))} >= {
        "/stage/arrows1_right"
    }


def test_arrows_are_the_thrusts_of_each_vehicle_and_the_forces_of_all_grasps(
    bar: tuple[Page, Panels, Nodes],
) -> None:
    page, _, nodes = bar
    fly(page, 40)
    for name, log in plain().agents.items():
        rotors = team("bar").agents[name].plant.vehicle.rotors
        arrows = nodes.nodes[f"/stage/arrows1_{name}"].points[: len(rotors)]
        lengths = np.linalg.norm(arrows[:, 1] - arrows[:, 0], axis=1)
        thrusts = [
            float(r.thrust_coefficient) * w**2
            for r, w in zip(rotors, log.rotor_speeds[40], strict=True)
        ]
        np.testing.assert_allclose(lengths, NEWTON * np.array(thrusts), atol=1e-4)
    touches = nodes.nodes["/stage/touches1_left"].points
    pulls = plain().grasp_pull[40].reshape(-1, 3)
    np.testing.assert_allclose(
        touches[:, 1] - touches[:, 0], -NEWTON * pulls, atol=2e-4
    )
    assert "/stage/touches1_right" not in nodes.nodes


def test_plots_sliders_and_words_are_of_the_chosen_vehicle(
    bar: tuple[Page, Panels, Nodes],
) -> None:
    page, panels, _ = bar
    fly(page, 20)
    (menu,) = panels.called("vehicle")
    assert menu.given[1] == ("left", "right")
    assert menu.words["order"] < page._controls.tabs.order
    for name in ("right", "left"):
        menu.use(name)
        fly(page)
        of = {agent_of(path) for path in panels.hints()}
        assert of - {""} == {name}
        assert any(
            path.startswith(f"agents.{name}.controller.") for path in panels.hints()
        )
        assert panels.hints().count("environment.wind.force.x") == 1
        assert panels.legends() == {f"centroidal_joint, {name}"}
        error = 1e3 * page.fleet.flights[0].agents[name].last.error
        assert f"centroidal_joint, {name}: tip error {error:.1f} mm" in page._status()
    page.choose_agent("middle")  # of a case that was left meanwhile
    fly(page)
    assert page.agent == "left"


def test_a_moved_slider_is_of_one_vehicle_and_is_still_moved_when_it_is_chosen_again(
    bar: tuple[Page, Panels, Nodes],
) -> None:
    page, panels, _ = bar
    path = "agents.right.reference.base.z"
    page.choose_agent("right")
    fly(page)
    assert panels.slider(path).given[0] == "reference base z (m)", (
        "whose it is says the menu"
    )
    panels.slider(path).use(1.2)
    page.choose_agent("left")
    fly(page)
    page.choose_agent("right")
    fly(page)
    agents = page.fleet.flights[0].session.scenario.agents
    assert [float(each.reference.at(0.0).position.z) for each in agents.values()] == [
        1.0,
        1.2,
    ]
    assert panels.slider(path).value == 1.2


def test_a_push_acts_on_the_chosen_vehicle_and_the_saved_flight_repeats_it(
    bar: tuple[Page, Panels, Nodes],
) -> None:
    page, panels, _ = bar
    fly(page, PUSHED)
    page.choose_agent("right")
    fly(page)
    (disturb,) = panels.called("disturb")
    disturb.use("push (1 N s)")
    fly(page, 60)
    log = page.fleet.flights[0].session.log
    forces = {name: own.wind_force[:, 0] for name, own in log.agents.items()}
    assert not forces["left"].any()
    assert (forces["right"][PUSHED : PUSHED + 20] == 10.0).all()
    assert not forces["right"][:PUSHED].any()
    assert not forces["right"][PUSHED + 20 :].any()
    words = page.fleet.save(page._out)
    again = skyarm.run(skyarm.load_scenario(words.rpartition("skyarm run ")[2]))
    for name, own in log.agents.items():
        np.testing.assert_array_equal(again.agents[name].position, own.position)
        np.testing.assert_array_equal(
            again.agents[name].rotor_commands, own.rotor_commands
        )
    page.fleet.go(PUSHED - 20)
    page.fleet.go(PUSHED + 60)
    np.testing.assert_array_equal(
        page.fleet.flights[0].session.log.agents["right"].position, own.position
    )


def test_a_load_hangs_at_the_vehicle_that_it_was_hung_at() -> None:
    flight = Flight.__new__(Flight)
    flight.first, flight.knobs, flight.title = team("bar"), (), "a"
    hung = Change(at=0.0, path="agents.right.plant.payload.mass", value=0.2)
    flight.session = SimpleNamespace(
        tick=3, plan=replace(flight.first, changes=(hung,))
    )  # type: ignore[assignment]
    assert [FlownAgent(flight, name).hung_mass for name in ("left", "right")] == [
        0.0,
        0.2,
    ]


def test_sliders_of_a_team_are_those_of_its_vehicles_and_of_what_they_share_once() -> (
    None
):
    fleet = Fleet(str(TEAMS / "triangle.toml"))
    scenario = fleet.scenario
    paths = [each.path for each in knobs_of(scenario, pushes_of(scenario).values())]
    assert len({*paths}) == len(paths)
    of = {
        name: [p.split(".", 2)[2] for p in paths if agent_of(p) == name]
        for name in scenario.agents
    }
    assert of["right"] == of["front"] == of["left"]
    assert len(of["left"]) > 30
    shared = [path for path in paths if not agent_of(path)]
    assert {path.split(".")[0] for path in shared} == {"environment"}
    assert not [path for path in shared if path.startswith("environment.forces.")], (
        "pushes have buttons"
    )
    assert is_of_law("agents.left.controller.gains.position.x")
    assert not is_of_law("agents.left.reference.base.z")


def test_a_first_view_looks_at_the_middle_of_all_vehicles_from_further_away() -> None:
    camera = SimpleNamespace()
    scenario = team("triangle")
    FleetPicture(SimpleNamespace(scene=Nodes(), initial_camera=camera)).build(
        scenario, ["a"]
    )
    places = np.array(
        [
            [float(c) for c in each.reference.at(0.0).position]
            for each in scenario.agents.values()
        ]
    )
    away = np.linalg.norm(np.array(camera.position) - places.mean(axis=0))
    reach = np.linalg.norm(places - places.mean(axis=0), axis=1).max()
    assert away == pytest.approx((1.0 + reach) * np.linalg.norm(VIEWS[0]))


@pytest.mark.thorough
def test_the_menu_of_vehicles_is_on_the_real_page_and_goes_with_the_team(
    tmp_path: Path,
) -> None:
    page = Open(tmp_path, str(TEAMS / "cables.toml"), [None])
    tab = Tab(page.port, TOKEN)
    try:
        tab.listen(lambda t: t.error("centroidal_joint, left") >= 0.0)
        tab.move(tab.find("'left', 'right'"), "right")
        tab.listen(
            lambda t: (
                t.error("centroidal_joint, right") >= 0.0
                and t.has("agents.right.delays.command")
            )
        )
        assert not tab.has("agents.left.")
        tab.move(tab.find("choose"), "case1")
        tab.listen(
            lambda t: t.has("controller.gains.position.x") and not t.has("agents.")
        )
        assert not tab.has("'left', 'right'")
        tab.move(tab.find("choose"), "two_hold_a_bar")
        tab.listen(lambda t: t.has("'left', 'right'") and t.has("agents.left."))
    finally:
        tab.close()
        page.close()
