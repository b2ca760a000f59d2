"""Feasibility checks of ``skyarm check`` for a vehicle or a scenario, one module per
topic.
"""
