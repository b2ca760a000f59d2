"""Checks of a vehicle's ability to fly: one file per question, each answer a finding."""
