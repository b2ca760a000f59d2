"""One picture of a flight: what is drawn at an instant, and the two renderers that draw
it, MuJoCo and viser.
"""
