"""Contact of a vehicle with its environment: materials, surfaces, contact points and
contact forces.
"""

from skyarm.world.contact.carrier import CarriedFrame, Carrier
from skyarm.world.contact.contact import Contact
from skyarm.world.contact.contact_memory import ContactMemory
from skyarm.world.contact.contact_point import ContactPoint, Touch
from skyarm.world.contact.free_object import FreeObject, ObjectMotion
from skyarm.world.contact.gripper import Command, Grip, Gripper
from skyarm.world.contact.material import Material
from skyarm.world.contact.mechanism import Detent, Mechanism, MechanismMotion
from skyarm.world.contact.surface import Surface

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
