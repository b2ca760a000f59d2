"""Pictures of flights: lines are the log's numbers, words fit, limits and events are
those of the scenario.
"""

from __future__ import annotations

import dataclasses
import re
from functools import cache
from itertools import combinations
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

import skyarm
from skyarm.view.figures.flight_facts import (
    LONGEST,
    applied_force,
    flight_events,
    flight_labels,
    flights_by_label,
)
from skyarm.view.figures.flight_panels import KINDS, panels_of
from skyarm.view.figures.flight_plot import MOST, plot
from skyarm.view.figures.style import PAPER
from support.flights import estimated
from support.logs import synthetic_log

GUST = (0.3, 0.7)
FAULT = 0.8


@cache
def flights() -> dict[str, skyarm.Log]:
    """A second of the gust experiment by two laws, the gust early and a rotor that
    weakens.
    """
    found = {}
    for law in ("paper_ct", "paper_pd"):
        scenario = skyarm.load_scenario("case2_gust", controller=law, duration=1.0)
        wind = dataclasses.replace(
            scenario.wind,
            gust=skyarm.Gust(
                peak=[2.0, 0.0, 0.0], start=GUST[0], duration=GUST[1] - GUST[0]
            ),
        )
        fault = skyarm.Fault(rotor="left", effectiveness=0.9, start=FAULT)
        found[law] = skyarm.run(
            dataclasses.replace(scenario, wind=wind, faults=(fault,))
        )
    return found


def curves(ax: Any) -> dict[str, Any]:
    """Label -> line, without what the legend does not name."""
    return {
        line.get_label(): line
        for line in ax.get_lines()
        if not line.get_label().startswith("_")
    }


def expected(kind: str, log: skyarm.Log) -> list[tuple[str, Any, Any]]:
    """(label of the axis, curve, reference) of each panel, as the issue's kinds are
    written here once more.
    """
    error = 1e3 * np.sqrt(((log.tip - log.tip_reference) ** 2).sum(axis=1))
    angles = np.rad2deg(log.euler)
    found = {
        "tracking": [
            *(
                (f"Base {axis} [m]", log.position[:, i], log.position_reference[:, i])
                for i, axis in enumerate("xyz")
            ),
            *(
                (f"Joint{i + 1} [rad]", log.joints[:, i], log.joints_reference[:, i])
                for i in range(2)
            ),
        ],
        "attitude": [
            ("Roll [deg]", angles[:, 0], None),
            ("Pitch [deg]", angles[:, 1], None),
            ("Yaw [deg]", angles[:, 2], np.rad2deg(log.yaw_reference)),
        ],
        "tip": [
            *(
                (f"Tip {axis} [m]", log.tip[:, i], log.tip_reference[:, i])
                for i, axis in enumerate("xyz")
            ),
            ("Tip error [mm]", error, None),
        ],
        "efforts": [
            (f"Joint{i + 1} torque [N m]", log.efforts[:, i], None) for i in range(2)
        ],
        "rotors": [
            (f"Rotor {name} [rad/s]", log.rotor_speeds[:, i], None)
            for i, name in enumerate(("front", "left", "back", "right"))
        ],
    }
    found["all"] = [panel for each in found.values() for panel in each]
    factors = [
        float(rotor.thrust_coefficient) for rotor in log.scenario.plant.vehicle.rotors
    ]
    found["team"] = [
        ("Tip error [mm]", error, None),
        ("Thrust [N]", log.rotor_speeds**2 @ factors, None),
    ]
    return found[kind]


@pytest.mark.parametrize(
    "kind", [*(kind for kind in KINDS if kind not in ("contact", "parts")), "all"]
)
def test_every_line_is_the_log_s(kind: str) -> None:
    figure = plot(flights(), kind=kind)
    for name, log in flights().items():
        panels = expected(kind, log)
        by_label = {" ".join(ax.get_ylabel().split()): ax for ax in figure.axes}
        assert sorted(by_label) == sorted(label for label, _, _ in panels)
        for label, curve, desired in panels:
            drawn = curves(by_label[label])
            np.testing.assert_array_equal(drawn[name].get_xdata(), log.time)
            np.testing.assert_allclose(
                drawn[name].get_ydata(), curve, rtol=1e-12, atol=1e-12
            )
            assert ("desired" in drawn) == (desired is not None)
            if desired is not None:
                np.testing.assert_allclose(
                    drawn["desired"].get_ydata(), desired, rtol=1e-12
                )


