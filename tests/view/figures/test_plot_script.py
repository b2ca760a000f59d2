"""The script of interactive figures, run: what it draws are the data, what it reads out are the data, views change."""

from __future__ import annotations

import json
import math
import re
import shutil
import subprocess
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from logs_synthetic import all_logs
from skyarm.simulate import Window
from skyarm.view.figures import interactive as spec
from skyarm.view.figures.interactive import (
    SCRIPTS,
    STYLES,
    experiment_figure,
    figure_json,
    plot_script,
    plot_style,
    tool_path_figure,
)

NODE = shutil.which("node")
needs_node = pytest.mark.skipif(NODE is None, reason="no 'node' on this machine")
PAGE = Path(__file__).with_name("page_in_node.js")

T = np.arange(51) * 0.1 + 0.05
SINE, RAMP = np.sin(T), 0.1 * T
BOTH = spec.PanelsFigure(
    axis="Time [s]",
    height=132,
    panels=[
        spec.Panel(label="Roll", unit="rad", span=(-0.5, 0.5)),
        spec.Panel(label="Error", unit="m", from_zero=True),
    ],
    curves=[
        spec.Curve(panel=0, name="A", style="ct", shown=True, x0=0.05, dx=0.1, y=spec.rounded(SINE)),
        spec.Curve(panel=1, name="A", style="ct", shown=True, x0=0.05, dx=0.1, y=spec.rounded(RAMP)),
        spec.Curve(panel=1, name="B", style="pd", shown=False, x0=0.05, dx=0.1, y=spec.rounded(2.0 * RAMP)),
    ],
    shades=[spec.Shade(name="window", start=1.0, stop=2.0)],
    choices=[spec.Choice(label="only B", names=["B"])],
)
# where frames, ticks and curves of a drawing are
READ = """
const at = (each, keys) => keys.map((key) => Number(each.attributes[key]));
function drawing(i) {
  const svg = holders[i || 0].find("plot-drawing")[0];
  return {
    frames: svg.find("frame").map((each) => at(each, ["x", "y", "width", "height"])),
    ticks: svg.find("tick").map((each) => [...at(each, ["x", "y"]), each.textContent, each.attributes["text-anchor"]]),
    curves: svg.find("curve").map((each) => [each.attributes.class, each.attributes.d]),
    shades: svg.find("shade").map((each) => at(each, ["x", "width"])),
    readings: svg.find("reading").map((each) => each.find("value").map((value) => value.textContent)),
    axes: svg.find("axis").map((each) => each.textContent),
    marks: svg.find("mark").length,
    bands: svg.find("band").length,
    size: at(svg, ["width", "height"]),
  };
}
function pointer(kind, u, v, i, panel, more) {
  const svg = holders[i || 0].find("plot-drawing")[0], frame = svg.find("frame")[panel || 0];
  const [x, y, width, height] = at(frame, ["x", "y", "width", "height"]);
  return svg.fire(kind, { clientX: x + u * width, clientY: y + v * height, ...more });
}
function drag(u0, v0, u1, v1, more) {
  pointer("pointerdown", u0, v0, 0, 0, more);
  pointer("pointermove", u1, v1, 0, 0, more);
  const bands = drawing().bands;
  pointer("pointerup", u1, v1, 0, 0, more);
  return bands;
}
const button = (text, i) => holders[i || 0].find("button").find((each) => each.textContent === text);
const key = (name, more) => holders[0].find("plot-drawing")[0].fire("keydown", { key: name, ...more });
"""


