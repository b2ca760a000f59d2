"""Reading of a URDF or MJCF file by MuJoCo, beside this library's vehicle of the same
file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from skyarm.algebra import Mat3
from skyarm.dynamics import mass_matrix
from skyarm.records.arrays import Array
from skyarm.records.files import one_line
from skyarm.vehicle import Vehicle
from skyarm.vehicle.check import refuse

POSES = 8
"""Number of joint positions at which the mass matrices are compared."""

LEVEL = np.eye(7)[3]
"""Position and quaternion w x y z of a base at the origin without rotation."""

COLUMNS = ("", "skyarm", "MuJoCo", "largest relative difference")


def beside_mujoco(vehicle: Vehicle, file: str) -> list[tuple[str, str, str, str]]:
    """Rows of a table: mass, centre of mass, inertia, joints and mass matrix M(q) by
    this library and by MuJoCo.

    MuJoCo's base is made to float. Joints that it alone has, which are fixed here,
    stand at their zero there. An entry of M is compared to the root of the product of
    the two diagonal entries beside it.

    Args:
        vehicle: vehicle of the file.
        file: path of a .urdf, .xml or .mjcf file.

    Raises:
        VehicleError: one line: another kind of file, one that MuJoCo refuses, or one
            without the same base and joints.
    """
    import mujoco

    model = _compile(file)
    data = mujoco.MjData(model)
    ours = vehicle.joint_names
    # the free joint first, wherever it stands in the file
    base, *others = sorted(
        range(model.njnt), key=lambda k: model.jnt_type[k] != mujoco.mjtJoint.mjJNT_FREE
    )
    theirs = [model.joint(k).name for k in others]
    if missing := [name for name in ours if name not in theirs]:
        refuse(
            "--compare",
            missing[0],
            f"must be a joint of MuJoCo's: {', '.join(theirs) or 'it has none'}",
        )
    same = [model.joint(name).id for name in ours]
    rates = [*(model.jnt_dofadr[base] + np.arange(6)), *model.jnt_dofadr[same]]
    limits = np.reshape(
        [(float(each.lower), float(each.upper)) for each in vehicle.joints], (-1, 2)
    )
    # an unlimited joint has no range to draw from: half a turn either way, of slides as
    # many m, is chosen for all
    lower, upper = limits.clip(-np.pi, np.pi).T
    poses = np.random.default_rng(0).uniform(lower, upper, (POSES, vehicle.n))
    # the zero pose is the first, of which the rows of the table are
    poses[0], worst = 0.0, 0.0
    rows: list[tuple[str, str, str, str]] = []
    for q in poses:
        data.qpos[:] = model.qpos0
        data.qpos[model.jnt_qposadr[base] + np.arange(7)] = LEVEL
        data.qpos[model.jnt_qposadr[same]] += q
        mujoco.mj_fwdPosition(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        a = np.array(mass_matrix(vehicle, Mat3.identity(), q.tolist()), float)
        b = full[np.ix_(rates, rates)]
        rows = rows or [
            (name, text, _whole(b)[name], "") for name, text in _whole(a).items()
        ]
        worst = max(
            worst, float((abs(a - b) / np.sqrt(np.outer(np.diag(b), np.diag(b)))).max())
        )
    rows.append(("joints in order", ", ".join(ours), ", ".join(theirs), ""))
    return [*rows, (f"M(q) at {POSES} poses", "", "", f"{worst:.1e}")]


def _compile(file: str) -> Any:
    """MuJoCo's model of a file, its base free, without the geoms of a URDF, whose
    meshes may not be there.
    """
    import mujoco

    from skyarm.plant.mujoco import QUIET

    if Path(file).suffix not in (".urdf", ".xml", ".mjcf"):
        refuse(
            "--compare",
            file,
            "must be a .urdf, .xml or .mjcf file, which MuJoCo reads itself",
        )
    try:
        # or it writes its warnings to a file in the current folder
        with QUIET:
            spec = mujoco.MjSpec.from_file(file)
            for each in (*spec.geoms, *spec.meshes) if file.endswith(".urdf") else ():
                spec.delete(each)
            # as in our own models; M(q) is the same with fused bodies (measured)
            spec.compiler.fusestatic = False
            top = list(spec.worldbody.bodies)
            free = [
                body
                for body in top
                if any(each.type == mujoco.mjtJoint.mjJNT_FREE for each in body.joints)
            ]
            if len(free or top) != 1:
                raise ValueError(
                    "one of its bodies must be the base: free, or alone in the world"
                )
            if not free:
                top[0].add_freejoint()
            return spec.compile()
    except ValueError as error:
        refuse("--compare", file, f"MuJoCo reads no vehicle: {one_line(str(error))}")


def _whole(M: Array) -> dict[str, str]:
    """Mass, centre of mass and inertia about it, in words, from a mass matrix at a
    level base.
    """
    m = M[0, 0]
    # the block -m S(c) between velocity and rate has the centre of mass
    across = M[:3, 3:6] / M[0, 0]
    com = np.array([across[1, 2], across[2, 0], across[0, 1]])
    inertia = M[3:6, 3:6] - m * (com @ com * np.eye(3) - np.outer(com, com))
    numbers = {
        "mass, kg": [m],
        "com, m": com,
        "inertia, kg m^2": inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]],
    }
    return {
        name: " ".join(f"{each:.6g}" for each in values)
        for name, values in numbers.items()
    }
