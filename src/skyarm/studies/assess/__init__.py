"""Feasibility checks of a vehicle and a scenario: one file per question, each answer a finding."""