def page(*figures: Any, do: str, width: int = 800) -> Any:
    """What actions on a page with these figures give back."""
    given = {
        "script": plot_script(),
        "specs": {f"plot-{i}": figure_json(figure) for i, figure in enumerate(figures)},
        "width": width,
        "actions": READ + do,
    }
    done = subprocess.run([str(NODE), str(PAGE)], input=json.dumps(given), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


shown = partial(page, BOTH)
LOOK = "return drawing();"


def number(text: str) -> float:
    return float(text.replace("\N{MINUS SIGN}", "-"))


def scale(ticks: list[tuple[float, str]]) -> np.ndarray:
    """Slope and offset from places to values, from the axis as a reader sees it."""
    places, texts = zip(*ticks, strict=True)
    return np.polyfit(places, [number(text) for text in texts], 1)


def axis_of_time(drawing: dict[str, Any]) -> np.ndarray:
    return scale([(x, text) for x, _, text, anchor in drawing["ticks"] if anchor == "middle"])


def drawn_points(drawing: dict[str, Any], curve: int, panel: int) -> np.ndarray:
    """Points (K, 2) of a drawn curve in the units of its axes, read off the ticks."""
    _, top, _, height = drawing["frames"][panel]
    own = [(y - 4, text) for _, y, text, anchor in drawing["ticks"] if anchor == "end" and top <= y - 4 <= top + height]
    pixels = np.array(re.findall(r"[ML]([-\d.]+) ([-\d.]+)", drawing["curves"][curve][1]), dtype=float)
    return np.stack([np.polyval(axis_of_time(drawing), pixels[:, 0]), np.polyval(scale(own), pixels[:, 1])], axis=1)


@needs_node
def test_what_is_drawn_are_the_data_as_the_axes_say_them() -> None:
    drawing = shown(do=LOOK)
    assert [name for name, _ in drawing["curves"]] == ["curve ct", "curve ct"]
    for curve, values in enumerate((SINE, RAMP)):
        points = drawn_points(drawing, curve, curve)
        assert points[:, 0] == pytest.approx(T, abs=0.01)
        assert points[:, 1] == pytest.approx(values, abs=0.02 * np.ptp(values))
    start, width = drawing["shades"][0]
    assert np.polyval(axis_of_time(drawing), [start, start + width]) == pytest.approx([1.0, 2.0], abs=0.01)
    _, top, _, height = drawing["frames"][1]
    own = [(y - 4, text) for _, y, text, anchor in drawing["ticks"] if anchor == "end" and y - 4 >= top]
    assert np.polyval(scale(own), top + height) == pytest.approx(0.0, abs=1e-9), "an axis from zero"
    assert drawing["axes"] == ["Time [s]"]


@needs_node
def test_the_curves_of_real_logs_are_all_drawn() -> None:
    logs = {plant: cases["case2_gust"] for plant, cases in all_logs().items()}
    figure = experiment_figure(logs, Window(5.0, 20.0))
    first, both = page(figure, do="const one = drawing(); button('both').click(); return [one, drawing()];")
    assert len(first["curves"]) == 2 * 7
    assert len(both["curves"]) == 4 * 7
    points = drawn_points(first, 0, 0)
    assert points[:, 0] == pytest.approx(0.0075 + 0.02 * np.arange(1500), abs=0.03)
    assert points[:, 1] == pytest.approx(np.full(1500, 0.05), abs=2e-3)


@needs_node
def test_a_gap_is_not_bridged() -> None:
    y = [0.0, 1.0, None, None, 2.0, 3.0]
    curve = spec.Curve(panel=0, name="A", style="ct", shown=True, x0=0.0, dx=1.0, y=y)
    figure = spec.PanelsFigure(axis="Time [s]", height=132, panels=[spec.Panel(label="Roll")], curves=[curve])
    drawing, reading = page(
        figure, do="const one = drawing(); pointer('pointermove', 0.45, 0.5); return [one, drawing()];"
    )
    assert re.sub(r"[^ML]", "", drawing["curves"][0][1]) == "MLML"
    assert reading["readings"] == [["\N{EN DASH}"]]
    assert reading["marks"] == 0


@needs_node
@pytest.mark.parametrize("share", [0.37, 0.398])
def test_the_pointer_reads_the_sample_next_to_it(share: float) -> None:
    found = shown(do=f"pointer('pointermove', {share}, 0.5); return drawing();")
    time = (0.05 - 0.1) + share * (T[-1] + 0.1 - (0.05 - 0.1))
    k = round((time - 0.05) / 0.1)
    (roll,), (error,) = found["readings"]
    assert (number(roll), number(error)) == pytest.approx((SINE[k], RAMP[k]), abs=6e-5)
    assert found["axes"] == [f"Time [s]: {time:.3f}"]
    assert found["marks"] == 2
    assert (
        shown(do="pointer('pointermove', 0.4, 0.5); pointer('pointerleave', 0, 0); return drawing();")["readings"] == []
    )
    touched = shown(do="const finger = {pointerType: 'touch'}; pointer('pointermove', 0.4, 0.5, 0, 0, finger); "
                       "pointer('pointerleave', 0, 0, 0, 0, finger); return drawing();")  # fmt: skip
    assert len(touched["readings"]) == 2


@needs_node
def test_small_values_are_read_with_their_digits() -> None:
    assert page(BOTH, do="return [0, 1.23456e-5, -0.5, 0.001, null].map(readable);") == [
        "0.0000", "1.23e\N{MINUS SIGN}5", "\N{MINUS SIGN}0.5000", "0.0010", "\N{EN DASH}",
    ]  # fmt: skip


@needs_node
def test_a_drag_zooms_all_panels_to_its_times_and_a_double_click_shows_all() -> None:
    zoomed, whole, bands = shown(
        do="const bands = drag(0.6, 0.5, 0.2, 0.55); const one = drawing(); pointer('dblclick', 0.5, 0.5);"
        "return [one, drawing(), bands];"
    )
    assert bands == 2
    low, high = T[0] - 0.1, T[-1] + 0.1
    left, _, width, _ = zoomed["frames"][0]
    seen = np.polyval(axis_of_time(zoomed), [left, left + width])
    assert seen == pytest.approx([low + 0.2 * (high - low), low + 0.6 * (high - low)], abs=0.01)
    points = drawn_points(zoomed, 1, 1)
    outside = (points[:, 0] < seen[0]).tolist(), (points[:, 0] > seen[1]).tolist()
    assert outside[0] == [True] + [False] * (len(points) - 1), "one more on each side, so that lines leave the panel"
    assert outside[1] == [False] * (len(points) - 1) + [True]
    assert points[:, 1] == pytest.approx(0.1 * points[:, 0], abs=0.02)
    assert zoomed["bands"] == 0
    assert whole == shown(do=LOOK) | {"readings": whole["readings"], "marks": whole["marks"], "axes": whole["axes"]}


@needs_node
def test_a_tall_drag_zooms_the_values_of_its_panel_alone() -> None:
    before = shown(do=LOOK)
    zoomed, bands, whole = shown(
        do="const bands = drag(0.2, 0.1, 0.6, 0.6), one = drawing();"
        "pointer('dblclick', 0.5, 0.5); pointer('pointerleave', 0, 0); return [one, bands, drawing()];"
    )
    assert whole == before
    assert bands == 1
    _, top, _, height = before["frames"][0]
    own = [(y - 4, text) for _, y, text, anchor in before["ticks"] if anchor == "end" and y < top + height + 4]
    wanted = np.polyval(scale(own), [top + 0.1 * height, top + 0.6 * height])
    own = [(y - 4, text) for _, y, text, anchor in zoomed["ticks"] if anchor == "end" and y < top + height + 4]
    assert np.polyval(scale(own), [top, top + height]) == pytest.approx(wanted, abs=0.02)


@needs_node
def test_a_click_without_a_drag_and_a_plain_wheel_change_nothing() -> None:
    assert shown(do="drag(0.4, 0.5, 0.402, 0.5); pointer('pointerleave', 0, 0); return drawing();") == shown(do=LOOK)
    upright = "drag(0.4, 0.2, 0.402, 0.8); pointer('pointerleave', 0, 0); return drawing();"
    assert shown(do=upright) == shown(do=LOOK)
    prevented, after = shown(
        do="const e = pointer('wheel', 0.4, 0.5, 0, 0, {deltaY: 9}); return [e.prevented, drawing()];"
    )
    assert not prevented, "the page scrolls"
    assert after == shown(do=LOOK)
    prevented, after = shown(
        do="const e = pointer('wheel', 0.4, 0.5, 0, 0, {deltaY: -9, ctrlKey: true}); return [e.prevented, drawing()];"
    )
    assert prevented
    assert axis_of_time(after)[0] == pytest.approx(0.8 * axis_of_time(shown(do=LOOK))[0], rel=0.01)


@needs_node
def test_moving_keeps_the_width_and_stops_at_the_ends() -> None:
    moved = shown(
        do="button('+').click(); button('\\u2192').click(); const one = drawing();"
        "drag(0.5, 0.5, 0.9, 0.5, {shiftKey: true}); return [one, drawing()];"
    )
    first, dragged = (np.polyval(axis_of_time(each), each["frames"][0][0]) for each in moved)
    slope = axis_of_time(shown(do=LOOK))[0]
    width = (T[-1] + 0.1) - (T[0] - 0.1)
    assert axis_of_time(moved[0])[0] == pytest.approx(0.5 * slope, rel=0.01)
    assert first == pytest.approx(T[0] - 0.1 + width * (0.25 + 0.125), abs=0.02)
    assert dragged == pytest.approx(first - 0.4 * 0.5 * width, abs=0.02)
    ended = shown(
        do="button('+').click(); for (let i = 0; i < 9; i += 1) { button('\\u2190').click(); } return drawing();"
    )
    assert np.polyval(axis_of_time(ended), ended["frames"][0][0]) == pytest.approx(T[0] - 0.1, abs=0.01)


@needs_node
def test_keys_read_and_zoom() -> None:
    read = shown(do="for (let i = 0; i < 20; i += 1) { key('ArrowRight'); } return drawing();")
    middle, width = 0.5 * (T[0] + T[-1]), T[-1] - T[0] + 0.2
    assert read["axes"] == [f"Time [s]: {middle + 20 * width / 200:.3f}"]
    assert shown(do="key('+'); key('-'); key('+'); key('0'); return drawing();") == shown(do=LOOK)
    assert shown(do="return [key('+').prevented, key('x').prevented, key('Tab').prevented];") == [True, False, False]


@needs_node
def test_the_legend_shows_hides_and_singles_out() -> None:
    classes = "return drawing().curves.map((each) => each[0]);"
    assert shown(do=f"button('B').click(); {classes}") == ["curve ct", "curve ct", "curve pd"]
    assert shown(do=f"button('A').click(); {classes}") == []
    assert shown(do=f"button('B').fire('dblclick'); {classes}") == ["curve pd"]
    assert shown(do=f"button('only B').click(); {classes}") == ["curve pd"]
    pressed = "return ['A', 'B'].map((name) => button(name).attributes['aria-pressed']);"
    assert shown(do=f"button('A').click(); {pressed}") == ["false", "false"]
    assert shown(do=pressed) == ["true", "false"]


@needs_node
def test_categories_are_read_by_name_and_panels_stand_in_columns() -> None:
    curves = [
        spec.Curve(panel=i, name="CT", style="ct", shown=True, x0=0.0, dx=1.0, y=[1.0, 2.0 + i, None], points=True)
        for i in range(4)
    ]
    figure = spec.PanelsFigure(axis="Damping", height=230, columns=3, categories=["0", "0.001", "0.05"],
                               panels=[spec.Panel(label=f"P{i}", from_zero=True, span=(0.0, 0.0)) for i in range(4)],
                               curves=curves)  # fmt: skip
    wide = page(figure, do="pointer('pointermove', 0.6, 0.5); return drawing();", width=1000)
    assert wide["axes"] == ["Damping: 0.001"] * 4
    assert [each[0] for each in wide["readings"]] == ["2.0000", "3.0000", "4.0000", "5.0000"]
    tops = [frame[1] for frame in wide["frames"]]
    assert tops[0] == tops[1] == tops[2] < tops[3]
    narrow = page(figure, do="resize(390); return drawing();", width=1000)
    assert len({frame[0] for frame in narrow["frames"]}) == 1
    assert narrow["size"][0] == 390
    assert page(figure, do="key('ArrowLeft'); key('ArrowLeft'); return drawing();")["axes"] == ["Damping: 0"] * 4


PATHS = spec.PathFigure(
    height=560,
    aspect=(1.0, 1.0, 0.5),
    curves=[
        spec.Path(
            name="A",
            style="ct",
            shown=True,
            x=[0.0, 1.0, 1.0, None, 0.0],
            y=[0.0, 0.0, 1.0, None, 1.0],
            z=[0.0, 0.0, 0.0, 0.0, 1.0],
        ),
        spec.Path(name="B", style="pd", shown=False, x=[0.5], y=[0.5], z=[0.5]),
    ],
)


def pixels(drawing: dict[str, Any]) -> np.ndarray:
    return np.array(re.findall(r"[ML]([-\d.]+) ([-\d.]+)", drawing["curves"][0][1]), dtype=float)


@needs_node
def test_a_path_is_seen_from_azimuth_and_elevation() -> None:
    """At the first view, and after turns, the points lie where a rotation of the world puts them."""
    box = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 1]]) * [1.0, 1.0, 0.5] / 1.08
    for keys, azimuth, elevation in (
        ("", 0.785, 0.36),
        ("key('ArrowRight'); key('ArrowRight'); key('ArrowDown');", 0.985, 0.26),
        ("for (let i = 0; i < 40; i += 1) { key('ArrowUp'); }", 0.785, 1.57),
    ):
        ca, sa, ce, se = math.cos(azimuth), math.sin(azimuth), math.cos(elevation), math.sin(elevation)
        views = np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce]])
        wanted = box @ views.T * [1.0, -1.0]  # a drawing's y points down
        found = pixels(page(PATHS, do=f"{keys} {LOOK}"))
        scale = np.linalg.norm(found[1] - found[0]) / np.linalg.norm(wanted[1] - wanted[0])
        assert found - found[0] == pytest.approx(scale * (wanted - wanted[0]), abs=0.02)


