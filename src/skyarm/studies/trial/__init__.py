"""Trials: flights "like that scenario, but", described by tables of a file for any
vehicle and value.
"""
