"""Every shipped vehicle's exported MJCF beside MuJoCo Warp, Newton and this library's
own plant on MuJoCo.

``make warp`` runs it in an environment of its own. Asked: Warp on the CPU, and Newton
where it is installed, 0.2 s within 1e-5 m of MuJoCo on the same file; plant ``mujoco``,
of a vehicle without what the file loses, 1 s within 1 mm. A vehicle flies off from the
file's keyframe with unequal thrusts; in Newton, which starts a thrust at nothing, it
falls. Usage: step_exported.py [VEHICLE ...].
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import math
import sys
import warnings
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np

from skyarm.algebra import Quaternion, Vec3
from skyarm.dynamics.state import State
from skyarm.plant.interface import Truth, flat
from skyarm.plant.mujoco import MujocoPlant
from skyarm.plant.mujoco_export import mjcf_text
from skyarm.plant.mujoco_model import joint_addresses
from skyarm.plant.surroundings import Surroundings
from skyarm.records.leaves import leaves
from skyarm.vehicle import Vehicle
from skyarm.vehicle.vehicle_files import list_vehicles, load_vehicle
from skyarm.vehicle.vehicle_records import BodyDrag

SHORT, LONG = 0.2, 1.0
"""Durations of the comparisons, s."""

LIMITS = {"warp": 1e-5, "newton": 1e-5, "plant": 1e-3}
"""Largest distance (m) of any body from where MuJoCo has it on the same file."""

UNEQUAL = 0.01
"""Share of the hover thrust by which the thrusts of rotors differ."""


def in_what_is_kept(vehicle: Vehicle) -> Vehicle:
    """Vehicle without what an MJCF file loses: air on rotors and base, spin, tables,
    stops, Coulomb friction.
    """
    free = {"coulomb": 0, "stop_stiffness": 0, "lower": -math.inf, "upper": math.inf}
    rotors = tuple(
        replace(
            each,
            drag_coefficient=0,
            rolling_moment_coefficient=0,
            inertia=0,
            table=None,
        )
        for each in vehicle.rotors
    )
    return replace(vehicle.with_joints(**free), rotors=rotors, drag=BodyDrag())


def start(model: mujoco.MjModel, rotors: int, key: bool) -> mujoco.MjData:
    """Data at the file's keyframe, or at rest without thrust, under unequal controls of
    the rotors.
    """
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    controls = np.array(data.ctrl)
    controls[:rotors] *= 1.0 + UNEQUAL * np.cos(np.arange(rotors))
    if key:
        data.act[:rotors] = controls[:rotors]
    else:
        mujoco.mj_resetData(model, data)
    data.ctrl[:] = controls
    return data


def places(model: mujoco.MjModel, data: mujoco.MjData, seconds: float) -> np.ndarray:
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
    mujoco.mj_kinematics(model, data)
    return np.array(data.xpos[1:])


def at(model: mujoco.MjModel, qpos: np.ndarray) -> np.ndarray:
    """Places of the bodies at joint positions of another program."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    return np.array(data.xpos[1:])


