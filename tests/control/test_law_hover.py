"""Every law of the ladder and every published law stands still where its model says it can, on any vehicle."""

from __future__ import annotations

import numpy as np
import pytest

import skyarm
from law_flights import RIVALS, STEPS, TOP, flown_to_the_end, hovering_scenario, scalars
from skyarm.actuation.hover import hover_trim
from skyarm.algebra import Quaternion, Vec3
from skyarm.sensors.measurement import Measurement
from thorough import sampled

ARM = "hummingbird_arm2_rotors"


@pytest.mark.parametrize("law", sampled([*STEPS, *RIVALS], 12, keep=("ct_ladder 3", "l1_adaptive lateral", "indi")))
def test_a_law_that_knows_its_vehicle_hovers_exactly(law):
    """Begun 2 cm beside: after 25 s the slowest pole, 1.4 rad/s, has left 1e-17 m; what remains is rounding.

    The adaptation of the sliding mode is a slower integrator, near 0.4 rad/s: it gets 80 s.
    """
    seconds = 80.0 if law == "kim2013" else 25.0
    state = flown_to_the_end(hovering_scenario(law, ARM, seconds=seconds, offset=0.02))
    assert np.abs([*state.position.x, *state.position.y]).max() < 1e-9
    assert abs(float(state.position.z[0]) - 2.0) < 1e-9
    assert np.abs([float(q[0]) - 0.3 / (i + 1) for i, q in enumerate(state.joints)]).max() < 1e-9
    assert max(abs(float(c[0])) for c in (*state.velocity, *state.rate)) < 1e-9


@pytest.mark.parametrize("law", [TOP, *RIVALS])
@pytest.mark.parametrize("vehicle", ["hummingbird", "hexarotor_arm6", "octo_coaxial_two_arms", "tilted_hexarotor"])
def test_at_rest_on_its_reference_a_law_asks_for_the_hover_trim_of_any_vehicle(law, vehicle):
    """The trim comes from statics, the laws from recursions: equal to rounding."""
    scenario = hovering_scenario(law, vehicle, seconds=1.0)
    flown = skyarm.load_vehicle(vehicle)
    joints = tuple(0.3 / (i + 1) for i in range(flown.n))
    trim = hover_trim(flown, joints, 9.81)
    still = (0.0,) * flown.n
    goal = scenario.trajectory.at(0.0)
    reading = Measurement(
        time=0.0,
        position=Vec3(0.0, 0.0, 2.0),
        quaternion=Quaternion(1.0, 0.0, 0.0, 0.0),
        velocity=Vec3(0.0, 0.0, 0.0),
        rate=Vec3(0.0, 0.0, 0.0),
        specific_force=Vec3(0.0, 0.0, 9.81),
        joints=joints,
        joint_rates=still,
        rotor_speeds=tuple(float(s) for s in trim.speeds),
    )
    controller = scenario.controller
    memory = controller.memory
    for _ in range(3):
        memory, command = controller.law(memory, reading, goal.dense(), 0.005, par=controller.par)
        np.testing.assert_allclose(scalars(command.rotor_speeds), scalars(trim.speeds), rtol=1e-9)
        np.testing.assert_allclose(scalars(command.efforts), scalars(trim.efforts), atol=1e-9)


@pytest.mark.parametrize(
    ("law", "vehicle"), [*((law, "hummingbird") for law in (TOP, *RIVALS)), (TOP, "hexarotor_arm6")]
)
def test_a_law_flies_a_bare_quadrotor_and_a_six_joint_arm(law, vehicle):
    """From 5 cm beside to a tenth of that in 4 s: no pole of the default gains is slower than 1 rad/s."""
    state = flown_to_the_end(hovering_scenario(law, vehicle, seconds=4.0, offset=0.05))
    assert abs(float(state.position.x[0])) < 0.005
    assert abs(float(state.position.z[0]) - 2.0) < 0.005
