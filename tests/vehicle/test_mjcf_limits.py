"""MJCF files whose models would take gigabytes or hours are refused: a process of their own compiles them."""

from __future__ import annotations

import time

import pytest

from skyarm.vehicle import VehicleError, mjcf
from skyarm.vehicle.vehicle_files import load_vehicle

ARM = (
    '<body name="base"><freejoint/><geom size="0.1"/>'
    '<body name="arm"><joint name="h"/><geom size="0.05"/>{}</body></body>'
)


def model(before: str = "", inside: str = "") -> str:
    return f"<mujoco>{before}<worldbody>{ARM.format(inside)}</worldbody></mujoco>"


def repeated(count: int, inner: str) -> str:
    return f'<replicate count="{count}">{inner}</replicate>'


HUGE = {
    "memory": model('<asset><hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/></asset>'),
    "time": model(inside=repeated(10_000_000, "<site/>")),
    "disk": model('<size nuser_body="10000000"/>'),  # so many numbers for each body
}


@pytest.mark.parametrize("name", HUGE)
def test_a_model_of_gigabytes_or_hours_is_refused_in_one_line(name, tmp_path, monkeypatch):
    monkeypatch.setattr(mjcf, "SECONDS", 6.0)
    file = tmp_path / "x.xml"
    file.write_text(HUGE[name])
    begin = time.process_time()
    with pytest.raises(VehicleError) as error:
        load_vehicle(file)
    assert time.process_time() - begin < 3.0
    assert str(error.value).startswith(f"{file}: MJCF = 'x.xml': must be a model that MuJoCo compiles in ")
    assert "\n" not in str(error.value)


def test_what_mujoco_refuses_there_is_told_in_its_words(tmp_path):
    file = tmp_path / "x.xml"
    file.write_text(model("<asset><mesh file='none.stl'/></asset>"))
    with pytest.raises(VehicleError, match=r"x\.xml: MJCF = .*none.*: must be a model that MuJoCo loads$"):
        load_vehicle(file)


def test_more_text_than_any_model_has_is_not_parsed(tmp_path):
    file = tmp_path / "x.xml"
    with file.open("wb") as stream:
        stream.truncate(int(mjcf.MOST_TEXT) + 1)
    with pytest.raises(VehicleError, match=r"x\.xml: XML: has 10 MB, must have at most 10 MB$"):
        load_vehicle(file)


def test_a_model_compiled_apart_is_the_same(tmp_path, monkeypatch):
    file = tmp_path / "x.xml"
    file.write_text(model())
    plain = load_vehicle(file)
    monkeypatch.setattr(mjcf, "PLAIN", ())
    assert load_vehicle(file) == plain


def test_what_real_models_repeat_and_include_is_read(tmp_path):
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "sites.xml").write_text("<mujocoinclude>" + "<site/>" * 10 + "</mujocoinclude>")
    (tmp_path / "assets" / "part.xml").write_text(
        '<mujoco><worldbody><body name="b"><joint name="k"/><geom size="0.1"/></body></worldbody></mujoco>'
    )
    assets = (
        '<size nkey="10" nuser_body="4" memory="10M"/><default><texture width="512" height="512"/></default><asset>'
        '<texture name="t" type="2d" builtin="checker"/><hfield name="h" nrow="300" ncol="300" size="1 1 1 1"/>'
        '<mesh name="m" builtin="sphere" params="3"/><model name="part" file="assets/part.xml"/></asset>'
        '<sensor><rangefinder camera="c"/><gyro site="s" nsample="10" delay="0.1"/></sensor>'
    )
    inside = (
        repeated(20, repeated(10, '<geom size="0.001"/>'))
        + '<include file="assets/sites.xml"/><site name="s"/>'
        + '<camera name="c" resolution="32 24"/><attach model="part" body="b" prefix="p_"/>'
    )
    file = tmp_path / "x.xml"
    file.write_text(model(assets, inside))
    assert [link.name for link in load_vehicle(file).links] == ["arm", "p_b"]
