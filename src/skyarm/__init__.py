"""skyarm: aerial manipulation. Multirotors that carry robot arms: dynamics, control, simulation."""
__version__ = "0.1.0"
