"""``skyarm export-mjcf``: which vehicle, into which file."""

from __future__ import annotations

from skyarm.cli.machine_output import give
from skyarm.cli.named_files import is_scenario
from skyarm.dynamics.state import State
from skyarm.files import number, output_file, shown, write_atomically
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import first_state
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_records import Vehicle

LONGEST_STEP = 0.1
"""s: a longer step of integration is a slip of the keyboard."""


def write_mjcf(what: str, file: str, *, gravity: float | None = None, timestep: float = 0.001) -> str:
    """Write a vehicle as MJCF; returns one line on what was written.

    Args:
        what: a vehicle, or a scenario, whose plant's vehicle, gravity and first state are taken.
        file: to write.
        gravity: m/s^2; None for 9.81, or the scenario's.
        timestep: s.

    Raises:
        ValueError, OSError: one line.
    """
    from skyarm.plant.mujoco_export import mjcf_text

    written = output_file(file, "--out")
    if written.suffix not in (".xml", ".mjcf"):
        raise ValueError(f"--out = {shown(file)}: must end in .xml or .mjcf")
    step = number(timestep, "--timestep", low=0.0, strict=True)
    if step > LONGEST_STEP:
        raise ValueError(f"--timestep = {timestep!r}: must be at most {LONGEST_STEP:g} s")
    vehicle, felt, start = _read(what)
    if gravity is not None:
        felt = number(gravity, "--gravity", low=0.0)
    exported = mjcf_text(vehicle, felt, start, timestep=step)
    write_atomically(written, exported.text.encode())
    give(
        file=written,
        vehicle=vehicle.name,
        bodies=exported.bodies,
        joints=exported.joints,
        actuators=list(exported.actuators),
    )
    counted = f"{exported.bodies} bodies, {exported.joints} joints, {len(exported.actuators)} actuators"
    return f"{written}: {vehicle.name}, {counted}"


def _read(what: str) -> tuple[Vehicle, float, State | None]:
    """Vehicle, gravity (m/s^2) and first state of a vehicle or a scenario."""
    if is_scenario(what):
        scenario = load_scenario(what)
        return scenario.world.vehicle, float(scenario.world.gravity), first_state(scenario)
    return load_vehicle(what), 9.81, None
