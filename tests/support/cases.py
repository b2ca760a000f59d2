"""Cases of tests: those sampled, documents as TOML and URDF texts, whole texts of
records.

- Cases of which a fixed share is tried in ``make test``, and all in ``make thorough``.
- TOML documents of tables, for tests that write files.
- Short URDF files for tests, and Pinocchio's dynamics of them.
- Whole text of a record, by which two are told apart: the text that a notebook prints
  is short.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pytest

from skyarm.dynamics import array_front as arrays
from skyarm.records.files.toml import toml_key, toml_value


def sampled(
    values: Sequence[Any], every: int, *, keep: Sequence[Any] = ()
) -> list[Any]:
    """Parameters: each of ``keep`` and the first of ``every`` values plain, the rest
    marked ``thorough``.

    A value that is a tuple gives several parameters, as ``pytest.mark.parametrize``
    takes them.
    """
    found = []
    for place, value in enumerate(values):
        given = value if isinstance(value, tuple) else (value,)
        plain = value in keep or place % every == 0
        found.append(pytest.param(*given, marks=() if plain else pytest.mark.thorough))
    return found


def toml_text(document: Mapping[str, Any]) -> str:
    """TOML document of a table: plain values first, then a section for each table and
    list of tables.
    """
    lines = [
        f"{toml_key(name)} = {toml_value(value)}"
        for name, value in document.items()
        if not _is_section(value)
    ]
    for name, value in document.items():
        if isinstance(value, Mapping):
            lines += _section(f"[{toml_key(name)}]", value)
        elif _is_section(value):
            for table in value:
                lines += _section(f"[[{toml_key(name)}]]", table)
    return "\n".join(lines) + "\n"


def _is_section(value: object) -> bool:
    listed = (
        isinstance(value, (list, tuple))
        and bool(value)
        and all(isinstance(each, Mapping) for each in value)
    )
    return isinstance(value, Mapping) or listed


def _section(head: str, table: Mapping[str, Any]) -> list[str]:
    return [
        "",
        head,
        *(f"{toml_key(name)} = {toml_value(value)}" for name, value in table.items()),
    ]


def link(name, inertia=(0.01, 0.011, 0.012), mass=0.5):
    xx, yy, zz = inertia
    return (
        f'<link name="{name}"><inertial><origin xyz="0.01 0.02 -0.1"/><mass'
        f' value="{mass}"/><inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0.0002"'
        ' ixz="0" iyz="0"/></inertial></link>'
    )


def joint(name, parent, child, more, kind="revolute", axis="0 0.6 0.8"):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child'
        f' link="{child}"/><origin xyz="0.1 0.05 -0.2" rpy="0.1 0.2 0.3"/><axis'
        f' xyz="{axis}"/>{more}</joint>'
    )


def limits(lower=-1.0, upper=1.0, effort='effort="3"'):
    return f'<limit lower="{lower}" upper="{upper}" {effort} velocity="4"/>'


def robot(*parts):
    return f'<robot name="r">{"".join(parts)}</robot>'


def saved(tmp_path, text, name="r.urdf"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def pinocchio_of(text, vehicle, values):
    """Mass matrix and bias of Pinocchio's parse, whose mimics are joints like others,
    at values of ours.

    Args:
        values: joint's name -> (value, ratio to a joint of the vehicle, that one's
            index, or -1 where it is held).
    """
    pin = pytest.importorskip("pinocchio")
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    data, q, n = model.createData(), pin.neutral(model), vehicle.n
    G = np.zeros((model.nv, 6 + n))
    G[:6, :6] = np.eye(6)
    for name, (value, ratio, leader) in values.items():
        each = model.joints[model.getJointId(name)]
        q[each.idx_q] = value
        if leader >= 0:
            G[each.idx_v, 6 + leader] = ratio
    v = np.concatenate([np.zeros(6), np.linspace(0.5, 1.0, n)])
    M = pin.crba(model, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    return G.T @ M @ G, G.T @ pin.rnea(model, data, q, G @ v, np.zeros(model.nv)), v


def agrees(vehicle, expected, joints):
    M, bias, v = expected
    still = (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.asarray(joints))
    np.testing.assert_allclose(
        arrays.mass_matrix(vehicle, *still), M, rtol=0, atol=1e-13 * np.abs(M).max()
    )
    found = arrays.inverse_dynamics(vehicle, *still, v, np.zeros_like(v), gravity=9.81)
    np.testing.assert_allclose(found, bias, rtol=0, atol=1e-13 * np.abs(bias).max())


def whole_text(value: Any) -> str:
    """Every field at any depth, as the text of a plain dataclass has it."""
    if is_dataclass(value) and not isinstance(value, type):
        held = ", ".join(
            f"{each.name}={whole_text(getattr(value, each.name))}"
            for each in fields(value)
            if each.repr
        )
        return f"{type(value).__qualname__}({held})"
    if isinstance(value, Mapping):
        items = (f"{key!r}: {whole_text(each)}" for key, each in value.items())
        return f"{{{', '.join(items)}}}"
    return (
        f"({', '.join(map(whole_text, value))})"
        if isinstance(value, (tuple, list))
        else repr(value)
    )