def test_what_was_measured_and_estimated_stands_beside_the_truth_of_one_flight() -> (
    None
):
    log = skyarm.run(estimated(duration=0.3))
    drawn = {" ".join(ax.get_ylabel().split()): curves(ax) for ax in plot(log).axes}
    base, roll = drawn["Base z [m]"], drawn["Roll [deg]"]
    np.testing.assert_array_equal(
        base["measured"].get_ydata(), log.readings["mocap"]["position"][:, 2]
    )
    np.testing.assert_array_equal(
        base["estimated"].get_ydata(), log.estimate["position"][:, 2]
    )
    np.testing.assert_array_equal(
        base["centroidal_tip"].get_ydata(), log.position[:, 2]
    )
    turned = dataclasses.replace(log, quaternion=log.estimate["quaternion"])
    np.testing.assert_allclose(
        roll["estimated"].get_ydata(), np.degrees(turned.euler[:, 0]), rtol=1e-12
    )
    np.testing.assert_array_equal(
        drawn["Joint1 [rad]"]["measured"].get_ydata(),
        log.readings["encoders"]["joints"][:, 0],
    )
    assert "estimated" not in drawn["Tip x [m]"], "no sensor reads it"
    several = [
        curves(ax)
        for ax in plot({"one": log, "two": flights()["paper_ct"]}, kind="tracking").axes
    ]
    assert not any({"measured", "estimated"} & set(each) for each in several)
    perfect = skyarm.run(skyarm.load_scenario("case1", duration=0.1))
    assert not any(
        {"measured", "estimated"} & set(curves(ax))
        for ax in plot(perfect, kind="tracking").axes
    )


def test_a_yaw_that_turns_on_follows_its_reference_without_a_jump() -> None:
    """An attitude has its yaw within half a turn, a reference does not."""
    log = flights()["paper_ct"]
    turned = np.linspace(0.0, 9.0, log.time.size)
    zero = np.zeros(turned.size)
    attitude = np.stack(
        [np.cos(0.5 * turned), zero, zero, np.sin(0.5 * turned)], axis=1
    )
    turning = dataclasses.replace(log, quaternion=attitude, yaw_reference=turned + 0.1)
    drawn = curves(plot(turning, kind="attitude").axes[2])
    np.testing.assert_allclose(
        next(iter(drawn.values())).get_ydata(), np.degrees(turned), atol=1e-9
    )


def test_a_log_draws_itself_and_a_notebook_shows_it(tmp_path: Path) -> None:
    log = flights()["paper_ct"]
    figure = log.plot(tmp_path / "tip.png", kind="tip", window=(0.2, 0.9))
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert (tmp_path / "tip.png").read_bytes().startswith(b"\x89PNG")
    np.testing.assert_array_equal(
        curves(figure.axes[3])["hybrid_computed_torque"].get_xdata(), log.time
    )


