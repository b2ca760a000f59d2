"""Where the learned load meets the rest of the law: when it learns, and how fast."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.blocks.disturbance_observer import Observed
from skyarm.control.blocks.saturation import all_follow
from skyarm.control.laws.centroidal.interaction import rested
from skyarm.control.laws.centroidal.interaction_records import InteractionMemory
from skyarm.control.laws.centroidal.learned_load import learn_load
from skyarm.control.laws.centroidal.load_inertia import unit_torques
from skyarm.control.laws.centroidal.load_records import LoadMemory
from skyarm.control.laws.centroidal.memory import CentroidalMemory
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.control.laws.centroidal.pressing import Pressing
from skyarm.scalars import add, divide, logical_or, minimum, mul, where
from skyarm.scalars.taylor import Taylor


def carry(
    par: CentroidalParameters,
    memory: CentroidalMemory,
    load: LoadMemory,
    told: Any,
    observed: Observed,
    alone: Disturbance,
    pressing: Pressing | None,
    dt: Any,
    signals: Sequence[Taylor] = (),
) -> tuple[LoadMemory, Disturbance]:
    """One period of the learned load.

    Args:
        par: constants, with those of the load, whose model holds it.
        memory: of the law, one period earlier.
        load: of it.
        told: above 0.5 while the tip is told to hold something.
        observed: of the observer, at the measurement's time.
        alone: the disturbance that it holds.
        pressing: on a surface; None where no reference asks for it.
        dt: control period, s.
        signals: of the reference: x, y, z, yaw, joints; series in time.

    Returns:
        The memory, and what the law adds to the disturbance that it answers.
    """
    if par.load is None:
        raise AssertionError("a load needs its constants")
    learns: Any = where(all_follow(memory.applied), 1.0, 0.0)
    for each in memory.free:
        learns = mul(learns, each)
    if pressing is not None:
        learns = where(logical_or(pressing.engaged > 0.5, pressing.asked), 0.0, learns)
        if par.interaction is not None and isinstance(memory.interaction, InteractionMemory):
            # what is left of a contact in the observer is no bias; of a mass, learned much faster, it is gone as fast
            learns = mul(learns, where(told > 0.5, 1.0, rested(par.interaction, memory.interaction)))
    bandwidth = minimum(par.observer.force, par.observer.joints)
    R = observed.quaternion.rotation()
    turned = None
    if par.load.inertia is not None:
        late = add(divide(1.0, par.observer.joints), 0.5 * par.delay_periods * dt)
        turned = (unit_torques(par.model.vehicle, signals), late)
    return learn_load(par.load, load, par.model, R, observed.joints, alone, told > 0.5, learns, bandwidth, dt, turned)
