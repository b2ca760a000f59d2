"""Autopilots in the loop: PX4, ArduPilot or Betaflight flies the base, a control law
moves the joints.
"""
