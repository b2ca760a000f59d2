"""Steps of the Stoermer-Verlet method near contact: their order, what they keep, and
where they are taken.
"""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import skyarm
from skyarm.algebra import Vec3
from skyarm.dynamics.actuators import Command
from skyarm.dynamics.energy import kinetic_energy
from skyarm.log.metrics.windows import Windows
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth
from skyarm.plant.largest_step import (
    check_largest_step,
    lanes_step,
    largest_stable_step,
    verlet_step,
)
from skyarm.plant.rigid_body import coupled_rk4, coupled_verlet
from skyarm.plant.surroundings import Surroundings
from skyarm.records.leaves import leaves
from skyarm.reference import Sine
from skyarm.simulate.first_state import first_loop_state, first_surroundings
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.world import Force, SignalVector
from skyarm.world.component import Wrench
from skyarm.world.contact import (
    Contact,
    ContactPoint,
    FreeObject,
    Gripper,
    Material,
    Surface,
)
from support.one_vehicle import after_step, together
from support.worlds import around, at_rest, ground, limp

BIRD, ARM = limp(), limp("hummingbird_arm2_rotors")
MASS = float(BIRD.mass)
UNDER = (ContactPoint(name="below", body="base", position=Vec3(0.0, 0.0, -0.12)),)
SPRING = ground(stiffness=2000.0, dissipation=0.0, friction=0.0)


def fly(law, vehicle, state, surroundings, seconds, count, gravity=9.8, efforts=0.0):
    """State and coupled memories after so many steps of a method."""
    world = Truth(vehicle=vehicle, gravity=gravity)
    command = Command(
        rotor_speeds=(0.0,) * len(vehicle.rotors), efforts=(efforts,) * vehicle.n
    )
    surroundings = together(surroundings)
    for _ in range(count):
        state, memories = after_step(
            law, world, state, command, surroundings, seconds / count
        )
        surroundings = surroundings.with_coupled(memories)
    return state, surroundings.coupled_memories()


def errors(vehicle, state, surroundings, seconds, counts, true):
    """Largest distance of the leaves of a state from the true ones, for each number of
    steps.
    """
    found = [
        leaves(fly(coupled_verlet, vehicle, state, surroundings, seconds, n, 0.0)[0])
        for n in counts
    ]
    return [np.abs(np.array(each, dtype=float) - true).max() for each in found]


def test_a_mass_on_a_spring_swings_as_in_closed_form_with_an_error_of_second_order():
    """z = z_0 cos w t about the rest, 5 mm deep: Hooke's law and nothing else."""
    rest, amplitude, w = MASS * 9.8 / 2000.0, 1e-3, math.sqrt(2000.0 / MASS)
    start = at_rest(BIRD, (0.0, 0.0, 0.12 - rest - amplitude))
    off = []
    for count in (50, 100):
        after, _ = fly(
            coupled_verlet, BIRD, start, around(SPRING, points=UNDER), 0.1, count
        )
        off.append(
            float(after.position.z) - (0.12 - rest - amplitude * math.cos(0.1 * w))
        )
    assert abs(off[1]) < 1e-6
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.02)


def test_the_energy_of_a_spring_does_not_drift_and_the_step_is_its_own_inverse():
    """After 300 steps at w h = 0.42 as after 50; backwards it comes to where it
    began.
    """
    rest = MASS * 9.8 / 2000.0
    start = at_rest(BIRD, (0.0, 0.0, 0.12 - rest - 1e-3))
    w = math.sqrt(2000.0 / MASS)
    step, told = 0.42 / w, around(SPRING, points=UNDER)

    def energy(state):
        return (
            0.5 * MASS * float(state.velocity.z) ** 2
            + 1000.0 * (0.12 - rest - float(state.position.z)) ** 2
        )

    state, found = start, []
    for _ in range(300):
        state, _ = fly(coupled_verlet, BIRD, state, told, step, 1)
        found.append(energy(state))
    assert max(found[-50:]) == pytest.approx(max(found[:50]), rel=0.01)
    assert min(found) > 0.9 * energy(start)
    turned = dataclasses.replace(start, velocity=Vec3(0.0, 0.0, -0.02))
    there, _ = fly(coupled_verlet, BIRD, turned, told, step, 1)
    back, _ = fly(
        coupled_verlet,
        BIRD,
        dataclasses.replace(there, velocity=-there.velocity),
        told,
        step,
        1,
    )
    # the depth is a mean over the way of the velocity before the push: nothing of it 5
    # mm deep
    assert [*back.position] == pytest.approx([*turned.position], abs=1e-12)
    assert [*back.velocity] == pytest.approx([*-turned.velocity], abs=1e-12)


