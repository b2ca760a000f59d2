"""Integrators of the plants by name, and the steps that stiff joint friction allows them."""

INTEGRATORS = ("rk4", "euler", "rk4_staged")
"""On the rigid-body plant the third is the first: loads are evaluated at each stage anyway."""

FRICTION_STEP = 0.6
"""Largest product of friction's decay rate and an RK4 step with loads at each stage (stable to 2.78; error 6e-4 of the
fastest mode)."""

HELD_FRICTION_STEP = 0.1
"""The same with loads held for a step: friction is of first order then, 5 % off at 0.1."""

VERLET = "verlet"
"""The method of the rigid-body plant in the place of its Runge-Kutta steps near to what is coupled to the vehicle: no
choice of a scenario. It takes forces once a step, where a Runge-Kutta step takes them four times."""

STAGES = 4
"""Times that a Runge-Kutta step takes forces."""
