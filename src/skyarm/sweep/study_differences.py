"""In what two studies differ whose rows must not be mixed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from skyarm.sweep.chunk_file import Origin

PLUGINS = "plugins"


def differences(new: Origin, old: Origin) -> list[tuple[str, Any, Any]]:
    """(field, this study's, the folder's) of everything in which rows would differ."""
    ours, theirs = new.study, old.study
    found = [
        (name, ours.get(name), theirs.get(name))
        for name in dict.fromkeys([*ours, *theirs])
        if name not in ("vary", PLUGINS) and _unlike(ours.get(name), theirs.get(name))
    ]
    found += _other_plugins(ours.get(PLUGINS) or {}, theirs.get(PLUGINS) or {})
    found += _varied_differently(ours.get("vary") or {}, theirs.get("vary") or {}, bool(found))
    for label, digest in new.scenarios.items():
        if old.scenarios.get(label) != digest:
            found.append((f"scenario of {label!r}", digest[:12], str(old.scenarios.get(label))[:12]))
    if new.version != old.version:
        found.append(("version of skyarm", new.version, old.version))
    return found


def _other_plugins(new: Mapping[str, str], old: Mapping[str, str]) -> list[tuple[str, Any, Any]]:
    """Plugins that are not the same file or version, by name; None stands for one that is not loaded."""
    names = dict.fromkeys([*new, *old])
    return [(f"plugin {name!r}", new.get(name), old.get(name)) for name in names if new.get(name) != old.get(name)]


def _varied_differently(new: Mapping[str, Any], old: Mapping[str, Any], differ: bool) -> list[tuple[str, Any, Any]]:
    paths = dict.fromkeys([*new, *old])
    found = [
        (f'vary."{path}"', new.get(path), old.get(path)) for path in paths if _unlike(new.get(path), old.get(path))
    ]
    if not found and not differ and list(new) != list(old):
        return [("vary", list(new), list(old))]
    return found


def _unlike(one: Any, other: Any) -> bool:
    """Whether two values are written differently: the digest of a study tells 1 from 1.0."""
    return json.dumps(one) != json.dumps(other)
