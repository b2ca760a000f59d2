"""Environments for learning, in the conventions of Gymnasium 1.x (the extra ``gym``), as fast as the engine."""

from skyarm.env.action_kinds import Actions, RatesAndThrust, References, Residual, RotorsAndJoints
from skyarm.env.env_views import Result, Sight
from skyarm.env.observed_quantities import OBSERVED, Observed
from skyarm.env.policy_law import as_law, network
from skyarm.env.registered_environments import register
from skyarm.env.reward_terms import REWARDS, RewardTerm

__all__ = [
    "OBSERVED",
    "REWARDS",
    "Actions",
    "Observed",
    "RatesAndThrust",
    "References",
    "Residual",
    "Result",
    "RewardTerm",
    "RotorsAndJoints",
    "Sight",
    "as_law",
    "network",
    "register",
]

register()
