"""MJCF files with generated, included and attached elements, and errors of MuJoCo's
compiler.
"""

from __future__ import annotations

import pytest

from skyarm.vehicle import VehicleError
from skyarm.vehicle.vehicle_files import load_vehicle

ARM = (
    '<body name="base"><freejoint/><geom size="0.1"/>'
    '<body name="arm"><joint name="h"/><geom size="0.05"/>{}</body></body>'
)


def model(before: str = "", inside: str = "") -> str:
    return f"<mujoco>{before}<worldbody>{ARM.format(inside)}</worldbody></mujoco>"


def repeated(count: int, inner: str) -> str:
    return f'<replicate count="{count}">{inner}</replicate>'


def test_an_error_of_mujoco_is_one_line(tmp_path):
    file = tmp_path / "x.xml"
    file.write_text(model("<asset><mesh file='none.stl'/></asset>"))
    with pytest.raises(
        VehicleError,
        match=r"x\.xml: MJCF = .*none.*: must be a model that MuJoCo loads, with",
    ):
        load_vehicle(file)


def test_what_real_models_repeat_and_include_is_read(tmp_path):
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "sites.xml").write_text(
        "<mujocoinclude>" + "<site/>" * 10 + "</mujocoinclude>"
    )
    (tmp_path / "assets" / "part.xml").write_text(
        '<mujoco><worldbody><body name="b"><joint name="k"/><geom'
        ' size="0.1"/></body></worldbody></mujoco>'
    )
    assets = (
        '<size nkey="10" nuser_body="4" memory="10M"/><default><texture width="512"'
        ' height="512"/></default><asset><texture name="t" type="2d"'
        ' builtin="checker"/><hfield name="h" nrow="300" ncol="300" size="1 1 1'
        ' 1"/><mesh name="m" builtin="sphere" params="3"/><model name="part"'
        ' file="assets/part.xml"/></asset><sensor><rangefinder camera="c"/><gyro'
        ' site="s" nsample="10" delay="0.1"/></sensor>'
    )
    inside = (
        repeated(20, repeated(10, '<geom size="0.001"/>'))
        + '<include file="assets/sites.xml"/><site name="s"/>'
        + '<camera name="c" resolution="32 24"/><attach model="part" body="b"'
        ' prefix="p_"/>'
    )
    file = tmp_path / "x.xml"
    file.write_text(model(assets, inside))
    assert [link.name for link in load_vehicle(file).links] == ["arm", "p_b"]
