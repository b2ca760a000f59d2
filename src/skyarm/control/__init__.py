"""Controllers: pure laws step(memory, measurement, reference, dt, *, par) -> (memory, command)."""
