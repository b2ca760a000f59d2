"""Environments for learning, in the conventions of Gymnasium 1.x (the extra ``gym``), as fast as the engine."""

from skyarm.env.action_kinds import ACTIONS, Actions, RatesAndThrust, References, Residual, RotorsAndJoints
from skyarm.env.env_views import Result, Sight
from skyarm.env.make_jax import make_jax
from skyarm.env.observed_quantities import (
    OBSERVED,
    Attitude,
    BodyRate,
    JointAngles,
    JointErrors,
    JointRates,
    LastAction,
    Observed,
    PositionError,
    SpecificForce,
    TipError,
    VelocityError,
)
from skyarm.env.policy_law import as_law, network
from skyarm.env.registered_environments import register
from skyarm.env.reward_terms import (
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
