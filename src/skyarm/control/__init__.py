"""Controllers: control laws as pure functions step(memory, measurement, reference, dt,
*, par) -> (memory, command).
"""
