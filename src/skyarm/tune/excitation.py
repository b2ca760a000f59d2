"""The flight by which gains are tuned: base, heading and arm move at once through a wind with a gust; then a step.

Gains belong to the loop (vehicle, delay, noise, wrong beliefs), not to a path: every vehicle flies the same motions,
scaled to its arm (:mod:`skyarm.tune.motion_mix`). The scenario keeps its plant, belief, clocks, delays, sensors,
drives, estimator and air; its motion, payloads, faults, surfaces to touch and changes in flight stay away. With perfect
sensors nothing would keep gains from growing without end, so that a scenario without noise gets that of
:data:`skyarm.compare.suite.NOISE`.
"""

from __future__ import annotations

import dataclasses

from skyarm.algebra import Vec3
from skyarm.compare.suite import DELAY, NOISE
from skyarm.control.model import Model
from skyarm.environment import ForceWind
from skyarm.environment.gust import Gust
from skyarm.estimate.estimator import PASS_THROUGH
from skyarm.metrics.windows import Window, Windows
from skyarm.plant.interface import Truth
from skyarm.scenario.controller_table import controller_by_name, loop_facts, make_named_or_tuned
from skyarm.scenario.scenario_record import PERFECT_SENSORS, Delays, Rates, Scenario
from skyarm.tune.motion_mix import STEPPED, motion, unseen_motion
from skyarm.vehicle.vehicle_records import Vehicle

DURATION, SETTLED, BLOWN = 10.0, 2.0, 5.0
"""s: of the flight; from when on errors count; when the gust comes. After the step errors do not count.

Before the first the vehicle leaves a hover into the wind. The step is there to be survived: what error it leaves is the
step's own, not that of gains.
"""

UNSEEN = Window(7.0, 12.0)
"""s: of the errors along the path that is kept aside, which ends with it."""

UNKNOWN_DELAY = 0.010
"""s: longest delay of the commands that the law does not know, as in the README's perturbed plants."""

GUST, GUST_SHARE = Vec3(0.75, 0.5, 0.43), 0.15
"""Direction of the gust's force, and its size as a share of the weight."""


def of_vehicle(vehicle: Vehicle, law: str | None = None, *, gravity: float = 9.81) -> Scenario:
    """A scenario for a vehicle that its law knows exactly.

    Args:
        vehicle: plant and belief.
        law: any name of the catalogue; left out, the centroidal law, on the tip if there is one.
        gravity: m/s^2.
    """
    named = law or ("centroidal_tip" if vehicle.end_effector else "centroidal_joint")
    rates, delays = Rates(), Delays(measurement=DELAY)
    controller = make_named_or_tuned(named, Model(vehicle=vehicle, gravity=gravity), loop_facts(rates, delays))
    return Scenario(
        name=vehicle.name,
        rates=rates,
        world=Truth(vehicle=vehicle, gravity=gravity),
        controller=controller,
        trajectory=motion(vehicle),
        duration=DURATION,
        sensors=NOISE,
        delays=delays,
    )


def excited(scenario: Scenario, law: str | None = None, *, own_motion: bool = False, unseen: bool = False) -> Scenario:
    """The flight by which a scenario's gains are judged.

    Args:
        scenario: whose plant, belief, clocks, sensors and air it keeps.
        law: any name of the catalogue in place of its own.
        own_motion: fly the scenario's own reference, for its own duration and windows.
        unseen: fly the path that is kept aside; errors count once the gust is over.
    """
    noisy = scenario.sensors != PERFECT_SENSORS or scenario.instruments or scenario.estimator != PASS_THROUGH
    longest = float(scenario.delays.command) + UNKNOWN_DELAY
    delays = dataclasses.replace(scenario.delays, longest_command=longest)
    found = dataclasses.replace(
        scenario,
        sensors=scenario.sensors if noisy else NOISE,
        delays=delays,
        changes=(),
        faults=(),
        payloads=(),
        ground=False,
        contact=None,
        plant="rigid_body",
        initial=None,
        joined=0,
        forces=(*scenario.forces, ForceWind(gusts=(_gust(scenario),))),
    )
    if not own_motion:
        found = dataclasses.replace(
            found,
            trajectory=(unseen_motion if unseen else motion)(scenario.world.vehicle),
            path_time=None,
            pause=None,
            duration=UNSEEN.stop if unseen else DURATION,
            windows=Windows(steady=UNSEEN if unseen else Window(SETTLED, BLOWN), gust=Window(BLOWN, STEPPED)),
        )
    if law is not None:
        found = dataclasses.replace(found, controller=controller_by_name(found, law))
    return found


def _gust(scenario: Scenario) -> Gust:
    weight = float(scenario.world.vehicle.mass) * float(scenario.world.gravity)
    return Gust(peak=GUST * (GUST_SHARE * weight), start=BLOWN, duration=1.0)
