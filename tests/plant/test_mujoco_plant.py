"""The MuJoCo model of a vehicle, and the manners of both plants."""

from __future__ import annotations

import math
import os
from dataclasses import replace

import numpy as np
import pytest

from skyarm.algebra import Mat3, Sym3, Vec3
from skyarm.dynamics import array_front as arrays
from skyarm.plant.compiled import RigidBodyPlant
from skyarm.plant.interface import Truth, flat, whole_steps
from skyarm.records.leaves import leaves
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.linkage import BASE, Body, Joint, Link
from skyarm.vehicle.vehicle_records import Frame, Vehicle
from support.vehicles import (
    HOVER,
    WIND,
    hovering,
    hummingbird_arm,
    random_flyer,
    random_state,
    random_vehicle,
    steady_wind,
    tumbling,
)

mujoco = pytest.importorskip("mujoco")
from skyarm.plant.mujoco import MujocoPlant  # noqa: E402
from skyarm.plant.mujoco_model import build_spec, joint_addresses  # noqa: E402

KINDS = [RigidBodyPlant, MujocoPlant]
G = 9.8


def model_of(vehicle):
    return build_spec(vehicle, G).compile()


def mass_matrix(vehicle, model, state):
    data = mujoco.MjData(model)
    q, v = joint_addresses(vehicle, model)
    data.qpos[:7] = [*state.position, *state.quaternion]
    data.qpos[q] = state.joints
    mujoco.mj_forward(model, data)
    order = [*range(6), *v]
    columns = np.zeros((model.nv, model.nv))
    for i, row in enumerate(np.eye(model.nv)):
        mujoco.mj_mulM(model, data, columns[i], row)
    return columns[np.ix_(order, order)]


@pytest.mark.parametrize("seed", range(6))
def test_the_model_has_the_mass_matrix_of_the_record(seed):
    rng = np.random.default_rng([13, seed])
    vehicle = random_vehicle(rng, seed)
    state = random_state(rng, seed)
    expected = arrays.mass_matrix(
        vehicle, state.position, state.quaternion, state.joints
    )
    np.testing.assert_allclose(
        mass_matrix(vehicle, model_of(vehicle), state), expected, rtol=0.0, atol=1e-12
    )


def test_small_inertias_are_not_rounded():
    """Products of inertia of 1e-9 kg m^2 reach the model; MuJoCo's own diagonalisation
    would lose a thousandth.
    """
    tiny = Body(
        mass=1e-3,
        com=Vec3(1e-3, 2e-3, -1e-3),
        inertia=Sym3(2e-9, 3e-9, 2.5e-9, 5e-10, -4e-10, 3e-10),
    )
    vehicle = Vehicle(
        name="tiny",
        base=Body(mass=1.0, inertia=Sym3(0.01, 0.01, 0.02)),
        links=(Link(name="bead", parent=BASE, joint=Joint(name="j"), body=tiny),),
    )
    model = model_of(vehicle)
    body = model.body("bead")
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, np.array(body.iquat))
    R = R.reshape(3, 3)
    found = R @ np.diag(body.inertia) @ R.T
    expected = np.array(
        [[2e-9, 5e-10, -4e-10], [5e-10, 3e-9, 3e-10], [-4e-10, 3e-10, 2.5e-9]]
    )
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * 3e-9)


def test_the_model_has_no_forces_of_its_own():
    vehicle = random_flyer(0, 4)
    model = model_of(vehicle)
    for field in (
        "dof_damping",
        "dof_frictionloss",
        "dof_armature",
        "jnt_stiffness",
        "jnt_limited",
        "body_gravcomp",
    ):
        assert not np.any(getattr(model, field)), field
    assert not np.any(model.geom_contype)
    assert not np.any(model.geom_conaffinity)
    assert model.nu == 0
    off = mujoco.mjtDisableBit
    for flag in (
        off.mjDSBL_CONTACT,
        off.mjDSBL_CONSTRAINT,
        off.mjDSBL_EULERDAMP,
        off.mjDSBL_AUTORESET,
    ):
        assert model.opt.disableflags & int(flag)
    assert model.opt.density == 0.0
    assert model.opt.viscosity == 0.0
    np.testing.assert_array_equal(model.opt.gravity, [0.0, 0.0, -G])


def test_shapes_to_look_at_weigh_nothing():
    vehicle = hummingbird_arm()
    model = model_of(vehicle)
    assert model.ngeom >= 1 + 2 * 4 + 2
    assert model.body_mass.sum() == pytest.approx(0.73103 + 2 * 0.045, rel=1e-15)


def test_frames_and_hubs_are_sites_at_their_place():
    vehicle = random_flyer(1, 3)
    model = model_of(vehicle)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for frame in vehicle.frames:
        np.testing.assert_allclose(
            model.site(frame.name).pos, tuple(frame.position), atol=1e-15
        )
    for rotor in vehicle.rotors:
        site = data.site(rotor.name)
        np.testing.assert_allclose(site.xpos, tuple(rotor.position), atol=1e-15)
        np.testing.assert_allclose(
            site.xmat.reshape(3, 3)[:, 2], tuple(rotor.axis), atol=1e-12
        )


