"""The page in a real Chromium, drawn in software: it loads, a gust and a slider move
the vehicle, others are refused.

Needs node, Chromium and playwright-core, which NODE_PATH leads to; skipped where one of
them is missing.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

NODE = shutil.which("node")
CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))),
    None,
)
SCRIPT = Path(__file__).with_name("browser.cjs")


def missing() -> str:
    """What a browser's test lacks here."""
    if NODE is None or CHROMIUM is None:
        return "node or Chromium is not installed"
    found = subprocess.run(
        [NODE, "-e", "require('playwright-core')"], capture_output=True, check=False
    )
    return (
        ""
        if found.returncode == 0
        else "playwright-core is not on NODE_PATH (npm install playwright-core)"
    )


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    if reason := missing():
        # `make browser` must not pass by skipping
        assert "STUDIO_BROWSER" not in os.environ, reason
        pytest.skip(reason)
    shots = Path(os.environ.get("STUDIO_SHOTS", tmp_path_factory.mktemp("shots")))
    laws = ("--laws", "paper_ct,paper_pd")
    command = [
        sys.executable,
        "-m",
        "skyarm",
        "studio",
        "case2",
        *laws,
        "--port",
        "0",
        "--no-browser",
    ]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as page:
        assert page.stdout is not None
        address = page.stdout.readline().split(maxsplit=1)[1].strip()
        try:
            words = [str(NODE), str(SCRIPT), address, str(shots), str(CHROMIUM)]
            looked = subprocess.run(
                words, capture_output=True, text=True, timeout=500, check=False
            )
        finally:
            page.terminate()
        said = page.stdout.read()
    assert looked.returncode == 0, looked.stderr
    found: dict[str, Any] = json.loads(looked.stdout.splitlines()[-1])
    for name in ("phone", "night"):
        with Image.open(shots / f"{name}.png") as shot:
            found[f"{name}_pixels"] = np.asarray(shot.convert("RGB"), dtype=int)
    assert said == "studio: closed\n"
    return found


def test_the_page_loads_without_a_word_on_the_console(seen: dict[str, Any]) -> None:
    assert seen["errors"] == []


def test_a_gust_raises_the_tip_error_that_the_page_shows_and_it_recovers(
    seen: dict[str, Any],
) -> None:
    assert seen["gust"] >= 4 * seen["calm"]
    assert seen["after"] <= 1.5 * seen["calm"]


def test_the_page_is_dark_where_the_browser_prefers_so(seen: dict[str, Any]) -> None:
    assert min(seen["light_paper"][:3]) > 200
    assert max(seen["dark_paper"][:3]) < 80


def test_a_slider_of_wind_moves_the_vehicle(seen: dict[str, Any]) -> None:
    assert seen["slider"] >= 4 * seen["calm"]


def test_on_a_phone_picture_and_controls_share_the_screen_and_fit_a_finger(
    seen: dict[str, Any],
) -> None:
    picture, sheet = seen["picture_box"], seen["sheet_box"]
    assert seen["width"] == 390
    assert (sheet["left"], sheet["right"], sheet["bottom"]) == (0, 390, 844)
    assert picture["bottom"] <= sheet["top"] + 1
    assert picture["bottom"] - picture["top"] >= 300
    clock = [
        each
        for each in seen["buttons"]
        if each["words"] in ("play / pause", "step", "reset")
    ]
    pushes = [
        each for each in seen["buttons"] if each["words"].startswith(("push", "gust"))
    ]
    assert (len(clock), len(pushes), [each["words"] for each in seen["tabs"]]) == (
        3,
        2,
        ["plots", "scenario", "world", "laws"],
    )
    for each in (*clock, *pushes, *seen["tabs"]):
        assert min(each["bottom"] - each["top"], each["right"] - each["left"]) >= 40
        assert 0 <= each["left"] < each["right"] <= 390
        assert sheet["top"] <= each["top"] < each["bottom"] <= 844
    assert len({each["top"] for each in seen["tabs"]}) == 1


def colored(pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where there is the first law's blue, and the second one's orange."""
    red, _, blue = np.moveaxis(pixels, 2, 0)
    return blue - red > 30, red - blue > 60


@pytest.mark.parametrize("page", ["phone", "night"])
def test_vehicle_and_arm_of_both_laws_are_seen_where_they_hover(
    seen: dict[str, Any], page: str
) -> None:
    end = (int(seen["picture_box"]["bottom"]), 390) if page == "phone" else (800, 940)
    pixels = seen[f"{page}_pixels"][: end[0], : end[1]]
    blue, orange = colored(pixels)
    for here in (blue, orange):
        assert here.sum() >= 40, "of a solid and of the wires about it"
        assert 0.1 * end[1] < np.median(np.nonzero(here)[1]) < 0.9 * end[1]
    rows, _ = np.nonzero(blue | orange)
    assert np.ptp(rows) >= 0.1 * end[0], "from the base down along the arm"


def test_plots_say_which_law_is_which_and_have_whole_seconds(
    seen: dict[str, Any],
) -> None:
    assert len(seen["ticks"]) == len(seen["legends"]) >= 4
    for words in seen["legends"]:
        assert {word.split()[0] for word in words} - {"limit"} == {
            "paper_ct",
            "paper_pd",
        }
    for ticks in seen["ticks"]:
        assert len(ticks) >= 3
        assert all(int(each) in range(-10, 1) for each in ticks)


def test_the_floor_of_a_dark_page_is_darker_than_its_vehicles(
    seen: dict[str, Any],
) -> None:
    floor = seen["night_pixels"][500:, :900].max(axis=2)
    ground = np.median(floor)
    assert 8 < floor.max() - ground < 60
    assert ground < 40


def test_a_page_of_another_origin_gets_no_websocket(seen: dict[str, Any]) -> None:
    assert seen["hostile"] == "refused"
