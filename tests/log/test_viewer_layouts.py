"""Layouts for Foxglove and PlotJuggler: all that they name stands in the file that they are for."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET

import pytest

import skyarm
from logged_flights import drawn, flown
from skyarm.log.viewer_layouts import FOXGLOVE, PLOTJUGGLER, foxglove, plots, write_layouts
from thorough import sampled


def fields(log, folder):
    """Topic and every field of its messages, as an independent reader finds them: /tip/point/x."""
    reader = pytest.importorskip("mcap.reader", reason="needs the extra 'test'")
    decoder = pytest.importorskip("mcap_ros2.decoder", reason="needs the extra 'test'")
    found, topics = set(), set()
    with skyarm.save_log(log, folder / "flight.mcap").open("rb") as stream:
        reading = reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
        for _, channel, _, message in reading.iter_decoded_messages():
            if channel.topic not in topics:
                topics.add(channel.topic)
                found |= set(leaves(message, channel.topic))
    return topics, found


def leaves(message, path):
    for name in getattr(message, "__slots__", ()):
        value = getattr(message, name)
        if isinstance(value, float):
            yield f"{path}/{name}"
        else:
            yield from leaves(value, f"{path}/{name}")


@pytest.mark.parametrize("name", sampled(["flown", *skyarm.list_vehicles()], 6))
def test_every_topic_and_field_that_a_layout_names_is_written(name, tmp_path):
    log = flown() if name == "flown" else drawn(skyarm.load_vehicle(name), count=5)
    topics, known = fields(log, tmp_path)
    assert [path.name for path in write_layouts(log, tmp_path / "layouts")] == [FOXGLOVE, PLOTJUGGLER]
    layout = json.loads((tmp_path / "layouts" / FOXGLOVE).read_text())
    panels = layout["configById"]
    paths = [path["value"].replace(".", "/") for panel in panels.values() for path in panel.get("paths", ())]
    assert set(paths) <= known
    assert set(panels["3D!vehicle"]["topics"]) <= topics
    document = ET.parse(tmp_path / "layouts" / PLOTJUGGLER)
    curves = [curve.get("name") for curve in document.iter("curve")]
    assert set(curves) <= known
    assert sorted(curves) == sorted(paths)
    joints = len(drawn_joints := [c for c in curves if "/joint_effort_" in c or "/joint_setpoint_" in c])
    assert joints == log.joints.shape[1], drawn_joints


def test_every_panel_has_one_place(tmp_path):
    layout = foxglove(plots(flown()))

    def placed(node):
        return [node] if isinstance(node, str) else [*placed(node["first"]), *placed(node["second"])]

    names = placed(layout["layout"])
    assert sorted(names) == sorted(layout["configById"])
    assert len(set(names)) == len(names) == 9


def test_every_splitter_says_how_many_parts_it_has(tmp_path):
    write_layouts(flown(), tmp_path)
    document = ET.parse(tmp_path / PLOTJUGGLER)
    splitters = list(document.iter("DockSplitter"))
    assert len(splitters) == 3
    for each in splitters:
        assert int(each.get("count")) == len(list(each)) == len(each.get("sizes").split(";"))
