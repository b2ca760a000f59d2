"""Simulated plants; they share the models of rotors, wind and joint friction, but no
rigid-body code.
"""
