"""All digits of a model in its XML: MuJoCo's own writer keeps six."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np

HEADER = "Written by skyarm export-mjcf; control of a rotor is its thrust in N, of a joint its effort in N m or N."


def exact_xml(spec: Any) -> str:
    """XML of a spec that has been compiled, with every number of its mechanics written so that it reads back the same.

    Args:
        spec: ``mujoco.MjSpec`` whose bodies, joints, sites, actuators and equalities have names.
    """
    root = ET.fromstring(spec.to_xml())
    root.insert(0, ET.Comment(f" {HEADER} "))
    option = root.find("option")
    if option is None:
        option = ET.SubElement(root, "option")
    option.set("timestep", _text(spec.option.timestep))
    option.set("gravity", _text(spec.option.gravity))
    _exact_bodies(root, spec)
    _exact(root, "joint", spec.joints, {"axis": "axis", "armature": "armature", "frictionloss": "frictionloss"})
    for element, joint in _pairs(root, "joint", spec.joints):
        if element.get("damping") is not None:
            element.set("damping", _text(np.ravel(joint.damping)[0]))
        if element.get("range") is not None:
            element.set("range", _text(joint.range))
    _exact(root, "site", spec.sites, {"pos": "pos", "quat": "quat"})
    for element, actuator in _pairs(root, "general", spec.actuators):
        element.set("gear", _text(actuator.gear))
        if element.get("ctrlrange") is not None:
            element.set("ctrlrange", _text(actuator.ctrlrange))
    ties = {tie.name: tie for tie in spec.equalities}
    for element in root.findall("equality/joint"):
        element.set("polycoef", _text(ties[element.get("name", "")].data[:5]))
    for element, key in _pairs(root, "key", spec.keys):
        for name in ("qpos", "qvel", "ctrl"):
            if element.get(name) is not None:
                element.set(name, _text(getattr(key, name)))
    return ET.tostring(root, encoding="unicode") + "\n"


def _exact_bodies(root: ET.Element, spec: Any) -> None:
    bodies = {body.name: body for body in spec.bodies}
    for element in root.iter("body"):
        body = bodies[element.get("name", "")]
        element.set("pos", _text(body.pos))
        element.set("quat", _text(body.quat))
        inertial = element.find("inertial")
        if inertial is not None:
            inertial.attrib.pop("fullinertia", None)
            for name, value in zip(
                ("pos", "quat", "mass", "diaginertia"), (body.ipos, body.iquat, body.mass, body.inertia), strict=True
            ):
                inertial.set(name, _text(value))


def _pairs(root: ET.Element, tag: str, elements: Any) -> list[tuple[ET.Element, Any]]:
    """Elements of the XML and of the spec by their names; those of the tree, not of equalities."""
    named = {each.name: each for each in elements}
    inside = {element for parent in root.findall("equality") for element in parent}
    found = [element for element in root.iter(tag) if element not in inside and element.get("type") != "free"]
    return [(element, named[element.get("name", "")]) for element in found]


def _exact(root: ET.Element, tag: str, elements: Any, fields: dict[str, str]) -> None:
    for element, held in _pairs(root, tag, elements):
        for attribute, name in fields.items():
            if element.get(attribute) is not None or attribute in ("axis", "pos"):
                element.set(attribute, _text(getattr(held, name)))


def _text(values: Any) -> str:
    """Numbers so that each reads back as itself."""
    return " ".join(repr(float(each)) for each in np.ravel(values))