@pytest.mark.parametrize(
    ("suffix", "begin"),
    [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF"), ("PNG", b"\x89PNG")],
)
def test_the_suffix_says_the_format(suffix: str, begin: bytes, tmp_path: Path) -> None:
    file = tmp_path / f"flight.{suffix}"
    plot(flights(), file, kind="attitude")
    assert file.read_bytes().startswith(begin)
    assert [each.name for each in tmp_path.iterdir()] == [file.name], (
        "nothing half-written beside it"
    )


def spans(ax: Any) -> list[tuple[float, float]]:
    """Shaded intervals of a panel."""
    boxes = (
        patch.get_extents().transformed(ax.transData.inverted()) for patch in ax.patches
    )
    return [(round(box.x0, 6), round(box.x1, 6)) for box in boxes]


def test_gusts_and_faults_are_shaded_where_they_happen() -> None:
    figure = plot(flights(), kind="attitude")
    for ax in figure.axes:
        assert spans(ax) == [GUST, (FAULT, 1.0)]
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == ["paper_ct", "paper_pd", "desired", "gust", "rotor left at 90 %"]


def test_an_event_of_one_flight_says_whose_it_is() -> None:
    calm = skyarm.run(skyarm.load_scenario("case2", duration=1.0))
    words = [
        text.get_text()
        for text in plot({"calm": calm, **flights()}).legends[0].get_texts()
    ]
    assert "gust (paper_ct, paper_pd)" in words
    outside = plot(flights(), window=(0.0, 0.2), kind="tip")
    assert not any(ax.patches for ax in outside.axes)


def test_a_gust_in_which_flights_are_lost_at_other_times_is_one() -> None:
    whole, rows = flights()["paper_ct"], {}
    for name, ended in (("a", 120), ("b", 160)):
        info = {**whole.info, "status": "ground", "end_time": ended / 200.0}
        rows[name] = dataclasses.replace(
            whole,
            **{each: array[:ended] for each, array in whole.arrays().items()},
            info=info,
        )
    figure = plot(rows, kind="attitude")
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert [each for each in words if each.startswith("gust")] == ["gust"]
    assert all(stop <= 0.8 for ax in figure.axes for _, stop in spans(ax))


def test_a_flight_of_one_instant_is_a_point() -> None:
    whole = flights()["paper_ct"]
    one = dataclasses.replace(
        whole, **{each: array[:1] for each, array in whole.arrays().items()}
    )
    for log, marker in ((one, "o"), (whole, "None")):
        line, _desired = curves(plot(log, kind="tip").axes[0]).values()
        assert line.get_marker() == marker


def test_a_log_without_its_scenario_still_shows_its_gust() -> None:
    figure = plot(
        synthetic_log("case2_gust", "rigid_body", "CT", seconds=12.0), kind="tracking"
    )
    assert [" ".join(ax.get_ylabel().split()) for ax in figure.axes][-2:] == [
        "Joint 1 [rad]",
        "Joint 2 [rad]",
    ]
    assert spans(figure.axes[0]) == [(7.5, 10.5)]


def with_efforts(scale: float) -> skyarm.Log:
    log = flights()["paper_ct"]
    wave = np.sin(20.0 * log.time)[:, None] * np.array([scale, 0.01])
    return dataclasses.replace(log, efforts=wave)


def test_the_window_sets_both_axes() -> None:
    log = flights()["paper_ct"]
    falling = log.tip_reference + (1.0 - log.time[:, None]) * np.array([0.3, 0.0, 0.0])
    ax = plot(
        dataclasses.replace(log, tool=falling), kind="tip", window=(0.5, 0.8)
    ).axes[3]
    assert ax.get_xlim() == (0.5, 0.8)
    assert ax.get_ylim() == pytest.approx((0.0, 1.07 * 150.0))


def test_words_longer_than_a_panel_is_high_take_two_lines() -> None:
    for words in ("Tip x", "wrist_pitch torque", "a joint of this length"):
        figure, axes = PAPER.stacked_panels(3)
        for ax in axes:
            PAPER.name_axis(ax, words, "N m")
        require_words_apart(figure)


@pytest.mark.parametrize("unit", ["kg m^2/s^2", ""])
def test_a_long_name_stays_whole_within_the_height_of_its_panel(unit: str) -> None:
    names = (
        "thermal_x",
        "updraft_at_the_base_of_the_vehicle",
        "anameofoneword" * 4,
        "flux of the ground, rotor_front",
    )
    figure, axes = PAPER.stacked_panels(len(names))
    for ax, name in zip(axes, names, strict=True):
        PAPER.name_axis(ax, name, unit)
    require_words_apart(figure)
    for ax, name in zip(axes, names, strict=True):
        label = ax.yaxis.label
        box, panel = label.get_window_extent(), ax.get_window_extent()
        assert panel.y0 - 0.5 <= box.y0 < box.y1 <= panel.y1 + 0.5
        assert box.x1 < panel.x0
        said = f"{name}[{unit}]" if unit else name
        assert label.get_text().replace("\n", "").replace(" ", "") == said.replace(
            " ", ""
        )


def test_a_lost_flight_does_not_flatten_the_others_and_is_named() -> None:
    log = flights()["paper_ct"]
    away = dataclasses.replace(
        log,
        position=log.position + 1e5 * log.time[:, None] ** 4,
        info={**log.info, "status": "joint_limit"},
    )
    alone = plot(log, kind="tracking").axes[0].get_ylim()
    figure = plot({"good": log, "bad": away}, kind="tracking")
    both = figure.axes[0].get_ylim()
    assert both[1] - both[0] <= 3.001 * (alone[1] - alone[0])
    assert "bad (joint limit)" in [
        text.get_text() for text in figure.legends[0].get_texts()
    ]
    ends = [line for line in figure.axes[0].get_lines() if line.get_marker() == "X"]
    assert [float(line.get_xdata()[0]) for line in ends] == [away.time[-1]]
    assert ends[0].get_markersize() > 0.5 * PAPER.small, "as large as a letter"


def overlaps(boxes: list[Bbox]) -> list[tuple[Bbox, Bbox]]:
    # half a dot is rounding
    return [
        (a, b)
        for a, b in combinations(boxes, 2)
        if a.padded(-0.5).overlaps(b.padded(-0.5))
    ]


def require_words_apart(figure: Figure) -> None:
    """No label covers another, and none is cut by the edge of the figure."""
    figure.draw_without_rendering()
    texts = [ax.yaxis.label for ax in figure.axes] + [
        ax.xaxis.label for ax in figure.axes
    ]
    texts += [text for ax in figure.axes for text in ax.texts]
    texts += [text for legend in figure.legends for text in legend.get_texts()]
    boxes = [text.get_window_extent() for text in texts if text.get_text()]
    assert not overlaps(boxes)
    for box in [*boxes, *(legend.get_window_extent() for legend in figure.legends)]:
        assert figure.bbox.x0 - 0.5 <= box.x0
        assert box.x1 <= figure.bbox.x1 + 0.5
        assert figure.bbox.y0 - 0.5 <= box.y0
        assert box.y1 <= figure.bbox.y1 + 0.5


@pytest.mark.parametrize(
    "kind",
    [
        "rotors",
        *(
            pytest.param(each, marks=pytest.mark.thorough)
            for each in ("all", "attitude")
        ),
    ],
)
def test_labels_and_legends_have_room(kind: str) -> None:
    log = flights()["paper_ct"]
    many = {
        f"a law with a rather long name, number {i}": log for i in range(5)
    } | flights()
    require_words_apart(plot(many, kind=kind))


def test_six_joints_and_six_rotors_have_room() -> None:
    log = flights()["paper_ct"]
    six = np.outer(log.time, np.arange(1.0, 7.0))
    info = {**log.info, "scenario_record": None}
    arm = dataclasses.replace(
        log, joints=six, joints_reference=six, efforts=six, rotor_speeds=six, info=info
    )
    figure = plot(arm)
    require_words_apart(figure)
    assert len(figure.axes) == 3 + 6 + 3 + 4 + 6 + 6


def luminance(color: str) -> float:
    """Relative luminance of a hex colour; Source: WCAG 2.2."""
    channels = [int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [
        c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_flights_are_told_apart_in_grey_and_on_their_ground() -> None:
    for style in (PAPER,):
        assert len({look.dash for look in style.looks}) == len(style.looks)
        assert len({style.look(i) for i in range(MOST)}) == MOST
        for look in (*style.looks, style.desired, style.limit):
            low, high = sorted((luminance(look.color), luminance(style.face)))
            # WCAG 2.2, 1.4.11: graphics need a contrast of 3; the orange of the paper's
            # PD has 2.9
            assert (high + 0.05) / (low + 0.05) > 2.8


def test_nothing_global_is_touched() -> None:
    before = dict(mpl.rcParams)
    plot(flights())
    assert dict(mpl.rcParams) == before


def test_labels_are_what_tells_flights_apart() -> None:
    ct, pd = flights().values()
    assert flight_labels([ct, pd]) == ["hybrid_computed_torque", "decoupled_pd"]
    assert flight_labels([ct, pd], ["runs/a.npz", "runs/b.npz"]) == ["a", "b"]
    assert flight_labels([ct, pd], ["a/log.npz", "b/log.npz"]) == [
        "hybrid_computed_torque",
        "decoupled_pd",
    ]
    assert flight_labels([ct, ct], ["a/log.npz", "b/log.npz"]) == [
        "a/log.npz",
        "b/log.npz",
    ]
    assert flight_labels([ct, ct]) == [
        "1: hybrid_computed_torque",
        "2: hybrid_computed_torque",
    ]
    seeded = dataclasses.replace(ct, info={**ct.info, "seed": 7})
    assert flight_labels([ct, seeded])[1] == "hybrid_computed_torque, 7"
    long = flight_labels([ct, pd], [f"{'x' * 80}1.npz", f"{'x' * 80}2.npz"])
    assert [len(label) for label in long] == [LONGEST - 1] * 2 or [
        len(label) for label in long
    ] == [LONGEST] * 2
    assert long[0] != long[1]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            {"kind": "contact"},
            "kind = 'contact': must be another one, for the flights have no contact",
        ),
        (
            {"kind": "speed"},
            (
                "kind = 'speed': must be one of tracking, attitude, tip, contact,"
                " efforts, rotors, parts, team, all, path"
            ),
        ),
        ({"kind": "trackin"}, "did you mean 'tracking'?"),
        ({"window": (2.0, 1.0)}, "window = [2, 1]: must start before it stops"),
        (
            {"window": (40.0, 50.0)},
            "window = [40, 50]: must overlap the flights, which last 1 s",
        ),
        ({"window": (float("nan"), 1.0)}, "window[0] = nan: must be a finite number"),
        (
            {"file": "x.jpg"},
            (
                "file = 'x.jpg': suffix 'jpg': did you mean 'png'? must be one of png,"
                " svg, pdf"
            ),
        ),
        ({"file": "x"}, "file = 'x': suffix ''"),
    ],
)
def test_wrong_options_are_one_line(options: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=re.escape(words)) as caught:
        plot(flights(), **options)
    assert "\n" not in str(caught.value)