def in_warp(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    import mujoco_warp
    import warp

    with warp.ScopedDevice("cpu"):
        theirs, state = mujoco_warp.put_model(model), mujoco_warp.put_data(model, data)
        for _ in range(round(SHORT / model.opt.timestep)):
            mujoco_warp.step(theirs, state)
        return at(model, state.qpos.numpy()[0])


def in_newton(file: Path, model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    import newton
    import warp

    builder = newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    builder.add_mjcf(str(file))
    theirs = builder.finalize(device="cpu")
    solver = newton.solvers.SolverMuJoCo(
        theirs, integrator="rk4", disable_contacts=True
    )
    before, after, control = theirs.state(), theirs.state(), theirs.control()
    control.mujoco.ctrl.assign(
        np.array(data.ctrl, np.float32).reshape(control.mujoco.ctrl.shape)
    )
    with warp.ScopedDevice("cpu"):
        for _ in range(round(SHORT / model.opt.timestep)):
            solver.step(before, after, control, None, model.opt.timestep)
            before, after = after, before
    found = before.joint_q.numpy().astype(float)
    qpos = np.array(data.qpos)
    qpos[:3], qpos[3:7] = found[:3], found[[6, 3, 4, 5]]
    qpos[7:] = found[7:]
    return at(model, qpos)


def in_the_plant(
    vehicle: Vehicle, model: mujoco.MjModel, data: mujoco.MjData
) -> np.ndarray:
    n, count = vehicle.n, len(vehicle.rotors)
    positions, rates = joint_addresses(vehicle, model)
    speeds = [
        math.sqrt(thrust / float(each.thrust_coefficient))
        for thrust, each in zip(data.ctrl, vehicle.rotors, strict=False)
    ]
    first = State(
        position=Vec3(*data.qpos[:3]),
        quaternion=Quaternion(*data.qpos[3:7]),
        velocity=Vec3(*data.qvel[:3]),
        rate=Vec3(*data.qvel[3:6]),
        joints=tuple(data.qpos[positions]),
        joint_rates=tuple(data.qvel[rates]),
        rotor_speeds=tuple(speeds),
        tilts=tuple(data.ctrl[len(data.ctrl) - len(vehicle.tilts) :]),
    )
    around = Surroundings()
    plant = MujocoPlant(
        Truth(vehicle=vehicle, gravity=-float(model.opt.gravity[2])),
        around,
        "rk4_staged",
    )
    command = (*speeds, *data.ctrl[count : count + n], *first.tilts)
    end = plant.advance(flat(first), command, leaves(around), LONG)
    qpos = np.array(data.qpos)
    qpos[:7], qpos[positions] = end[:7], end[13 : 13 + n]
    return at(model, qpos)


def distances(name: str, folder: Path) -> dict[str, float]:
    """Largest distance (m) of any body from where MuJoCo has it, by program."""
    vehicle = load_vehicle(name)
    file = folder / f"{name}.xml"
    file.write_text(mjcf_text(vehicle), "utf-8")
    model, rotors = mujoco.MjModel.from_xml_path(str(file)), len(vehicle.rotors)
    short = places(model, start(model, rotors, key=True), SHORT)
    found = {
        "warp": np.abs(in_warp(model, start(model, rotors, key=True)) - short).max()
    }
    if importlib.util.find_spec("newton"):
        short = places(model, start(model, rotors, key=False), SHORT)
        found["newton"] = np.abs(
            in_newton(file, model, start(model, rotors, key=False)) - short
        ).max()
    kept = in_what_is_kept(vehicle)
    model = mujoco.MjModel.from_xml_string(mjcf_text(kept))
    whole = places(model, start(model, rotors, key=True), LONG)
    found["plant"] = np.abs(
        in_the_plant(kept, model, start(model, rotors, key=True)) - whole
    ).max()
    return {program: float(each) for program, each in found.items()}


def main(chosen: list[str]) -> int:
    import warp

    warp.config.quiet = True
    warnings.simplefilter("ignore")
    far = 0
    with TemporaryDirectory() as folder:
        for name in chosen or [
            each for each in list_vehicles() if not load_vehicle(each).planar
        ]:
            with contextlib.redirect_stdout(io.StringIO()):
                found = distances(name, Path(folder))
            wrong = [
                program
                for program, each in found.items()
                if not each <= LIMITS[program]
            ]
            far += bool(wrong)
            words = ", ".join(
                f"{program} {each:.1e} m" for program, each in found.items()
            )
            print(
                f"{name}: {words}{' FAR: ' + ', '.join(wrong) if wrong else ''}",
                flush=True,
            )
    print(
        f"{far} vehicles are far from MuJoCo"
        if far
        else "every vehicle is where MuJoCo has it"
    )
    return int(far > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
