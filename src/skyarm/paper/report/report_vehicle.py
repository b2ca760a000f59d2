"""The paper's vehicle as it flies here: a drawing with frames, joints and rotors."""

from __future__ import annotations

from skyarm.figures.style import image_bytes
from skyarm.figures.vehicle_drawing import vehicle_drawing
from skyarm.pages import image
from skyarm.vehicle.vehicle_files import load_vehicle

VEHICLE = "hummingbird_arm2_rotors"
"""What flies in every case."""

DPI = 150.0

NAME = "The vehicle from three sides"


def vehicle_section() -> str:
    """HTML of the drawing."""
    drawing = image_bytes(vehicle_drawing(load_vehicle(VEHICLE)), dpi=DPI)
    words = f"{NAME}: frames, joints with their positive senses, and rotors of {VEHICLE}. Sizes of bodies are guesses."
    return image(NAME, words, drawing, wide=True)