def test_flights_without_joints_have_no_efforts_and_too_many_flights_are_refused() -> (
    None
):
    log = flights()["paper_ct"]
    empty = np.zeros((log.time.size, 0))
    bare = dataclasses.replace(
        log,
        joints=empty,
        joints_reference=empty,
        efforts=empty,
        info={**log.info, "scenario_record": None},
    )
    assert len(plot(bare, kind="tracking").axes) == 3
    with pytest.raises(
        ValueError,
        match="kind = 'efforts': must be another one, for the flights have no joints",
    ):
        plot(bare, kind="efforts")
    assert len(plot({"bare": bare, "arm": log}, kind="efforts").axes) == 2
    with pytest.raises(
        ValueError, match="flights = 13: must be 1 to 12 in one picture"
    ):
        plot([log] * 13)
    with pytest.raises(ValueError, match="flights = 0"):
        plot([])


def test_a_limit_that_a_curve_comes_near_is_drawn() -> None:
    """The paper's arm saturates at 0.5 N m, the Hummingbird's rotors at 838 rad/s."""
    near, far = plot(with_efforts(0.4), kind="efforts").axes
    assert [
        float(line.get_ydata()[0])
        for line in near.get_lines()
        if line.get_label() == "limit"
    ] == [-0.5, 0.5]
    assert near.get_ylim()[0] < -0.5
    assert near.get_ylim()[1] > 0.5
    assert "limit" not in curves(far)
    for ax in plot(flights(), kind="rotors").axes:
        assert float(curves(ax)["limit"].get_ydata()[0]) == 838.0
        assert ax.get_ylim()[0] < 480.0
        assert ax.get_ylim()[1] > 838.0


