"""Laws and endings see pictures: which one, at which instant, and the same flight on
every engine.
"""

import dataclasses
import re

import numpy as np
import pytest

import skyarm
from skyarm.algebra.scalars import where
from skyarm.control.controller import ControllerError
from skyarm.control.law_checks import LawError
from skyarm.control.safety.limits import USUAL, law_stiffness
from skyarm.scenario.scenario_file import scenario_from
from skyarm.simulate.eyes import Eyes
from skyarm.simulate.first_state import first_loop_state
from skyarm.simulate.loop import run_in_python
from skyarm.studies.assess.along_reference import met_at_start
from support.flights import shared_programs

EVERY, LATE, RATE = 10, 3, 100

FLIGHT = scenario_from(
    {
        "schema": 1,
        "name": "look_down",
        "duration": 0.6,
        "rates": {"physics": 200, "control": RATE, "reference": RATE},
        "plant": {"vehicle": "hummingbird"},
        "controller": {"law": "decoupled_pd"},
        "initial": {"position": [0.0, 0.0, 1.3], "velocity": [0.3, 0.2, 0.0]},
        "reference": {"base": {"kind": "hover", "position": [0.2, 0.0, 1.5]}},
        "sensors": {
            "down": {
                "kind": "depth_camera",
                "rpy": [0.0, np.pi / 2.0, 0.0],
                "width": 3,
                "height": 1,
                "frequency": RATE / EVERY,
                "latency": LATE / RATE,
            }
        },
        "world": {
            "points": [{"name": "foot", "body": "base"}],
            "surfaces": [{"name": "ground", "shape": "plane"}],
        },
    }
)
PLAIN = FLIGHT.agent.controller


@pytest.fixture(autouse=True, scope="module")
def _shared():
    with shared_programs():
        yield


def turned(memory, seen, wanted, dt, *, par):
    """The law without pictures, with rotors that turn slower the higher it flies."""
    (image,) = seen.images
    memory, command = PLAIN.law(memory, seen, wanted, dt, par=par)
    less = image.depth[1] + image.time
    speeds = tuple(speed - less for speed in command.rotor_speeds)
    return memory, dataclasses.replace(command, rotor_speeds=speeds)


def flight(**law):
    given = {"name": "turned", "law": turned, "sees": ("down",), **law}
    return FLIGHT.with_controller(dataclasses.replace(PLAIN, **given))