def test_gyroscopic_and_centrifugal_terms_are_of_second_order():
    """A tumbling vehicle whose arm swings, against Runge-Kutta's method in steps of 0.1
    ms.
    """
    start = at_rest(ARM, (0.0, 0.0, 5.0), (-0.45, -0.9), velocity=Vec3(0.3, -0.2, 0.1))
    start = dataclasses.replace(
        start, rate=Vec3(2.0, -3.0, 1.5), joint_rates=(3.0, -4.0)
    )
    far = around(SPRING, points=UNDER)
    true = np.array(
        leaves(fly(coupled_rk4, ARM, start, far, 0.02, 200, 0.0)[0]), dtype=float
    )
    coarse, fine = errors(ARM, start, far, 0.02, (8, 16), true)
    assert coarse < 5e-3
    assert coarse / fine == pytest.approx(4.0, rel=0.2)
    assert float(kinetic_energy(ARM, start)) > 0.1


def test_a_body_that_nothing_pushes_turns_as_eulers_equations_say():
    """Against SciPy; the torques of a moment of time late it would be off by the first
    power of the step.
    """
    box = FreeObject(
        name="box",
        size=(0.2, 0.1, 0.04),
        mass=0.3,
        position=Vec3(0.0, 0.0, 9.0),
        angular_velocity=Vec3(3.0, 4.0, 2.0),
    )
    moments = np.array([float(c) for c in box.moments])
    true = solve_ivp(
        lambda _t, w: -np.cross(w, moments * w) / moments,
        (0.0, 0.2),
        [3.0, 4.0, 2.0],
        rtol=1e-11,
    ).y[:, -1]
    off = []
    for count in (40, 80):
        contact = Contact(surfaces=(SPRING,), points=UNDER, objects=(box,))
        told = Surroundings(components=(contact,), memories=(contact.start(0.005, ()),))
        _, (memory,) = fly(
            coupled_verlet, BIRD, at_rest(BIRD, (0.0, 0.0, 30.0)), told, 0.2, count, 0.0
        )
        off.append(
            np.abs(np.array([*memory.carried[0].rate], dtype=float) - true).max()
        )
    assert off[0] < 2e-3
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.1)


def test_a_surface_that_moves_is_where_it_is_in_the_middle_of_a_step():
    """One step of a body at rest: the push is k d h / m of the depth half a step
    later.
    """
    floor = Surface(
        name="floor",
        motion=SignalVector(z=Sine(amplitude=0.01, frequency_hz=2.0)),
        material=Material(stiffness=2000.0, dissipation=0.0, friction=0.0),
    )
    h, told = 1e-3, around(floor, points=UNDER)
    after, (memory,) = fly(
        coupled_verlet, BIRD, at_rest(BIRD, (0.0, 0.0, 0.115)), told, h, 1, 0.0
    )
    depth = 0.005 + 0.01 * math.sin(4.0 * math.pi * 0.5 * h)
    assert float(after.velocity.z) == pytest.approx(2000.0 * depth * h / MASS, rel=1e-9)
    assert memory.clock == pytest.approx((h,))


def test_rotors_push_with_the_speed_of_the_middle_and_end_where_their_lag_takes_them():
    vehicle = load_vehicle("hummingbird")
    world, h = Truth(vehicle=vehicle, gravity=9.8), 2e-3
    start = dataclasses.replace(
        at_rest(vehicle, (0.0, 0.0, 9.0)), rotor_speeds=(300.0,) * 4
    )
    command = Command(rotor_speeds=(600.0,) * 4, efforts=())
    state, _ = after_step(
        coupled_verlet, world, start, command, around(SPRING, points=UNDER), h
    )
    rotor = vehicle.rotors[0]
    tau = float(rotor.time_constant_up)
    middle, end = (600.0 - 300.0 * math.exp(-t / tau) for t in (0.5 * h, h))
    assert [*state.rotor_speeds] == pytest.approx([end] * 4, rel=1e-9)
    thrust = 4.0 * float(rotor.thrust_coefficient) * middle**2
    assert float(state.velocity.z) == pytest.approx(
        h * (thrust / float(vehicle.mass) - 9.8), rel=1e-6
    )


def test_bristles_bend_by_the_slip_of_a_step_and_a_body_beside_the_vehicle_falls():
    """The first step of a slide: z = z_s (1 - exp(-v h / z_s)). The depth of a body
    that falls is g h^2 / 2.
    """
    h, rough = 1e-3, ground(friction=0.5)
    start = at_rest(BIRD, (0.0, 0.0, 0.119), velocity=Vec3(0.03, -0.04, 0.0))
    box = FreeObject(
        name="box", size=(0.1, 0.1, 0.1), mass=0.3, position=Vec3(5.0, 0.0, 9.0)
    )
    contact = Contact(surfaces=(rough,), points=UNDER, objects=(box,))
    told = Surroundings(components=(contact,), memories=(contact.start(0.005, ()),))
    _, (memory,) = fly(coupled_verlet, BIRD, start, told, h, 1)
    bent = 2e-4 * (1.0 - math.exp(-0.05 * h / 2e-4))
    assert [*memory.bristles[0]] == pytest.approx(
        [0.6 * bent, -0.8 * bent, 0.0], rel=1e-9
    )
    assert float(memory.carried[0].velocity.z) == pytest.approx(-9.8 * h)
    assert float(memory.carried[0].position.z) - 9.0 == pytest.approx(
        -0.5 * 9.8 * h * h, rel=1e-6
    )