@needs_node
def test_a_path_turns_by_a_drag_and_reads_the_point_under_the_pointer() -> None:
    turned, back = page(
        PATHS,
        do="""
        const svg = holders[0].find("plot-drawing")[0];
        svg.fire("pointerdown", {clientX: 100, clientY: 100});
        svg.fire("pointermove", {clientX: 140, clientY: 120});
        svg.fire("pointerup", {});
        const one = drawing();
        svg.fire("dblclick");
        return [one, drawing()];""",
    )
    assert np.abs(pixels(turned) - pixels(back)).max() > 20.0
    assert pixels(back) == pytest.approx(pixels(page(PATHS, do=LOOK)))
    x, y = pixels(back)[1]
    text = page(
        PATHS,
        do=f"""
        const svg = holders[0].find("plot-drawing")[0];
        svg.fire("pointermove", {{clientX: {x + 2}, clientY: {y}}});
        return svg.find("reading").map((each) => each.textContent);""",
    )
    assert text == ["A: x 1.0000, y 0.0000, z 0.0000 m"]
    assert re.sub(r"[^ML]", "", back["curves"][0][1]) == "MLLM", "the gap is not bridged"


@needs_node
def test_the_paths_of_real_logs_are_drawn() -> None:
    logs = {plant: cases["case3"] for plant, cases in all_logs().items()}
    first, both = page(
        tool_path_figure(logs), do="const one = drawing(); button('both').click(); return [one, drawing()];"
    )
    assert [name for name, _ in first["curves"]] == ["curve wide desired", "curve wide ct", "curve wide pd"]
    assert len(both["curves"]) == 5


