"""MJCF files of a few words whose models would take gigabytes or hours are refused before MuJoCo sees them."""

from __future__ import annotations

import struct
import time

import pytest

from skyarm.vehicle import VehicleError
from skyarm.vehicle.mjcf_sizes import MOST_DATA, MOST_ELEMENTS, MOST_TEXT
from skyarm.vehicle.vehicle_files import load_vehicle

ARM = (
    '<body name="base"><freejoint/><geom size="0.1"/>'
    '<body name="arm"><joint name="h"/><geom size="0.05"/>{}</body></body>'
)

ELEMENTS, NUMBERS = "must be at most 5000 in the file", "must be at most 20000000 in the file"


def model(before: str = "", inside: str = "") -> str:
    return f"<mujoco>{before}<worldbody>{ARM.format(inside)}</worldbody></mujoco>"


def repeated(count: int, inner: str) -> str:
    return f'<replicate count="{count}">{inner}</replicate>'


HUGE = {
    "height field": (model('<asset><hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/></asset>'), NUMBERS),
    "height fields": (
        model("<asset>" + '<hfield nrow="1500" ncol="1500" size="1 1 1 1"/>' * 3 + "</asset>"),
        f"<hfield>: 2.7e+07 numbers up to here, {NUMBERS}",
    ),
    "replicate": (model(inside=repeated(1_000_000, "<site/>")), f"<site>: 1e+06 elements up to here, {ELEMENTS}"),
    "nested replicates": (model(inside=repeated(100, repeated(100, "<site/>"))), ELEMENTS),
    "bodies": (model(inside="<site/>" * MOST_ELEMENTS), ELEMENTS),
    "texture": (model('<asset><texture type="2d" builtin="flat" width="5000" height="5000"/></asset>'), NUMBERS),
    "sky": (model('<asset><texture type="skybox" builtin="flat" width="5000"/></asset>'), NUMBERS),
    "texture by default": (
        model('<default><texture builtin="flat" width="5000" height="5000"/></default><asset><texture/></asset>'),
        NUMBERS,
    ),
    "picture": (model('<asset><texture type="2d" file="big.png"/></asset>'), NUMBERS),
    "heights in a picture": (
        model('<compiler assetdir="deeper"/><asset><hfield file="../big.png" size="1 1 1 1"/></asset>'), NUMBERS
    ),
    "meshes": (
        model("<asset>" + '<mesh file="large.stl"/>' * 3 + "</asset>"), "bytes of files up to here, must be at most"
    ),
    "built-in mesh": (model('<asset><mesh builtin="wedge" params="400 400 90 90 0.1"/></asset>'), NUMBERS),
    "keyframes": (model('<size nkey="100000"/>'), "<size>: 1e+05 keyframes up to here, must be at most 5000"),
    "user's numbers": (model('<size nuser_body="10000000"/>'), NUMBERS),
    "user data": (model('<size nuserdata="100000000"/>'), NUMBERS),
    "numeric": (model('<custom><numeric name="n" size="100000000" data="1"/></custom>'), NUMBERS),
    "user's sensor": (model('<sensor><user dim="100000000"/></sensor>'), NUMBERS),
    "sensor's samples": (model('<sensor><clock nsample="10000000" delay="1"/></sensor>'), NUMBERS),
    "contact sensor": (model('<sensor><contact num="1000" nsample="1000" delay="1"/></sensor>'), NUMBERS),
    "sensors that copies double": (model("<sensor><clock/></sensor>", repeated(30, "<site/>")), ELEMENTS),
    "camera's pixels": (
        model('<sensor><rangefinder camera="c"/></sensor>', '<camera name="c" resolution="5000 5000"/>'), NUMBERS
    ),
    "actuator's states": (
        model('<actuator><general joint="h" actdim="100000000" dyntype="user"/></actuator>'), NUMBERS
    ),
    "range of length": (
        model(
            '<compiler><lengthrange mode="all" inttotal="10000" timestep="0.0001"/></compiler>'
            '<actuator><motor joint="h"/></actuator>'
        ),
        "elements times steps to find ranges of length",
    ),
    "flexible": (model(inside='<flexcomp type="grid" count="500 500 500" name="f"/>'), "must be rigid bodies only"),
    "composite": (model(inside='<composite type="cable" count="1000000 1 1"/>'), "must be rigid bodies only"),
    "included": (model(inside=repeated(1000, '<include file="deeper/ten.xml"/>')), ELEMENTS),
    "attached": (
        model('<asset><model name="m" file="a00.xml"/></asset>', '<attach model="m" body="b" prefix="p"/>'), ELEMENTS
    ),
    "attached to itself": (
        model('<asset><model name="m" file="x.xml"/></asset>', '<attach model="m" body="base" prefix="p"/>'), ELEMENTS
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", HUGE)
def test_a_model_of_gigabytes_or_hours_is_refused_at_once(name, tmp_path):
    text, message = HUGE[name]
    file = tmp_path / "x.xml"
    file.write_text(text)
    (tmp_path / "deeper").mkdir()
    (tmp_path / "deeper" / "ten.xml").write_text("<mujocoinclude>" + "<site/>" * 10 + "</mujocoinclude>")
    header = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", 30_000, 30_000)
    (tmp_path / "big.png").write_bytes(header)
    with (tmp_path / "large.stl").open("wb") as stream:
        stream.truncate(int(0.4 * MOST_DATA))
    # each attaches the next one twice: 2^30 bodies
    for k in range(30):
        inner = '<attach model="m" body="b" prefix="l"/><attach model="m" body="b" prefix="r"/>'
        asset = f'<asset><model name="m" file="a{k + 1:02d}.xml"/></asset>'
        body = f'<body name="b"><geom size="1"/>{inner}</body>'
        (tmp_path / f"a{k:02d}.xml").write_text(f"<mujoco>{asset}<worldbody>{body}</worldbody></mujoco>")
    begin = time.process_time()
    with pytest.raises(VehicleError) as error:
        load_vehicle(file)
    assert time.process_time() - begin < 3.0
    assert str(error.value).startswith(f"{file}: <")
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_more_text_than_any_model_has_is_not_parsed(tmp_path):
    file = tmp_path / "x.xml"
    with file.open("wb") as stream:
        stream.truncate(int(MOST_TEXT) + 1)
    with pytest.raises(VehicleError, match=r"x\.xml: XML: has 10 MB, must have at most 10 MB$"):
        load_vehicle(file)
    (tmp_path / "outer.xml").write_text(model(inside='<include file="x.xml"/>'))
    with pytest.raises(VehicleError, match=r"<include>: 10000\d+ bytes of XML up to here, must be at most 10000000"):
        load_vehicle(tmp_path / "outer.xml")


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


HIDDEN = "".join(["<mujoco><worldbody>", ARM.format(repeated(6000, "<site/>")), "</worldbody></mujoco>"]).replace(
    '"', "'"
)

READ_BY_MUJOCO_ALONE = {
    "a DOCTYPE": (
        f'<!DOCTYPE mujoco [<!ENTITY a ">{HIDDEN}<!--"> ]><mujoco>harmless</mujoco><!-- -->',
        "XML: has a DOCTYPE, must have none",
    ),
    "an unbound prefix": (
        f'<mujocoinclude x:y="1">{repeated(6000, "<site/>")}</mujocoinclude>',
        "XML = 'unbound prefix.*must be well-formed",
    ),
    "a namespace": (
        f'<mujocoinclude xmlns="u">{repeated(6000, "<site/>")}</mujocoinclude>',
        "XML: has elements of a namespace, must have none",
    ),
}


@pytest.mark.parametrize("name", READ_BY_MUJOCO_ALONE)
@pytest.mark.parametrize("outer", ["itself", "included", "attached"])
def test_a_file_that_mujoco_reads_otherwise_is_refused(name, outer, tmp_path):
    text, message = READ_BY_MUJOCO_ALONE[name]
    file = tmp_path / "x.xml"
    file.write_text(
        {
            "itself": text,
            "included": model(inside='<include file="part.xml"/>'),
            "attached": model(
                '<asset><model name="m" file="part.xml"/></asset>', '<attach model="m" body="base" prefix="p"/>'
            ),
        }[outer]
    )
    (tmp_path / "part.xml").write_text(text)
    where = "" if outer == "itself" else "file = 'part.xml': "
    with pytest.raises(VehicleError, match=rf"x\.xml: {where}{message}"):
        load_vehicle(file)
