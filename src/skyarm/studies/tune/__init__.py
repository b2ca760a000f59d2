"""Automatic tuning of controller gains on perturbed plants under stability margin
constraints.
"""