def test_a_quick_touch_pushes_both_bodies_by_the_same_mean_over_the_way():
    """A vehicle 0.06 mm above a box at 1 m/s: in the bend of the force what one loses,
    the other gets.
    """
    box = FreeObject(
        name="box",
        size=(0.1, 0.1, 0.1),
        mass=0.3,
        position=Vec3(0.0, 0.0, -0.17006),
        material=Material(friction=0.0),
    )
    contact = Contact(points=UNDER, objects=(box,))
    told = Surroundings(components=(contact,), memories=(contact.start(0.005, ()),))
    start = at_rest(BIRD, (0.0, 0.0, 0.0), velocity=Vec3(0.0, 0.0, -1.0))
    after, (memory,) = fly(coupled_verlet, BIRD, start, told, 1e-4, 1, 0.0)
    gained, lost = (
        0.3 * float(memory.carried[0].velocity.z),
        MASS * (float(after.velocity.z) + 1.0),
    )
    assert lost > 1e-6
    assert gained == pytest.approx(-lost, rel=1e-9)


def test_an_attitude_of_nearly_unit_length_gets_it_back():
    start = at_rest(BIRD, (0.0, 0.0, 5.0))
    long = dataclasses.replace(
        start, quaternion=type(start.quaternion)(1.0 + 1e-6, 0.0, 0.0, 0.0)
    )
    after, _ = fly(coupled_verlet, BIRD, long, around(SPRING, points=UNDER), 1e-3, 1)
    assert sum(float(c) ** 2 for c in after.quaternion) == pytest.approx(1.0, abs=1e-11)


def plant(vehicle, *components, integrator="rk4"):
    held = tuple(each.start(0.005, ()) for each in components)
    told = Surroundings(components=components, memories=held)
    return RigidBodyPlant(Truth(vehicle=vehicle, gravity=9.8), told, integrator), told


@dataclasses.dataclass(frozen=True, kw_only=True)
class Coupled(Force):
    """A coupled force that says nothing of Verlet's method."""

    coupled = True
    largest_step = 1e-3

    def start(self, period, draws):
        return (0.0,)

    def slope(self, memory, t, motion, rotor_speeds):
        return (1.0,)

    def wrenches(self, memory, t, motion, rotor_speeds):
        return (Wrench(force_W=Vec3(memory[0], 0.0, 0.0)),)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Beside(Force):
    """A force that is not coupled and asks for steps of 2.5 ms wherever the vehicle
    is.
    """

    largest_step = 2.5e-3


def test_short_steps_are_taken_near_contact_where_runge_kutta_evaluates_more_often():
    touch = Contact(surfaces=(Surface(name="ground"),), points=UNDER)
    count = plant(BIRD, touch)[0].substeps(0.005)
    assert count[:7] == (4, 1, 3, True, touch.hit_steps, 0, ())
    assert not plant(BIRD, touch, Coupled())[0].substeps(0.005).verlet
    assert plant(BIRD, touch, integrator="euler")[0].substeps(0.005).near == 5
    assert not plant(BIRD, touch, Beside())[0].substeps(0.005).verlet
    # friction in the joints of this one takes 3 steps of Runge-Kutta's method anyway,
    # in contact no more
    pelican = plant(load_vehicle("pelican_arm2"), touch)[0].substeps(0.005)
    assert (pelican.near, pelican.verlet) == (3, False)
    # its friction decays with 72 1/s: 0.35 of that time is 4.9 ms
    assert plant(load_vehicle("hexarotor_arm6"), touch)[0].substeps(0.005).near == 4
    soft = Contact(
        surfaces=(Surface(name="ground", material=Material(stiffness=100.0)),),
        points=UNDER,
    )
    assert plant(load_vehicle("hexarotor_arm6"), soft)[0].substeps(0.005).near == 3
    assert plant(BIRD, soft)[0].substeps(0.005).near == 3


