"""Reinforcement learning environments with the interface of Gymnasium 1.x (the extra
``gym``).
"""

from skyarm.envs.action_kinds import (
    ACTIONS,
    Actions,
    RatesAndThrust,
    References,
    Residual,
    RotorsAndJoints,
)
from skyarm.envs.observed_quantities import (
    OBSERVED,
    Attitude,
    BodyRate,
    JointAngles,
    JointErrors,
    JointRates,
    LastAction,
    Observed,
    PositionError,
    Result,
    Sight,
    SpecificForce,
    TipError,
    VelocityError,
)
from skyarm.envs.policy_law import as_law, network
from skyarm.envs.registered_environments import make_jax, register
from skyarm.envs.reward_terms import (
    REWARDS,
    ActionChange,
    ActionSize,
    Alive,
    JointDistance,
    Lost,
    PositionDistance,
    PositionNear,
    RewardTerm,
    Spin,
    TipDistance,
    TipNear,
    Upright,
)

__all__ = [
    "ACTIONS",
    "OBSERVED",
    "REWARDS",
    "ActionChange",
    "ActionSize",
    "Actions",
    "Alive",
    "Attitude",
    "BodyRate",
    "JointAngles",
    "JointDistance",
    "JointErrors",
    "JointRates",
    "LastAction",
    "Lost",
    "Observed",
    "PositionDistance",
    "PositionError",
    "PositionNear",
    "RatesAndThrust",
    "References",
    "Residual",
    "Result",
    "RewardTerm",
    "RotorsAndJoints",
    "Sight",
    "SpecificForce",
    "Spin",
    "TipDistance",
    "TipError",
    "TipNear",
    "Upright",
    "VelocityError",
    "as_law",
    "make_jax",
    "network",
    "register",
]

register()
