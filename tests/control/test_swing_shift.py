"""The base's shift under a swinging arm: it keeps the tip of a linear vehicle, and of a flown one in a side wind."""

import dataclasses

import numpy as np
import pytest

import skyarm
from skyarm.algebra import Vec3
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.attitude import Posture
from skyarm.control.catalogue import preset
from skyarm.control.laws.centroidal.shift_motion import SwingPace, levers, shift_for_swing, swing_pace
from skyarm.control.model import Model
from skyarm.log.metrics.windows import Window, Windows
from skyarm.reference import Sine, hover
from skyarm.world import ForceWind

TIP = "ee_error_mean_continuous"
G, W, SIGMA, MEAN, SWING = 9.81, 12.0, 0.2, 0.3, 0.02


def hanging(t, w=W, mean=MEAN):
    """A posture whose tip hangs at mean + swing sin(w t) below a centre of mass in the base's origin."""
    values = [mean + SWING * np.sin(w * t)]
    values += [SWING * w**k * np.sin(w * t + 0.5 * np.pi * k) for k in (1, 2, 3, 4)]
    still = Taylor((0.0,) * 5)
    return Posture(Vec3(still, still, still), Vec3(still, still, Taylor.of_derivatives([-v for v in values])), ())


def shifted(t, w=W, mean=MEAN):
    """The shift at a time, and what each instant asks for: sideways along y, -sigma times the tip's height."""
    level = hanging(t, w, mean)
    needed = [Vec3(0.0, SIGMA * each, 0.0) for each in levers(level)[:3]]
    pace = SwingPace(rate=0.5 * (SWING * w) ** 2, acceleration=0.5 * (SWING * w * w) ** 2)
    return shift_for_swing(pace, needed, level, G), needed


def test_the_tip_of_the_linear_vehicle_stays_on_its_reference():
    """c - (lambda / g) c'' is the shift that each instant asks for; the shift itself would miss it by r = 4.4."""
    times = np.linspace(0.0, 2 * np.pi / W, 40)
    found = [shifted(t) for t in times]
    missed = [s.offset[0].y - MEAN / G * s.offset[2].y - n[0].y for s, n in found]
    plain = [-MEAN / G * n[2].y for _, n in found]
    # first order in the swing: its square, and 1 % of SHORT
    assert max(map(abs, missed)) < 0.03 * max(map(abs, plain))
    assert all(s.offset[0].x == 0.0 and s.offset[0].z == 0.0 for s, _ in found)


def test_its_derivatives_are_those_of_one_motion():
    e, t = 1e-4, 0.13
    (after, _), (before, _), (now, _) = shifted(t + e), shifted(t - e), shifted(t)
    rows = [[s.offset[0].y, s.offset[1].y, s.offset[2].y - s.steady.y, s.jerk.y] for s in (after, before)]
    slopes = [(a - b) / (2 * e) for a, b in zip(*rows, strict=True)]
    expected = [now.offset[1].y, now.offset[2].y, now.jerk.y, now.snap.y]
    # the tilt is held while the height changes: a share of 2 swing / mean of each
    assert slopes == pytest.approx(expected, rel=0.2, abs=1e-4)


@pytest.mark.parametrize("w", [1.0, np.sqrt(G / MEAN), 30.0])
def test_an_arm_above_the_base_passes_its_resonance(w):
    found, needed = shifted(0.3, w, -MEAN)
    r = levers(hanging(0.3, w, -MEAN))[0] * w * w / G
    share = (1 + r) / ((1 + r) ** 2 + 0.25 * r * r)
    swing = found.offset[2].y - found.steady.y
    assert swing == pytest.approx(share * (needed[2].y - found.steady.y), rel=1e-3, abs=1e-3)
    assert needed[2].y - found.steady.y == pytest.approx(needed[2].y, rel=0.02)


def test_the_pace_of_a_sine_is_its_frequency():
    memory, dt = SwingPace(rate=0.0, acceleration=0.0), 0.005
    for k in range(800):
        memory = swing_pace(memory, levers(hanging(k * dt)), 2.0, dt)
    assert np.sqrt(memory.acceleration / memory.rate) == pytest.approx(W, rel=0.1)


def swung(**options):
    """Tip error of a swinging arm in 2 N from the side, mm."""
    scenario = skyarm.load_scenario("case3", duration=6.0)
    joints = tuple(Sine(amplitude=0.5, frequency_hz=1.0, phase=phase) for phase in (0.0, 0.9))
    motion = dataclasses.replace(hover((0.0, 0.0, 1.5)), joints=joints)
    model = Model(vehicle=scenario.plant.vehicle, gravity=scenario.plant.gravity)
    controller = preset("centroidal_tip", model, options)
    scenario = dataclasses.replace(
        scenario, reference=motion, controller=controller, wind=ForceWind(force_W=Vec3(0.0, 2.0, 0.0))
    )
    windows = Windows(steady=Window(4.0, 6.0), gust=Window(4.0, 6.0), last=2.0)
    log = skyarm.run(dataclasses.replace(scenario, windows=windows))
    return 1e3 * skyarm.score(log, [TIP])[TIP]


def test_the_tip_of_a_swinging_arm_stays_in_a_wind_from_the_side():
    assert swung() < 5.0
    assert swung(swing_rate=0.0) > 25.0


def test_an_arm_at_rest_shifts_as_each_instant_asks():
    still = Taylor((0.0,) * 5)
    level = Posture(Vec3(still, still, still), Vec3(still, still, Taylor((-0.3, 0.0, 0.0, 0.0, 0.0))), ())
    needed = [Vec3(0.01, 0.06, 0.002), Vec3(0.1, 0.2, 0.3), Vec3(1.0, 2.0, 3.0)]
    found = shift_for_swing(SwingPace(rate=0.0, acceleration=0.0), needed, level, G)
    assert list(found.offset) == needed
    assert found.steady == needed[2]
    assert (found.jerk.norm(), found.snap.norm()) == (0.0, 0.0)
