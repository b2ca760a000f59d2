"""Rotor sources: one file for each form in which programs state rotors (kind
``rotor_source`` of the registry).
"""
