"""Scenario for linearisation: no noise, no disturbances with internal state, one time
constant per rotor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from skyarm.algebra import Scalar
from skyarm.compile import trace
from skyarm.control.controller import autopilot_of, innermost, part_of, with_innermost
from skyarm.control.vectored_layer import turns_rotors
from skyarm.dynamics.actuators.servo import PositionServo
from skyarm.dynamics.state import State, example_state
from skyarm.records.coerce import concrete
from skyarm.records.leaves import Dataclass, Tree, leaves
from skyarm.scenario.scenario_record import (
    PERFECT_SENSORS,
    JointDrive,
    Scenario,
    ScenarioError,
    with_words,
)
from skyarm.simulate.loop_state import LoopState
from skyarm.vehicle import Rotor, Vehicle
from skyarm.world import Component, MovingAir

LAGS = ("up", "down")
"""Choices of the rotor time constant that holds in both directions; any motion lies
between the two."""

SHARES = {"up": 0.0, "down": 1.0, "between": 0.5}
"""Choice -> fraction of the difference in :func:`with_lag`, and of the lag of a small
swing."""


def nominal(scenario: Scenario) -> Scenario:
    """Scenario for linearisation, without noise, scheduled changes and disturbances
    with internal state.

    Nor has the rounding of an encoder in a servo, which is flat but for its steps: it
    is left out, as its mean is. Rotors that tilt stay at rest under a law that does not
    turn them.

    Raises:
        ScenarioError: a law that turns rotors: channels and lags of their servos are
            not reckoned; or air or a force whose memory moves with the plant or follows
            its state; or rotors and joints with delays of their own.
        ControllerError: an autopilot, whose program cannot be linearised, or a law that
            sees pictures.
    """
    law = scenario.agent.controller
    if autopilot_of(law) is not None or law.sees:
        law.require_compiled("a margin")
    if scenario.agent.delays.apart:
        raise ScenarioError(
            "delays.rotors, delays.joints: must be left out of margins, which know"
            " delays.command only"
        )
    scenario = _without_tilts(scenario)
    calm = scenario.wind
    if isinstance(calm, MovingAir):
        calm = replace(calm, turbulence=None)
    drives = tuple(
        (
            JointDrive(joint=each.joint, drive=replace(each.drive, resolution=0))
            if isinstance(each.drive, PositionServo)
            else each
        )
        for each in scenario.agent.joint_drives
    )
    (air, _), (forces, _) = (_split(scenario, field) for field in ("air", "forces"))
    return with_words(
        scenario.as_begun,
        noise=PERFECT_SENSORS,
        drives=drives,
        wind=calm,
        air=air,
        forces=forces,
    )


def disturbances(scenario: Scenario) -> tuple[str, ...]:
    """Names of the disturbances that linearisation leaves out: turbulence, air and
    forces with internal state.

    Air and forces without a memory, as ground effect, are kept.
    """
    turbulence = (
        ["environment.wind.turbulence"]
        if getattr(scenario.wind, "turbulence", None) is not None
        else []
    )
    return (*turbulence, *_split(scenario, "air")[1], *_split(scenario, "forces")[1])


def _split(
    scenario: Scenario, field: str
) -> tuple[tuple[Component[Tree], ...], list[str]]:
    """Air or force models without internal state, and names of the others, which
    linearisation leaves out.

    Raises:
        ScenarioError: a memory moves with the plant or follows its state: the loop
            without it is another.
    """
    memoryless = list[Component[Tree]]()
    left_out = list[str]()
    for i, part in enumerate(getattr(scenario, field)):
        name = f"environment.{field}[{i}]"
        # one half, the median of a uniform number, for all that a start may draw
        # a start may draw twice as many numbers as a period
        memory = part.start(scenario.rates.period, (0.5,) * (2 * part.uniforms))
        if not leaves(memory):
            memoryless.append(part)
        else:
            _require_none(
                part.coupled or _follows_state(part, memory, scenario), name, type(part)
            )
            left_out.append(f"{name} = {type(part).__name__}")
    return tuple(memoryless), left_out


def _follows_state(part: Component[Tree], memory: Tree, scenario: Scenario) -> bool:
    """True if the update of a disturbance model's internal state depends on the
    vehicle's state.
    """
    period, vehicle = scenario.rates.period, scenario.agent.vehicle
    state = example_state(*vehicle.sizes)

    def advance(
        memory: Tree, time: tuple[Scalar], state: State, draws: Sequence[Scalar]
    ) -> Tree:
        return part.advance(memory, time[0], period, state, draws)

    program = trace(advance, memory, (0.0,), state, (0.5,) * part.uniforms)
    needed = {node.index for node in program.nodes}
    # inputs are in the order of the arguments: memory, time, state
    start = len(leaves(memory)) + 1
    return any(
        node.index in needed
        for node in program.inputs[start : start + len(leaves(state))]
    )


def _without_tilts(scenario: Scenario) -> Scenario:
    """Scenario with tilting rotors fixed at their rest angles."""
    vehicle = scenario.agent.vehicle
    if not vehicle.tilts:
        return scenario
    if turns_rotors(scenario.agent.controller):
        raise ScenarioError(
            "controller.sideways: must be left out of margins, which do not reckon"
            " rotors that tilt"
        )
    fixed = replace(
        vehicle, rotors=tuple(replace(r, tilt=None) for r in vehicle.rotors)
    )
    first = (
        None
        if scenario.agent.initial is None
        else replace(scenario.agent.initial, tilts=())
    )
    return with_words(
        scenario, plant=replace(scenario.agent.plant, vehicle=fixed), initial=first
    )


def without_adaptation(scenario: Scenario) -> Scenario:
    """Scenario whose controller adapts neither load nor damping: projection onto bounds
    is not differentiable.

    The friction of the model that may be false stays as it is at first. Of a law under
    layers, its own constants are looked at.
    """
    adaptation = part_of(scenario.agent.controller.par, "adaptation")
    if not hasattr(adaptation, "damping_limits"):  # of other laws these are gains
        return scenario
    # between two limits that are equal a damping stays
    held = tuple((damping, damping) for damping in adaptation.doubted)
    return _with_part(
        scenario, adaptation=replace(adaptation, load=None, damping_limits=held)
    )


def with_held_lag(scenario: Scenario) -> Scenario:
    """Scenario whose law freezes its lag estimate, since a bank of candidate lags is no
    part of a linear loop.
    """
    lag = part_of(scenario.agent.controller.par, "lag")
    return (
        _with_part(scenario, lag=replace(lag, held=True))
        if hasattr(lag, "held")
        else scenario
    )


def _with_part(scenario: Scenario, **part: Dataclass) -> Scenario:
    """Replace parts of a scenario's innermost control law, which safety layers may
    enclose.
    """
    par: Any = scenario.agent.controller.par
    own = innermost(par)
    changed = with_innermost(par, replace(own, parts=replace(own.parts, **part)))
    return scenario.with_controller(replace(scenario.agent.controller, par=changed))


def with_lag(scenario: Scenario, share: Scalar) -> Scenario:
    """Scenario whose rotors have one time constant: for rising speed (fraction 0),
    falling (1) or between.

    Between, the rate 1 / tau is between both. In a small swing rotors rise half of the
    time and fall the other half: at one half it grows or dies out as the swing of the
    vehicle itself does.
    """

    def with_one_lag(vehicle: Vehicle) -> Vehicle:
        return replace(vehicle, rotors=tuple(map(one_lag, vehicle.rotors)))

    def one_lag(rotor: Rotor) -> Rotor:
        up, down = rotor.time_constant_up, rotor.time_constant_down
        # without a lag the mean of both would be 0 / 0
        if concrete(up, down) and up == down == 0.0:
            return rotor
        lag = up * down / (down + share * (up - down))
        return replace(rotor, time_constant_up=lag, time_constant_down=lag)

    par = scenario.agent.controller.par
    model = replace(par.model, vehicle=with_one_lag(par.model.vehicle))
    controller = replace(scenario.agent.controller, par=replace(par, model=model))
    plant = replace(scenario.agent.plant, vehicle=with_one_lag(scenario.agent.vehicle))
    return with_words(scenario, controller=controller, plant=plant)


def require_no_memory(scenario: Scenario, first: LoopState) -> None:
    """Raise an error if any part of the nominal loop but the controller and the joint
    drives has internal state.

    Raises:
        ScenarioError: a payload, a sensor or an estimator remembers something, or there
            is a sensor beside the full state; names the first of them by its field.
    """
    for (place, component), memory in zip(
        scenario.placed_components, first.memories, strict=True
    ):
        if place.startswith("payloads["):
            _require_none(bool(leaves(memory)), place, type(component))
    for name, sensor in scenario.agent.all_sensors[1:]:
        _require_none(True, f"sensors.{name}", type(sensor))
    _require_none(
        bool(leaves(first.agent.estimate)), "estimator", type(scenario.agent.estimator)
    )
    _require_none(
        bool(leaves(first.agent.sensors[0].memory)),
        "sensors",
        type(scenario.agent.noise),
    )


def _require_none(present: bool, field: str, kind: type) -> None:
    if present:
        what = f"{field} = {kind.__name__}"
        raise ScenarioError(
            f"{what}: must be left out of margins, whose loop has no memory but the"
            " law's and drives'"
        )
