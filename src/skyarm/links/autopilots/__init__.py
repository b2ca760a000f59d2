"""Autopilots in the loop: PX4, ArduPilot and Betaflight fly the base of a simulated vehicle, a joint law its arm."""