@pytest.mark.parametrize(
    "name", ["largest_step", "largest_euler_step", "largest_verlet_step"]
)
@pytest.mark.parametrize(
    "value", [0.0, -1.0, float("nan"), "a", True, float("inf"), 1e-9]
)
def test_steps_of_ones_own_force_that_cannot_be_are_refused_whatever_the_method(
    name, value
):
    def own(**steps):
        return dataclasses.dataclass(frozen=True)(type("Own", (Force,), steps))()

    with pytest.raises(ValueError, match=rf"^environment\.forces\[0\]\.{name} = "):
        check_largest_step(
            [("environment.forces[0]", own(**{"largest_step": 1e-3, name: value}))],
            0.005,
        )
    check_largest_step(
        [("environment.forces[0]", own(**{"largest_step": None, name: 1e-3}))], 0.005
    )


def test_a_lane_s_step_is_the_shortest_that_any_method_asks_for():
    own = SimpleNamespace(
        largest_step=1e-3, largest_euler_step=1e-3, largest_verlet_step=1e-4
    )
    assert (
        largest_stable_step(own, euler=False),
        largest_stable_step(own, euler=True),
    ) == (1e-4, 1e-3)


def test_lanes_are_compared_by_the_shorter_of_both_methods_steps():
    grip = Contact(
        objects=(FreeObject(name="box", size=(0.06,) * 3, mass=0.1),),
        grippers=(Gripper(name="hand", damping_ratio=1.5),),
    )
    told = plant(BIRD, grip)[1]
    assert (
        lanes_step(together(told), euler=False)
        == float(grip.largest_verlet_step)
        < float(grip.largest_step)
    )
    assert lanes_step(together(told), euler=True) == float(grip.largest_euler_step)
    assert verlet_step(together(told)) == pytest.approx(
        0.75 * float(grip.largest_euler_step)
    )
    assert verlet_step(together(plant(BIRD, grip, Coupled())[1])) is None
    assert largest_stable_step(Coupled(), euler=False) == 1e-3


def test_a_coupled_force_with_a_step_of_its_own_moves_by_its_rate():
    """What has no velocities goes on by the slope in the middle of the step."""
    memory = Coupled().push((0.5,), 0.0, None, (), 1e-3)
    assert memory == pytest.approx((0.501,))
    assert Coupled().drift((0.5,), 1e-3) == (0.5,)


@pytest.mark.parametrize(("held", "verlet"), [(7, True), (8, False)])
def test_as_many_force_evaluations_as_runge_kutta_takes_are_no_reason_to_leave_it(
    held, verlet
):
    """Two Runge-Kutta steps take forces eight times: the semi-implicit method must need
    fewer.
    """
    plant = RigidBodyPlant(
        Truth(vehicle=BIRD), around(SPRING, points=UNDER), "rk4", 0.001
    )
    plant._rate, plant._largest, plant._largest_far, plant._verlet = (
        0.0,
        0.0025,
        None,
        0.005 / held,
    )
    count = plant.substeps(0.005)
    assert (count.near, count.verlet) == ((held, True) if verlet else (2, False))


def test_steps_are_longer_while_grasps_alone_act_and_the_flight_is_the_same(
    monkeypatch,
):
    scenario = dataclasses.replace(
        skyarm.load_scenario("two_carry_a_bar"), duration=4.0, windows=Windows()
    )
    longer, plants = (
        skyarm.run(scenario),
        [each.plant for each in scenario.agents.values()],
    )

    def counts():
        return RigidBodyPlant(
            plants, first_surroundings(scenario, first_loop_state(scenario))
        ).substeps(0.005)

    assert (counts().near, counts().calm) == (24, 4)  # 4 at least: six by these grasps
    monkeypatch.setattr(Contact, "largest_calm_step", None)
    monkeypatch.setattr(Contact, "largest_calm_verlet_step", None)
    assert counts() == counts()._replace(calm=0)
    usual = skyarm.run(scenario)
    apart = np.linalg.norm(longer.object_position - usual.object_position, axis=1)
    standing = longer.time < 3.0
    assert not apart[standing].any()  # on the floor the steps are those of its contact
    assert 0.0 < apart.max() < 1e-6


def test_calm_is_what_touches_nothing_although_grasps_hold_it():
    (contact,) = skyarm.load_scenario("two_carry_a_bar").worlds
    memory = contact.start(0.005, ())
    motion = SimpleNamespace(time=0.0, step=None)
    rows = (
        (0.02, 0.0, False),
        (0.038, 0.0, False),
        (0.042, 0.0, True),
        (0.06, -3.0, False),
        (0.06, 1.0, True),
    )
    for height, speed, calm in rows:
        (body,) = memory.carried
        moved = dataclasses.replace(
            body, position=Vec3(0.0, 0.0, height), velocity=Vec3(0.0, 0.0, speed)
        )
        there = dataclasses.replace(memory, carried=(moved,))
        assert bool(contact.calm(there, motion, 0.005)) is calm
        assert contact.far(there, motion, 0.005) is False
        # just after an impact
        assert not contact.calm(dataclasses.replace(there, finer=(1.1,)), motion, 0.005)
