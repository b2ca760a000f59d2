"""Contact of a vehicle with surfaces of the world: material, surfaces, points that touch, the force between them."""

from skyarm.contact.contact import Contact, ContactMemory, Touch
from skyarm.contact.contact_point import ContactPoint
from skyarm.contact.material import Material
from skyarm.contact.surface import Surface

__all__ = ["Contact", "ContactMemory", "ContactPoint", "Material", "Surface", "Touch"]