def test_limits_of_joints_are_those_of_the_vehicle() -> None:
    scenario = skyarm.load_scenario("case2", duration=0.2)
    vehicle = scenario.plant.vehicle.with_joints(lower=-0.4, upper=1.0)
    log = skyarm.run(
        dataclasses.replace(
            scenario, plant=dataclasses.replace(scenario.plant, vehicle=vehicle)
        )
    )
    assert [panel.limits for panel in panels_of("tracking", [log])][3:] == [
        (-0.4, 1.0)
    ] * 2
    assert [panel.limits for panel in panels_of("efforts", [log])] == [(-0.5, 0.5)] * 2


def test_changes_in_flight_are_lines_and_many_are_counted() -> None:
    scenario = skyarm.load_scenario("case2_gust", duration=1.0)
    wind = dataclasses.replace(
        scenario.wind, gust=skyarm.Gust(peak=[2.0, 0.0, 0.0], start=0.3, duration=0.4)
    )
    masses = [
        skyarm.Change(at=at, path="plant.payload.mass", value=0.02)
        for at in (0.5, 0.7, 3.0)
    ]
    log = skyarm.run(dataclasses.replace(scenario, wind=wind, changes=tuple(masses)))
    figure = plot(log, kind="attitude")
    assert spans(figure.axes[0]) == [(0.3, 0.7)]
    instants = [
        line
        for line in figure.axes[0].get_lines()
        if line.get_label().startswith("_plant")
    ]
    assert [line.get_xdata()[0] for line in instants] == [0.5, 0.7]
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words[2:] == ["gust", "plant.payload.mass, 2 changes"]
    require_words_apart(figure)
    paths = (
        "plant.payload.mass",
        "environment.wind.force_W.x",
        "sensors.position",
        "controller.gains.position.x",
    )
    changes = tuple(skyarm.Change(at=0.5, path=path, value=1e-3) for path in paths)
    many = flight_events(
        skyarm.run(dataclasses.replace(scenario, wind=wind, changes=changes))
    )
    assert [(event.label, event.start, round(event.stop, 9)) for event in many] == [
        ("gust", 0.3, 0.7),
        *[("4 changes of 4 numbers", 0.5, 0.5)] * 4,
    ]