def test_names_that_collide_with_ours_are_no_trouble():
    vehicle = hummingbird_arm()
    links = tuple(
        replace(link, name=name, joint=replace(link.joint, name=name))
        for link, name in zip(vehicle.links, ("base", "base_"), strict=True)
    )
    rotors = (replace(vehicle.rotors[0], name="tip"), *vehicle.rotors[1:])
    renamed = replace(vehicle, links=links, rotors=rotors)
    x, command = flat(hovering(vehicle)), (HOVER,) * 4 + (0.01, 0.02)
    flights = [
        MujocoPlant(Truth(vehicle=each, gravity=G), WIND).advance(
            x, command, leaves(WIND), 0.01
        )
        for each in (vehicle, renamed)
    ]
    assert flights[0] == flights[1]


def test_a_point_mass_a_massless_link_and_a_flat_plate_fly_in_both_plants():
    plate = Body(mass=0.2, com=Vec3(0.0, 0.0, -0.1), inertia=Sym3(1e-4, 3e-4, 4e-4))
    point = Body(mass=0.05, com=Vec3(0.1, 0.0, -0.1))
    turn = Mat3.from_numbers([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    vehicle = Vehicle(
        name="odd",
        base=Body(mass=1.0, inertia=Sym3(0.01, 0.012, 0.02)),
        links=(
            Link(
                name="gimbal",
                parent=BASE,
                joint=Joint(name="a", axis=Vec3(1, 0, 0)),
                body=Body(mass=0),
            ),
            Link(
                name="plate",
                parent=0,
                joint=Joint(name="b", axis=Vec3(0, 1, 0), rotation=turn),
                body=plate,
            ),
            Link(
                name="bob",
                parent=BASE,
                joint=Joint(name="c", axis=Vec3(0, 1, 0)),
                body=point,
            ),
        ),
        frames=(Frame(name="tip", link=2, position=Vec3(0.1, 0.0, -0.1)),),
    )
    world, x = Truth(vehicle=vehicle, gravity=G), flat(tumbling(vehicle))
    command = (0.01, -0.02, 0.005)
    ours, theirs = (
        kind(world, WIND, "euler").advance(x, command, leaves(WIND), 0.2)
        for kind in KINDS
    )
    # the least inertia MuJoCo takes, 2e-15, against 1e-4
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-8)


def test_stepping_is_mujocos_own_step():
    """The public mj_step from the same state and forces, to the last bit; friction of
    ``euler`` is in its armature.
    """
    rough = random_flyer(1, 4)
    for integrator, vehicle in (
        ("rk4", rough),
        ("euler", rough.with_joints(damping=0.0, coulomb=0.0)),
    ):
        plant = MujocoPlant(Truth(vehicle=vehicle, gravity=G), WIND, integrator)
        x = flat(tumbling(vehicle))
        command = (HOVER,) * 4 + (0.1, -0.1, 0.05, 0.0)
        end = plant.advance(x, command, leaves(WIND), plant.model.opt.timestep)
        q, v = joint_addresses(vehicle, plant.model)
        data = mujoco.MjData(plant.model)
        data.qpos[:7], data.qpos[q] = x[:7], x[13:17]
        data.qvel[:6], data.qvel[v] = x[7:13], x[17:21]
        data.qfrc_applied[:] = plant._force
        mujoco.mj_step(plant.model, data)
        assert (*data.qpos[:7], *data.qvel[:6], *data.qpos[q], *data.qvel[v]) == end[
            :-4
        ]


@pytest.mark.parametrize("kind", KINDS)
def test_a_planar_model_is_refused(kind):
    vehicle = hummingbird_arm()
    flat_body = replace(vehicle.links[1].body, inertia=Sym3(0, 1e-4, 0), planar=True)
    believed = replace(
        vehicle, links=(vehicle.links[0], replace(vehicle.links[1], body=flat_body))
    )
    with pytest.raises(VehicleError, match=r"links\[lower\].planar = True"):
        kind(Truth(vehicle=believed), steady_wind())


@pytest.mark.parametrize("kind", KINDS)
def test_an_unknown_integrator_lists_those_there_are(kind):
    with pytest.raises(
        ValueError,
        match=r"integrator = 'rk5': must be one of \['rk4', 'euler', 'rk4_staged'\]",
    ):
        kind(Truth(vehicle=hummingbird_arm()), steady_wind(), "rk5")


def test_seconds_must_be_whole_steps():
    assert whole_steps(0.005, 0.001) == 5
    assert whole_steps(0.3, 0.1) == 3
    assert whole_steps(100.0, 0.001) == 100_000
    for seconds in (0.0055, 0.0004, 0.0, -0.001):
        with pytest.raises(
            ValueError, match=r"must be a whole number of physics steps of 0.001 s"
        ):
            whole_steps(seconds, 0.001)
    x, rest = flat(hovering(hummingbird_arm())), ((HOVER,) * 4 + (0.0, 0.0), ())
    for plant in (
        MujocoPlant(Truth(vehicle=hummingbird_arm()), steady_wind()),
        RigidBodyPlant(Truth(vehicle=hummingbird_arm()), steady_wind(), "euler"),
    ):
        with pytest.raises(ValueError, match="must be a whole number of physics steps"):
            plant.advance(x, *rest, 0.0055)


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e200])
@pytest.mark.parametrize("integrator", ["rk4", "euler", "rk4_staged"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_diverged_state_stays_diverged_and_leaves_no_file(
    kind, integrator, bad, tmp_path, monkeypatch, capfd
):
    monkeypatch.chdir(tmp_path)
    vehicle = hummingbird_arm()
    x = list(flat(hovering(vehicle)))
    x[10] = bad
    plant = kind(Truth(vehicle=vehicle, gravity=G), WIND, integrator)
    end = plant.advance(x, (HOVER,) * 4 + (0.0, 0.0), leaves(WIND), 0.02)
    assert not all(math.isfinite(value) and abs(value) < 1e100 for value in end)
    assert os.listdir(tmp_path) == []
    assert capfd.readouterr().out == ""
    # and the plant still flies a sound state
    sound = flat(hovering(vehicle))
    again = plant.advance(sound, (HOVER,) * 4 + (0.0, 0.0), leaves(WIND), 0.02)
    assert again == kind(Truth(vehicle=vehicle, gravity=G), WIND, integrator).advance(
        sound, (HOVER,) * 4 + (0.0, 0.0), leaves(WIND), 0.02
    )


@pytest.mark.parametrize("integrator", ["rk4", "euler"])
@pytest.mark.parametrize("kind", KINDS)
def test_the_same_tuples_may_be_flown_from_and_read_again(kind, integrator):
    """What a plant keeps of an instant is not what it has moved on to since."""
    vehicle = hummingbird_arm()
    x, around, command = (
        tuple(flat(tumbling(vehicle))),
        tuple(leaves(WIND)),
        (HOVER,) * 4 + (0.01, 0.0),
    )
    plant, other = (
        kind(Truth(vehicle=vehicle, gravity=G), WIND, integrator) for _ in range(2)
    )
    reading = plant.specific_force(x, command, around)
    end = plant.advance(x, command, around, 0.02)
    assert end != x
    assert plant.specific_force(x, command, around) == reading
    assert plant.advance(x, command, around, 0.02) == end
    assert plant.advance(x, command, around, 0.02) == end
    assert other.advance(x, command, around, 0.02) == end


@pytest.mark.parametrize("kind", KINDS)
def test_joints_wound_past_a_turn_fly_on(kind):
    vehicle = hummingbird_arm()
    near, far = (
        replace(
            hovering(vehicle),
            joints=(0.3 + 2.0 * math.pi * turns, -0.2 - 2.0 * math.pi * turns),
        )
        for turns in (0, 3)
    )
    plant = kind(Truth(vehicle=vehicle, gravity=G), WIND)
    ends = [
        plant.advance(flat(x), (HOVER,) * 4 + (0.0, 0.0), leaves(WIND), 0.02)
        for x in (near, far)
    ]
    np.testing.assert_allclose(ends[0][:13], ends[1][:13], rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(
        np.subtract(ends[1][13:15], ends[0][13:15]),
        [6.0 * math.pi, -6.0 * math.pi],
        atol=1e-11,
    )


def test_the_specific_force_of_a_bare_body_in_vacuum_is_zero():
    vehicle = random_vehicle(np.random.default_rng(3), 0)
    for kind in KINDS:
        plant = kind(Truth(vehicle=vehicle, gravity=G), steady_wind())
        reading = plant.specific_force(
            flat(replace(tumbling(vehicle), rate=Vec3(0.0, 0.0, 0.0))), (), ()
        )
        assert reading == pytest.approx((0.0, 0.0, 0.0), abs=1e-13)


def test_what_mujoco_warns_of_is_not_printed_and_leaves_no_file(
    tmp_path, monkeypatch, capfd
):
    """Bodies without any mass: "Inertia matrix is too close to singular"."""
    monkeypatch.chdir(tmp_path)
    vehicle = hummingbird_arm()
    plant = MujocoPlant(Truth(vehicle=vehicle, gravity=G), steady_wind())
    plant.model.body_mass[:] = plant.model.body_inertia[:] = 0.0
    state, command = flat(hovering(vehicle)), (0.0,) * 6
    warned = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(warned.append)
    try:
        plant.specific_force(state, command, leaves(steady_wind()))
        plant.advance(state, command, leaves(steady_wind()), 0.005)
        assert warned == []
        # the user's own MuJoCo is heard again
        mujoco.mj_resetData(plant.model, plant._data)
        plant._qpos[:] = [*state[:7], *state[13:15]]
        mujoco.mj_forward(plant.model, plant._data)
        assert len(warned) == 1
        assert "singular" in warned[0]
    finally:
        mujoco.set_mju_user_warning(before)
    assert capfd.readouterr() == ("", "")
    assert list(tmp_path.iterdir()) == []
