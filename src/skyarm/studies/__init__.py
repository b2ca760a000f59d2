"""Studies of many flights: sweeps, controller comparison, gain tuning, identification,
margins, feasibility.
"""
