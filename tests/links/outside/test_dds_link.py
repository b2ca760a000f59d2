"""PX4 by uXRCE-DDS: flights of a law that commands motors, by a stand-in whose types and encoder are another hand's."""

import dataclasses
import math
import time

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="needs the extra 'ros'")

from commanded import skyarm
from links.outside.dds_stand_in import DdsStandIn
from links.outside.test_offboard import SCENARIO
from skyarm import load_scenario
from skyarm.links.outside import offboard
from skyarm.links.outside.autopilot_link import open_link
from skyarm.links.outside.dds_link import DdsLink, parse_domain
from skyarm.links.outside.joint_port import NoJoints
from skyarm.links.outside.offboard import OffboardFlight, OffboardSettings
from skyarm.links.outside.offboard_link import OffboardError

DOMAIN = 96

SETTINGS = OffboardSettings(patience=5.0, stale=0.2)


@pytest.fixture(autouse=True)
def hurry(monkeypatch):
    monkeypatch.setattr(offboard, "LEAD", 0.1)
    monkeypatch.setattr(offboard, "TAKE_OVER", 1.0)
    monkeypatch.setattr(offboard, "MODE_KNOWN", 0.3)


@pytest.fixture
def scenario(tmp_path):
    def make(duration=1.5):
        file = tmp_path / "step.toml"
        file.write_text(SCENARIO.format(duration=duration))
        return load_scenario(str(file))

    return make


def flown(scenario, settings=SETTINGS, space="", **faults):
    """Log of a flight with a stand-in, and the stand-in."""
    link = open_link(f"dds://{DOMAIN}{space}")
    try:
        with DdsStandIn(0, vehicle=scenario.plant.vehicle, domain=DOMAIN, space=space, **faults) as peer:
            log = OffboardFlight(scenario, link, NoJoints(), settings).run()
            time.sleep(0.3)
    finally:
        link.close()
    return log, peer


@pytest.mark.parametrize(("space", "mixed"), [("", False), ("/px4_1", True)])
def test_the_law_turns_the_motors_and_flies_its_reference(scenario, space, mixed):
    """The stand-in's own path, in north, east, down, is the reference turned by its heading."""
    log, peer = flown(scenario(3.0), space=space, mixed=mixed)
    assert (log.status, log.info["cause"]) == ("completed", "")
    moved = np.array(peer.path[-1]) - peer.place
    x, y, z = (log.position_reference[-1] - log.position_reference[0]).tolist()
    c, s = math.cos(peer.heading), math.sin(peer.heading)
    assert moved == pytest.approx([c * x + s * y, s * x - c * y, -z], abs=0.12)
    assert peer.modes == ["offboard", "hold"]
    assert peer.seen.count("actuator_motors") == peer.seen.count("offboard_control_mode") > 100
    assert np.linalg.norm(log.position - log.position_reference, axis=1)[-50:].max() < 0.1
