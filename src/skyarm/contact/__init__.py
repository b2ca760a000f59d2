"""Contact of a vehicle with surfaces of the world: material, surfaces, points that touch, the force between them."""

from skyarm.contact.carrier import CarriedFrame, Carrier
from skyarm.contact.contact import Contact, ContactMemory
from skyarm.contact.contact_point import ContactPoint, Touch
from skyarm.contact.free_object import FreeObject, ObjectMotion
from skyarm.contact.gripper import Command, Grip, Gripper
from skyarm.contact.material import Material
from skyarm.contact.mechanism import Detent, Mechanism, MechanismMotion
from skyarm.contact.surface import Surface

__all__ = [
    "CarriedFrame",
    "Carrier",
    "Command",
    "Contact",
    "ContactMemory",
    "ContactPoint",
    "Detent",
    "FreeObject",
    "Grip",
    "Gripper",
    "Material",
    "Mechanism",
    "MechanismMotion",
    "ObjectMotion",
    "Surface",
    "Touch",
]
