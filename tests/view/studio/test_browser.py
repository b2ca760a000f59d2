"""The page in a real Chromium, drawn in software: it loads, a gust and a slider move the vehicle, others are refused.

Needs node, Chromium and playwright-core, which NODE_PATH leads to; skipped where one of them is missing.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

NODE = shutil.which("node")
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
SCRIPT = Path(__file__).with_name("browser.cjs")


def missing() -> str:
    """What a browser's test lacks here."""
    if NODE is None or CHROMIUM is None:
        return "node or Chromium is not installed"
    found = subprocess.run([NODE, "-e", "require('playwright-core')"], capture_output=True, check=False)
    return "" if found.returncode == 0 else "playwright-core is not on NODE_PATH (npm install playwright-core)"


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    if reason := missing():
        assert "STUDIO_BROWSER" not in os.environ, reason  # `make browser` must not pass by skipping
        pytest.skip(reason)
    shots = Path(os.environ.get("STUDIO_SHOTS", tmp_path_factory.mktemp("shots")))
    laws = ("--laws", "paper_ct,paper_pd")
    command = [sys.executable, "-m", "skyarm", "studio", "case2", *laws, "--port", "0", "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as page:
        assert page.stdout is not None
        address = page.stdout.readline().split(maxsplit=1)[1].strip()
        try:
            words = [str(NODE), str(SCRIPT), address, str(shots), str(CHROMIUM)]
            looked = subprocess.run(words, capture_output=True, text=True, timeout=500, check=False)
        finally:
            page.terminate()
        said = page.stdout.read()
    assert looked.returncode == 0, looked.stderr
    found: dict[str, Any] = json.loads(looked.stdout.splitlines()[-1])
    assert said == "studio: closed\n"
    return found


def test_the_page_loads_without_a_word_on_the_console(seen: dict[str, Any]) -> None:
    assert seen["errors"] == []


def test_a_gust_raises_the_tip_error_that_the_page_shows_and_it_recovers(seen: dict[str, Any]) -> None:
    assert seen["gust"] >= 4 * seen["calm"]
    assert seen["after"] <= 1.5 * seen["calm"]


def test_the_page_is_dark_where_the_browser_prefers_so(seen: dict[str, Any]) -> None:
    assert min(seen["light_paper"][:3]) > 200
    assert max(seen["dark_paper"][:3]) < 80


def test_a_slider_of_wind_moves_the_vehicle(seen: dict[str, Any]) -> None:
    assert seen["slider"] >= 4 * seen["calm"]


def test_a_page_of_another_origin_gets_no_websocket(seen: dict[str, Any]) -> None:
    assert seen["hostile"] == "refused"
