"""Comparison of controllers: same cases, same noise and same perturbed plants for
all.
"""
