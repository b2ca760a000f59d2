"""Learned policy as a control law, for runs, comparisons, sweeps and C export."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.scalars import clip
from skyarm.control.controller import Controller, ControllerError, Law
from skyarm.control.laws.learned.law import Layer, Network
from skyarm.control.model import Model
from skyarm.dynamics.actuators import Command, Mixer
from skyarm.envs.action_kinds import Decision, Turn
from skyarm.envs.env_program import observation_of
from skyarm.envs.env_task import LearningTask
from skyarm.envs.observed_quantities import Sight
from skyarm.records.arrays import Array, doubles
from skyarm.records.coerce import plain_number
from skyarm.records.files import shown
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree, is_record
from skyarm.records.units import Unit
from skyarm.reference import Reference
from skyarm.sensing.measurement import Measurement

Policy = Callable[[Scalars], Sequence[Scalar]]
"""Function from the numbers of an observation to those of an action."""


@immutable
class PolicyParameters:
    """Parameters of a control law that evaluates a learned policy.

    Attributes:
        model: nominal model. mixer: mixer of its rotors.
        policy: the policy, if it is a record of numbers; else ``()``.
        inner: constants of the law that the actions build on, without model and mixer;
            ``()`` where they build on none.
    """

    commands_actuators: ClassVar[bool] = True
    """Its commands are the environment's, which the plant takes as they are: no
    actuator layer changes them."""

    model: Model
    mixer: Mixer
    policy: Any = ()
    inner: Any = ()


@immutable
class PolicyMemory:
    """Internal state of a control law that evaluates a learned policy.

    Attributes:
        inner: memory of the law that the actions build on. action: last action.
    """

    inner: Tree
    action: Annotated[Scalars, Unit("", "the last one, each number in [-1, 1]")]


def as_law(
    policy: Policy | Sequence[tuple[ArrayLike, ArrayLike]],
    environment: object,
    *,
    name: str = "policy",
    traceable: bool = True,
) -> Controller:
    """Make a control law from a policy that was trained in an environment.

    Args:
        policy: a function, over any scalar, from the numbers of an observation, the
            state's first, then the pixels of each picture row by row, in the order of
            ``observation``, to those of an action; or the layers of a network,
            ``[(weights (outputs, inputs), offsets (outputs)), ...]`` with tanh between
            them (:func:`network`).
        environment: training environment, single or vector: its observation, actions
            and scenario's law are the policy's.
        name: name of the law.
        traceable: the policy uses ``+ - * /`` and the functions of
            :mod:`skyarm.algebra.scalars` only; False calls it with floats, as a law
            that is not compiled.

    Raises:
        ControllerError: no policy, or one whose numbers do not fit the environment.
    """
    task = task_of(environment)
    planned = task.scenario.agent.controller
    size = task.actions.size(task.scenario.agent.model.vehicle)
    if not callable(policy):
        policy = network(policy)
    if isinstance(policy, Network) and len(policy.limits) != size:
        raise ControllerError(
            f"policy: gives {len(policy.limits)} numbers, must be {size} for these"
            " actions"
        )
    asks, record = task.actions.asks_law, is_record(policy)
    # the state first, which an environment gives apart from its pictures
    seen = tuple(sorted(task.observation, key=lambda each: bool(each.sees)))
    law = partial(
        policy_law,
        # rewards read the truth, which a law does not have
        observation=replace(task, reward=(), observation=seen),
        asked=planned.law if asks else _no_law,
        function=None if record else policy,
    )
    return Controller(
        name=name,
        law=law,
        par=PolicyParameters(
            model=planned.par.model,
            mixer=planned.par.mixer,
            policy=policy if record else (),
            inner=replace(planned.par, model=None, mixer=None) if asks else (),
        ),
        memory=PolicyMemory(inner=planned.memory if asks else (), action=(0.0,) * size),
        margin=planned.margin if asks else None,
        limit=planned.limit if asks else "",
        compiled=traceable,
        sees=tuple(each.sees for each in seen if each.sees),
    )


def policy_law(
    memory: PolicyMemory,
    measurement: Measurement,
    reference: Reference,
    dt: float,
    *,
    par: PolicyParameters,
    observation: LearningTask,
    asked: Law,
    function: Policy | None,
) -> tuple[PolicyMemory, Command]:
    """Control law that computes an observation, evaluates the policy, and converts its
    action to a command.

    ``observation`` is the task with its observation and actions, ``asked`` the law that
    the actions build on, and ``function`` the policy where it is no record.
    """
    sight = Sight(
        measurement=measurement,
        reference=reference,
        action=memory.action,
        model=par.model,
    )
    seen = observation_of(observation, sight)
    takes = par.policy if function is None else function
    if isinstance(takes, Network) and len(takes.means) != len(seen):
        raise ControllerError(
            f"policy: takes {len(takes.means)} numbers, must be {len(seen)} for this"
            " observation"
        )
    # a function of another library may answer with its arrays
    given: Sequence[Any] = tuple(map(plain_number, takes(seen)))
    if len(given) != len(memory.action):
        raise ControllerError(
            f"policy: gives {len(given)} numbers, must be {len(memory.action)} for"
            " these actions"
        )
    # as in the environment, whose last action is the one within the bounds
    action = tuple(clip(a, -1.0, 1.0) for a in given)
    own = par
    # model and mixer stand once among the constants, so that a path changes both
    if is_record(par.inner):
        own = replace(par.inner, model=par.model, mixer=par.mixer)

    def law(inner: Tree, measured: Measurement, target: Reference) -> Decision:
        return asked(inner, measured, target, dt, par=own)

    turn = Turn(memory.inner, measurement, reference, law, own, observation.setpoints)
    following, command = observation.actions.command(action, turn)
    return PolicyMemory(inner=following, action=action), command


def _no_law(memory: Tree, *_: object, **__: object) -> Decision:
    """Placeholder control law for action kinds that need no underlying law; commands
    nothing.
    """
    return memory, Command()


def network(
    layers: Sequence[tuple[ArrayLike, ArrayLike]],
    *,
    means: Sequence[float] | None = None,
    deviations: Sequence[float] | None = None,
) -> Network:
    """Neural network of tanh layers; the last layer is linear and clipped to [-1, 1].

    Args:
        layers: (weights (outputs, inputs), offsets (outputs)) of each; arrays, or what
            NumPy takes for one.
        means: means that training subtracted from the observation's numbers; 0 if left
            out.
        deviations: deviations by which it divided them; 1 if left out.

    Raises:
        ControllerError: layers that do not follow one another, or numbers that are
            none.
    """
    try:
        pairs = [(doubles(weights), doubles(offsets)) for weights, offsets in layers]
    except (TypeError, ValueError):
        raise ControllerError(
            f"policy = {shown(layers)}: must be a function, or layers (weights,"
            " offsets)"
        ) from None
    if not pairs:
        raise ControllerError("policy: must have at least one layer")
    for i, (weights, offsets) in enumerate(pairs):
        # -1 is the size of nothing, so that it refuses arrays of other dimensions
        size = len(offsets) if offsets.ndim == 1 else -1
        before = weights.shape[-1] if weights.ndim == 2 else -1
        if i:
            before = len(pairs[i - 1][1])
        if weights.shape != (size, before):
            words = (
                f"weights of shape {weights.shape} and offsets of shape {offsets.shape}"
            )
            raise ControllerError(
                f"policy: layer {i}: {words}, must be (outputs, inputs) and (outputs,)"
            )
        if not (np.isfinite(weights).all() and np.isfinite(offsets).all()):
            raise ControllerError(f"policy: layer {i}: must be finite numbers")
    inputs, outputs = pairs[0][0].shape[1], len(pairs[-1][1])
    middle = _row("means", means, inputs, 0.0)
    spread = _row("deviations", deviations, inputs, 1.0)
    if not (spread > 0.0).all():
        raise ControllerError("policy: deviations: must be above 0")
    return Network(
        means=tuple(middle.tolist()),
        # a product for each number in flight in place of a division
        factors=tuple((1.0 / spread).tolist()),
        layers=tuple(
            Layer(
                weights=tuple(map(tuple, weights.tolist())),
                offsets=tuple(offsets.tolist()),
            )
            for weights, offsets in pairs
        ),
        scales=(1.0,) * outputs,
        limits=(1.0,) * outputs,
    )


def _row(field: str, given: Sequence[float] | None, count: int, usual: float) -> Array:
    """Check that a list has ``count`` finite numbers, or fill it with a default
    number.
    """
    try:
        row = np.full(count, usual) if given is None else doubles(given)
    except (TypeError, ValueError):
        # of no length, so that it is refused below
        row = np.full(0, usual)
    if row.shape != (count,) or not np.isfinite(row).all():
        raise ControllerError(
            f"policy: {field} = {shown(given)}: must be {count} finite numbers"
        )
    return row


def task_of(environment: object) -> LearningTask:
    """Learning task of an environment, also of one inside Gymnasium wrappers.

    Raises:
        ControllerError: it is none of this library's.
    """
    task = getattr(
        getattr(getattr(environment, "unwrapped", None), "lanes", None),
        "task",
        environment,
    )
    if not isinstance(task, LearningTask):
        raise ControllerError(
            f"environment = {shown(environment)}: must be an environment of skyarm.envs"
        )
    return task