def test_flights_of_a_picture_are_logs_and_paths(tmp_path: Path) -> None:
    ct, pd = flights().values()
    a, b = ct.save_npz(tmp_path / "a.npz"), pd.save_npz(tmp_path / "b.npz")
    assert list(flights_by_label(str(a))) == ["a"]
    assert list(flights_by_label([a, str(b)])) == ["a", "b"]
    assert list(flights_by_label({"mine": a, "its": pd})) == ["mine", "its"]
    assert list(flights_by_label([a, pd])) == ["hybrid_computed_torque", "decoupled_pd"]
    assert all(
        np.array_equal(flights_by_label([a, pd])[law].tip, log.tip)
        for law, log in (("hybrid_computed_torque", ct), ("decoupled_pd", pd))
    )
    (line,) = (
        each
        for each in plot(a, kind="tip").axes[0].get_lines()
        if each.get_label() == "a"
    )
    assert np.array_equal(line.get_ydata(), ct.tip[:, 0])
    for given, words in (
        (3, "3: must be a Log or the path of one's file"),
        ("absent.npz", "'absent.npz': no such"),
    ):
        with pytest.raises(ValueError, match=f"^log = {words}"):
            plot(given)  # type: ignore[arg-type]


def test_the_applied_force_is_that_on_surfaces_or_else_that_of_a_grip():
    def log(**forces):
        columns = {
            name: np.array(values, dtype=float) for name, values in forces.items()
        }
        return SimpleNamespace(
            component=lambda name: columns.get(name, np.zeros((2, 0))),
            scenario=None,
            time=np.zeros(2),
        )

    touches, grips = [[1.0, 2.0], [0.0, 4.0]], [[5.0], [6.0]]
    assert applied_force(log(contact_force=touches, gripper_force=grips)).tolist() == [
        3.0,
        4.0,
    ]
    assert applied_force(
        log(contact_force=np.zeros((2, 2)), gripper_force=grips)
    ).tolist() == [5.0, 6.0]
    assert applied_force(log(contact_force=np.zeros((2, 2)))).tolist() == [0.0, 0.0]
    assert applied_force(log(gripper_force=grips)) is None
