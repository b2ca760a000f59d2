"""Whole-body planning: from a task in phases to a motion of base, arm and rotors within
all limits.
"""
