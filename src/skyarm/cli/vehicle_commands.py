"""``skyarm attach`` and ``skyarm export-mjcf``: vehicle files made from others."""

from __future__ import annotations

from typing import Annotated

import typer

from skyarm.cli.app import app, tell

Three = tuple[float, float, float]


@app.command()
def attach(
    airframe: Annotated[str, typer.Argument(help="a vehicle file (.toml, .urdf, .xml) or the name of a shipped one")],
    arm: Annotated[str, typer.Argument(help="the arm's file (.urdf, .xml, .toml), or robot:NAME; it stays as it is")],
    file: Annotated[str, typer.Option("--out", "-o", help="the vehicle file (.toml) to write")],
    to: Annotated[str, typer.Option(help="base, or a link or frame of the airframe")] = "base",
    position: Annotated[Three, typer.Option(metavar="X Y Z", help="of the arm's root link there, m")] = (0.0, 0.0, 0.0),
    rpy: Annotated[Three, typer.Option(metavar="ROLL PITCH YAW", help="of the arm's root link there, rad")] = (
        0.0,
        0.0,
        0.0,
    ),
    prefix: Annotated[str, typer.Option(help="put before the arm's names")] = "",
    tip: Annotated[str | None, typer.Option(help="the arm's frame or link that tasks mean; its last one")] = None,
    mimic: Annotated[str, typer.Option(help="joints that follow others: lock or couple")] = "lock",
    armature: Annotated[float, typer.Option(help="kg m^2, of the drives of the arm's revolute joints")] = 0.0,
    repair: Annotated[bool, typer.Option("--repair", help="inertias a little beyond what a body has: nearest")] = False,
) -> None:
    """Put an arm on an airframe: write a vehicle file.

    The file refers to both by their paths, is read before it is written, and replaces no other. It flies as it is,
    takes rotors, joints' limits and frames as any vehicle file does, and further arms.
    """
    from skyarm.cli.attach_command import write_attached

    mount = {"to": to, "position": position, "rpy": rpy, "prefix": prefix, "armature": armature}
    tell(write_attached(airframe, arm, file, mount, tip=tip, mimic=mimic, repair=repair))


@app.command(name="export-mjcf")
def export_mjcf(
    what: Annotated[str, typer.Argument(help="a vehicle or a scenario: its file, or a name of the library")],
    file: Annotated[str, typer.Option("--out", "-o", help="the MJCF file to write")],
    gravity: Annotated[float | None, typer.Option(help="m/s^2; 9.81, or the scenario's")] = None,
    timestep: Annotated[float, typer.Option(help="s, of MuJoCo")] = 0.001,
) -> None:
    """Write a vehicle as a model for MuJoCo.

    With its joints, rotors and drives as actuators, a keyframe to start from, lights and a camera that follows it.
    """
    from skyarm.cli.mjcf_command import write_mjcf

    tell(write_mjcf(what, file, gravity=gravity, timestep=timestep))