@needs_node
def test_a_view_is_saved_as_it_is_seen() -> None:
    ((text, kind),) = shown(do="button('Save').click(); return saved;")
    assert kind == "image/svg+xml"
    assert text.startswith("<svg")
    assert "<style>.curve {}</style>" in text
    assert text.count('class="curve ct"') == 2


@needs_node
@pytest.mark.parametrize(("low", "high"), [(0.0, 30.0), (-0.01, 0.01), (0.0, 1e-7), (-3.0, 417.0), (9.99, 10.01)])
def test_ticks_are_round_and_few(low: float, high: float) -> None:
    found = page(BOTH, do=f"return ticks({low!r}, {high!r}, 5);")
    places = [tick["at"] for tick in found]
    assert 2 <= len(places) <= 6
    assert low - 1e-9 * (high - low) <= places[0] < places[-1] <= high + 1e-9 * (high - low)
    step = places[1] - places[0]
    assert np.diff(places) == pytest.approx(np.full(len(places) - 1, step))
    assert round(step / 10 ** math.floor(math.log10(step) + 1e-9), 6) in (1, 2, 5)
    assert [number(tick["text"]) for tick in found] == pytest.approx(places, abs=1e-6 * step)


@needs_node
def test_a_name_stays_text() -> None:
    evil = "<img src=x onerror=alert(1)>"
    curve = spec.Curve(panel=0, name=evil, style="other", shown=True, x0=0.0, dx=1.0, y=[1.0, 2.0])
    figure = spec.PanelsFigure(axis=evil, height=132, panels=[spec.Panel(label=evil)], curves=[curve])
    assert page(figure, do="return holders[0].find('img').length;") == 0
    assert "innerHTML" not in plot_script()


