"""The picture of public vehicles has ten of them with numbers of their files, and fits
a telephone.
"""

from __future__ import annotations

import re
from pathlib import Path

import public_vehicles
import pytest
from public_vehicles import DRAWING, VEHICLES, drawing, read

PAGE = (DRAWING.parents[1] / "coming_from.md").read_text("utf-8")

OF_THE_FILES = {
    "x500": (2.0 + 4 * 0.016076923, 4),
    "omnicopter": (1.54, 8),
    "hummingbird": (0.68 + 4 * 0.009 + 0.015, 4),
    "pelican": (1.0 + 4 * 0.01 + 0.015, 4),
    "firefly": (1.5 + 6 * 0.005 + 0.015, 6),
    "X2": (4 * 0.25 + 0.325, 4),
    "cf2x": (0.027, 4),
}
"""Name -> mass (kg) and rotors, by hand from the files' words."""

BOX = """<sdf version="1.9"><model name="box"><link name="hull">
  <inertial><mass>1.25</mass>
  <inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.02</izz>
  <ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia>
  </inertial></link></model></sdf>"""


def test_each_of_ten_vehicles_has_the_mass_and_the_rotors_of_its_file() -> None:
    shown = re.findall(
        r'font-weight="bold"[^>]*>([^<]+)</text>\n<text[^>]*>([\d.]+) kg, (\d+) rotors',
        DRAWING.read_text(),
    )
    assert [name for name, *_ in shown] == list(VEHICLES)
    assert len(shown) == 10
    found = {name: (float(mass), int(rotors)) for name, mass, rotors in shown}
    for name, (mass, rotors) in OF_THE_FILES.items():
        assert found[name] == (pytest.approx(mass, rel=5e-4), rotors), name


def test_the_picture_is_small_and_its_letters_can_be_read_on_a_telephone() -> None:
    text = DRAWING.read_text("utf-8")
    assert f"](images/{DRAWING.name})" in PAGE
    assert len(text) < 150_000
    assert float(re.search(r'width="(\d+)"', text)[1]) <= 390
    assert min(map(int, re.findall(r'font-size="(\d+)"', text))) >= 12
    assert "prefers-color-scheme:dark" in text
    assert "#fff" not in text


def test_a_folder_of_files_is_drawn_and_what_is_not_there_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / VEHICLES["x500"][1]
    path.parent.mkdir(parents=True)
    path.write_text(BOX)
    vehicles = {
        name: vehicle for name in ("x500", "X2") if (vehicle := read(name, tmp_path))
    }
    assert list(vehicles) == ["x500"]
    assert "X2: left out, no file" in capsys.readouterr().out
    text = drawing(vehicles)
    assert "1.25 kg, 0 rotors" in text
    assert text.count("<path") == 1
    assert public_vehicles.main(str(tmp_path / "none")) == 1
