"""Several laws in the studio are told apart, in the picture and in the plots, whose
axes have whole ticks.
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import skyarm
from skyarm.simulate.first_state import first_state
from skyarm.view.picture.marks import tones_of
from skyarm.view.studio import picture
from skyarm.view.studio.controls import Chart, add_clock
from skyarm.view.studio.page import Page
from skyarm.view.studio.picture import (
    COLORS,
    LOST,
    AgentNodes,
    FleetPicture,
    StudioStage,
)
from skyarm.world.scene.scene import Scene
from support.peers import Scene as Nodes


def plotted(
    flights: int, errors: Sequence[float], columns: Sequence[str] = ("",)
) -> tuple[Chart, Any]:
    """A plot of flights with an error each second, and what its page was given."""
    seen = [
        SimpleNamespace(time=3.0 + i, error=error) for i, error in enumerate(errors)
    ]
    gui = SimpleNamespace(
        add_uplot=lambda data, series, **words: SimpleNamespace(
            data=data, series=series, **words
        )
    )
    laws = [
        SimpleNamespace(title=f"law{i}", recent=lambda _: seen) for i in range(flights)
    ]
    chart = Chart(
        gui, "error (mm)", laws, {name: lambda one: 1e3 * one.error for name in columns}
    )  # type: ignore[arg-type]
    seen += [SimpleNamespace(time=3.0 + len(seen) + i, error=0.0) for i in range(4)]
    return chart, chart._node


def test_a_plot_shows_no_digits_that_its_labels_have_not() -> None:
    time, error, _ = plotted(1, (1e-9, 0.0123456, -0.0123456))[1].data
    assert (time.tolist(), error.tolist()) == (
        [-2.0, -1.0, 0.0],
        [0.0, 12.346, -12.346],
    )


def test_a_plot_has_whole_seconds_before_now_whatever_its_page_was_shown_first() -> (
    None
):
    chart, node = plotted(1, ())
    assert node.scales["x"]["range"] == (-10.0, 0.0)
    changes = [node.data[-1]]
    for _ in range(2):
        chart.draw()
        time, error, change = node.data
        assert (time.tolist(), error.tolist()) == ([-3.0, -2.0, -1.0, 0.0], [0.0] * 4)
        # a curve that does not change, too, has its ticks found anew
        assert change[0] != changes[-1][0]
        changes.append(change)
    assert all(each == int(each) for each in node.axes[0]["incrs"])
    # labels have three decimals: a step below them would give two labels one text, and
    # wider labels would be cut
    assert min(node.axes[1]["incrs"]) == 0.001
    assert node.axes[1]["size"] >= 55
    assert node.padding[0] >= 6, "half of the topmost label is above the axis"


def test_a_plot_of_several_curves_names_them_where_they_lie_on_each_other() -> None:
    alone, several = plotted(1, (0.1,))[1], plotted(2, (0.1,), ("least", "most"))[1]
    assert (alone.legend["show"], several.legend["show"]) == (False, True)
    _, *curves, unseen = several.series
    assert unseen.keys() == {"label", "scale"}, "without a stroke"
    words = ["law0 least", "law0 most (dashed)", "law1 least", "law1 most (dashed)"]
    assert [each["label"] for each in curves] == words
    assert ["dash" in each for each in curves] == [False, True, False, True]
    assert curves[0]["stroke"] == curves[1]["stroke"] != curves[2]["stroke"]
    # the later one is drawn over the first, which is seen on both of its sides
    assert curves[0]["width"] - curves[2]["width"] >= 2.0


@pytest.mark.parametrize("dark", [False, True])
def test_a_floor_is_about_as_light_as_its_page(dark: bool) -> None:
    server = SimpleNamespace(
        scene=Nodes(), initial_camera=SimpleNamespace(), dark=False
    )
    stage, page = StudioStage(server), 20.0 if dark else 255.0
    server.dark = dark
    stage._follow(np.zeros(3))
    ground = server.scene.nodes["/stage/ground"]
    lines = [
        np.mean(getattr(ground, name, [200.0]))
        for name in ("cell_color", "section_color")
    ]
    assert all(8.0 < abs(each - page) < (48.0 if dark else 120.0) for each in lines)


def test_laws_at_one_place_are_a_solid_and_wires_around_it() -> None:
    made: list[tuple[str, dict[str, Any]]] = []
    scene = Nodes()
    plain = {
        kind: getattr(scene, kind)
        for kind in ("add_box", "add_icosphere", "add_cylinder", "add_mesh_simple")
    }
    for kind, add in plain.items():
        scene.__dict__[kind] = lambda name, *args, add=add, **words: (
            made.append((name, words)) or add(name, *args)
        )
    server = SimpleNamespace(scene=scene, initial_camera=SimpleNamespace())
    FleetPicture(server).build(skyarm.load_scenario("case2"), ["one", "two"])
    for law, wires in (("law1", False), ("law2", True)):
        assert {
            words["wireframe"]
            for name, words in made
            if name.startswith(f"/stage/{law}/")
        } == {wires}
    one, two = (
        {name.partition(law)[2]: words for name, words in made if law in name}
        for law in ("law1", "law2")
    )
    assert one.keys() == two.keys()
    for name, words in one.items():
        for size in ("radius", "dimensions", "scale"):
            first, other = (
                np.array(words.get(size, 1.0)),
                np.array(two[name].get(size, 1.0)),
            )
            assert (other >= first).all()
        assert words["color"] != two[name]["color"]
    assert any(
        two[name]["radius"] > words["radius"]
        for name, words in one.items()
        if "height" in words
    )


def test_the_chosen_speed_is_the_number_before_the_x() -> None:
    used: dict[str, Any] = {}

    def handle(name: str, *args: Any, **words: Any) -> Any:
        return SimpleNamespace(on_update=lambda work: used.update({name: work}))

    gui = SimpleNamespace(
        add_button_group=handle, add_dropdown=handle, add_slider=handle
    )
    clock = SimpleNamespace(speed=1.0)
    add_clock(gui, lambda work: work(clock), 10.0)  # type: ignore[arg-type]
    for text, speed in (("4x", 4.0), ("0.25x", 0.25)):
        asyncio.run(
            used["speed"](
                SimpleNamespace(client_id=1, target=SimpleNamespace(value=text))
            )
        )
        assert clock.speed == speed
    asyncio.run(
        used["speed"](
            SimpleNamespace(client_id=None, target=SimpleNamespace(value="2x"))
        )
    )
    assert clock.speed == 0.25, "a change by the program is no choice of the user"


def test_a_lost_vehicle_turns_red_and_back(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = skyarm.load_scenario("case2")
    vehicle, state = scenario.plant.vehicle, first_state(scenario)
    colors: list[tuple[float, ...]] = []
    nodes = SimpleNamespace(
        _vehicle=vehicle,
        vehicle=SimpleNamespace(
            place=lambda *_: None, color=lambda paint: colors.append(paint("base"))
        ),
        _place_scene=lambda *_: None,
        _attached_mass=lambda *_: (),
        _forces=SimpleNamespace(point=lambda _: None),
        _trail=SimpleNamespace(points=None),
        _lost=False,
        _paint=tones_of(COLORS[0]),
        _label=SimpleNamespace(text="", position=None),
        _above=np.zeros(3),
    )
    flight = SimpleNamespace(session=SimpleNamespace(running=True), lost=False)
    agent = SimpleNamespace(
        flight=flight, recent=lambda _: (), title="one", hung_mass=0.0, last=None
    )
    monkeypatch.setattr(picture, "force_arrows", lambda *_: ())
    monkeypatch.setattr(picture, "trail", lambda _: None)
    texts = []
    for lost in (False, True, True, False):
        flight.lost = lost
        AgentNodes.draw(nodes, agent, state, Scene(), slow=True)  # type: ignore[arg-type]
        texts.append(nodes._label.text)
    assert colors == [tones_of(LOST)("base"), tones_of(COLORS[0])("base")]
    assert texts == ["one", "one: lost", "one: lost", "one"]


@pytest.mark.parametrize(
    ("flights", "making", "tick", "flown"),
    [(1, 1, 0, []), (1, 1, 7, [0.5]), (1, 0, 0, [0.5]), (0, 0, 0, [])],
    ids=["first of two", "another joins", "all are made", "none"],
)
def test_laws_begin_together_and_fly_on_while_another_is_made(
    flights: int, making: int, tick: int, flown: list[float]
) -> None:
    seconds: list[float] = []
    page: Any = SimpleNamespace(
        fleet=SimpleNamespace(
            flights=[None] * flights, tick=tick, advance=seconds.append
        ),
        _making=making,
    )
    Page._advance(page, 0.5)
    assert seconds == flown