def arrived(tick):
    """Control period of the picture that is there in another."""
    return max(0, (tick - LATE) // EVERY) * EVERY


def heights(log):
    """Way straight down from the base to the ground, in its own axes."""
    w, x, y, z = log.quaternion.T
    return log.position[:, 2] / (w * w - x * x - y * y + z * z)


def test_a_law_has_the_newest_picture_that_has_arrived():
    seen = []

    def law(memory, measured, wanted, dt, *, par):
        seen.append(measured.images[0])
        return PLAIN.law(memory, measured, wanted, dt, par=par)

    log = skyarm.run(flight(law=law, compiled=False))
    down = heights(log)
    for k, image in enumerate(seen):
        assert image.time == arrived(k) / RATE
        np.testing.assert_allclose(image.depth[1], down[arrived(k)], atol=1e-12)
        assert (image.sensor, image.rows, image.columns) == ("down", 1, 3)
    assert len(seen) == 60
    # what is seen and not used changes nothing
    np.testing.assert_array_equal(log.position, skyarm.run(FLIGHT).position)


def test_all_engines_fly_what_is_seen():
    log = skyarm.run(flight())
    assert not np.array_equal(log.position, skyarm.run(FLIGHT).position)
    called = skyarm.run(flight(compiled=False))
    for other in (run_in_python(flight()), called):
        np.testing.assert_array_equal(other.position, log.position)
    session = skyarm.Session(flight())
    # between the instant of a picture and its arrival
    while session.tick < EVERY + 1:
        session.step()
    before = session.snapshot()
    (image,) = session.measurement.images
    assert image.time == 0.0
    while session.step():
        pass
    np.testing.assert_array_equal(session.log.position, log.position)
    session.restore(before)
    session.run()
    np.testing.assert_array_equal(session.log.position, log.position)


def test_a_picture_outlives_a_change():
    changed = {"controller.gains.position.z": 9.0}
    session = skyarm.Session(flight())
    while session.tick < EVERY + 1:
        session.step()
    session.change(changed)
    (image,) = session.measurement.images
    assert image.time == 0.0
    while session.tick < EVERY + LATE:
        session.step()
    (image,) = session.measurement.images
    assert image.time == EVERY / RATE
    log = session.run()
    np.testing.assert_array_equal(skyarm.run(session.plan).position, log.position)


@dataclasses.dataclass(frozen=True, kw_only=True)
class TooHigh(skyarm.Ending):
    """Ends a flight whose camera sees the ground far away."""

    limit: float
    status = "too_high"
    sees = ("down",)

    def fine(self, scenario, state, goal, slack, images=()):
        return where(images[0].depth[1] < self.limit, 1.0, 0.0) > 0.5


def test_an_ending_sees_what_has_arrived():
    down = heights(skyarm.run(FLIGHT))
    seen = np.array([down[arrived(k)] for k in range(len(down))])
    ended = dataclasses.replace(FLIGHT, endings=(TooHigh(limit=seen[40]),))
    log = skyarm.run(ended)
    assert log.status == "too_high"
    assert log.info["end_time"] == np.flatnonzero(seen >= seen[40])[0] / RATE
    with pytest.raises(ValueError, match=r"endings\[0\]: sees down, a batch has no"):
        skyarm.Batch(ended)


def test_an_ending_that_sees_is_not_asked_before_there_are_pictures():
    assert not met_at_start(dataclasses.replace(FLIGHT, endings=(TooHigh(limit=0.0),)))


def test_what_has_no_pictures_says_so():
    words = "controller 'turned': sees down, a batch has no pictures; fly it by"
    with pytest.raises(ControllerError, match=re.escape(words)):
        skyarm.Batch(flight())
    with pytest.raises(ControllerError, match="a margin has no pictures"):
        skyarm.margins(flight())
    words = "controller: sees = 'dwn': did you mean 'down'"
    with pytest.raises(ValueError, match=words):
        skyarm.run(flight(sees=("dwn",)))
    bare = FLIGHT.with_agent(dataclasses.replace(FLIGHT.agent, sensors=()))
    words = r"sees = 'down': must be a table \[sensors.down\] with kind = \"depth"
    with pytest.raises(ValueError, match=words):
        skyarm.run(bare.with_controller(flight().agent.controller))
    with pytest.raises(LawError, match="sees 'down': scenario 'case3' must have this"):
        skyarm.check_law(flight().agent.controller)
    skyarm.check_law(flight())
    with pytest.raises(ValueError, match="must be a list of cameras, each once"):
        skyarm.run(flight(sees=("down", "down")))


def pixel_99(memory, seen, wanted, dt, *, par):
    """Law that reads a pixel which three columns have not."""
    return memory, seen.images[0].depth[99]


def width(memory, seen, wanted, dt, *, par):
    """Law that reads a field which no picture has."""
    return memory, seen.images[0].width


@pytest.mark.parametrize(
    ("law", "words"),
    [
        ({"law": pixel_99}, "reads beyond a tuple; its images: 'down', 3 pixels"),
        (
            {"law": pixel_99, "sees": ()},
            r'reads beyond a tuple; its images: none, must state sees = \["SENSOR"\]',
        ),
        ({"law": width}, "law 'turned' reads 'width' of Image: .*rows, columns, sens"),
    ],
)
def test_a_law_that_reads_what_no_picture_has_is_one_line(law, words):
    with pytest.raises(LawError, match=words):
        skyarm.run(flight(**law))


class NoImages(TooHigh):
    def fine(self, scenario, state, goal, slack):
        return True


class Another(TooHigh):
    def fine(self, scenario, state, goal, slack, images=()):
        return images[1].depth[0] < self.limit


class Unseeing(Another):
    sees = ()


class Branching(TooHigh):
    def fine(self, scenario, state, goal, slack, images=()):
        return bool(images[0].depth[1] < self.limit)


class Letters(TooHigh):
    sees = "down"


@pytest.mark.parametrize(
    ("ending", "words"),
    [
        (NoImages, "sees down, its fine takes no images: must be fine(self, sc"),
        (Another, "(Another) reads beyond a tuple; its images: 'down', 3 pixels"),
        (Unseeing, "(Unseeing) reads beyond a tuple; its images: none, must state"),
        (Branching, "(Branching) cannot be traced: branch on a traced value"),
        (Letters, "endings[0]: sees = 'down': must be a list of cameras, each once"),
    ],
)
def test_an_ending_that_sees_wrongly_is_one_line(ending, words):
    ended = dataclasses.replace(FLIGHT, endings=(ending(limit=2.0),))
    with pytest.raises(ValueError, match=re.escape(words)) as error:
        skyarm.run(ended)
    assert str(error.value).count("test_pictures_in_flight.py") <= 1


def test_safety_takes_a_law_that_sees_for_a_usual_one():
    assert law_stiffness(flight().agent.controller) == USUAL


def test_members_of_a_team_see_each_other(tmp_path):
    vehicle = 'schema = 1\nname = "seen"\ntitle = "Seen"\nairframe = "hummingbird"\n'
    vehicle += '[[collisions]]\nname = "hull"\nshape = "sphere"\nsize = [0.06]\n'
    (tmp_path / "seen.toml").write_text(vehicle)

    def member(x, yaw):
        return {
            "plant": {"vehicle": str(tmp_path / "seen.toml")},
            "controller": {"law": "decoupled_pd"},
            "initial": {
                "position": [x, 0.0, 1.0],
                "quaternion_wxyz": [np.cos(yaw / 2.0), 0.0, 0.0, np.sin(yaw / 2.0)],
            },
            "reference": {
                "base": {"kind": "hover", "position": [x, 0.0, 1.0]},
                "yaw": yaw,
            },
            "sensors": {"front": {"kind": "depth_camera", "width": 3, "height": 3}},
        }

    team = scenario_from(
        {
            "schema": 1,
            "name": "two",
            "duration": 0.1,
            "rates": {"physics": 200, "control": RATE, "reference": RATE},
            "agents": {"left": member(0.0, 0.0), "right": member(0.8, np.pi)},
        }
    )
    eyes, first = Eyes(team), first_loop_state(team)
    for name, other in (("left", "right"), ("right", "left")):
        frame = eyes.frame(f"{name}.front", first, 0.0, 0)
        assert frame.names[frame.segment[1, 1]] == f"{other}.base"
        np.testing.assert_allclose(frame.depth[1, 1], 0.8 - 0.06, atol=1e-9)