@needs_node
def test_figures_without_curves_are_drawn() -> None:
    empty = spec.PanelsFigure(axis="Time [s]", height=132, panels=[spec.Panel(label="Roll")], curves=[])
    nothing = spec.PathFigure(height=400, aspect=(1.0, 1.0, 1.0), curves=[])
    assert page(empty, nothing, do="return holders.map((_, i) => drawing(i).curves.length);") == [0, 0]


def test_every_style_has_a_pen_in_light_and_in_dark() -> None:
    light, dark = plot_style().split("@media (prefers-color-scheme: dark)")
    for style in STYLES:
        rule = re.search(rf"\.plot \.{style}\b[^{{]*\{{ --pen: var\(--([a-z-]+)\)", plot_style())
        assert rule is not None, style
        assert f"--{rule[1]}:" in light
        assert f"--{rule[1]}:" in dark


def test_the_scripts_are_whole_and_name_no_address() -> None:
    """Where there is no Node: brackets are closed in each file, and the only address is the name of SVG."""
    for name, text in zip(SCRIPTS, map(_file, SCRIPTS), strict=True):
        bare = re.sub(r'"(?:\\.|[^"\\\n])*"|//[^\n]*|/\*.*?\*/', "", text, flags=re.DOTALL)
        assert [bare.count(a) - bare.count(b) for a, b in ("()", "[]", "{}")] == [0, 0, 0], name
        assert len(text.splitlines()) <= 250
    assert re.findall(r"https?:[^\"]*", plot_script()) == ["http://www.w3.org/2000/svg"]
    assert not re.search(r"\beval\b|\bFunction\(|fetch|XMLHttpRequest|import\(", plot_script())
    assert not re.search(r"@import|url\(", plot_style())


@needs_node
@pytest.mark.parametrize("name", SCRIPTS)
def test_each_script_is_javascript(name: str, tmp_path: Path) -> None:
    file = tmp_path / name
    file.write_text(_file(name), "utf-8")
    done = subprocess.run([str(NODE), "--check", str(file)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def _file(name: str) -> str:
    return (Path(str(spec.__file__)).parent / name).read_text("utf-8")
