"""Environments for learning, in the conventions of Gymnasium 1.x (the extra ``gym``), as fast as the engine."""

from skyarm.env.registered_environments import register

register()
