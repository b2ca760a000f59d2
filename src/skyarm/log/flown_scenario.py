"""Restoration of a flight's scenario from the plain data in its log."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache, lru_cache
from typing import Any

from skyarm.records.files import must_be_one_of, shown
from skyarm.records.identity import log_digest, own_files
from skyarm.records.leaves import Place, replace_at
from skyarm.records.plain import Plain
from skyarm.records.registry import RegistryError
from skyarm.records.registry.plugins import code_of, identities
from skyarm.records.restore import restore
from skyarm.records.words import slots

SCENARIO = "skyarm.scenario.scenario_record:Scenario"
"""Class of the record stored in a log as ``scenario_record``."""

Info = dict[str, Any]
"""Description of a flight as stored in its log's file, plain data from outside; readers
check what they use."""


def written_scenario(info: Info) -> Info:
    """Scenario of a log as plain data, of one vehicle with that one as ``agent``; empty
    if the log stores none.
    """
    record = info.get("scenario_record")
    if not isinstance(record, dict):
        return {}
    agents = record.get("agents")
    only = [*agents.values()] if isinstance(agents, dict) else []
    # a log of one vehicle is read as if its file had named none
    return record | {"agent": only[0]} if len(only) == 1 else record


def written_at(info: Info, path: str) -> Any:
    """Plain data at a path of a log's scenario, such as plant.vehicle, by the keys of
    its file; None if missing.
    """
    head = path.split(".")
    tail = list[str]()
    # the longest key of the file that the path begins with; the rest are names inside
    # it
    while head and ".".join(head) not in _places():
        tail = [head.pop(), *tail]
    data: Any = written_scenario(info)
    for name in (*_places().get(".".join(head), ()), *tail):
        data = data.get(name) if isinstance(data, dict) else None
    return data


@cache
def _places() -> dict[str, Place]:
    """Keys of a scenario file, each with the path of its field in the scenario
    record.
    """
    kind: type = code_of(SCENARIO, {})
    # reversed, so that of two fields under one key the first counts
    return {slot.table: slot.record for slot in reversed(slots(kind))}


def restored_at(info: Info, path: str) -> Any:
    """Part of a log's scenario as dataclasses, by its path such as plant.vehicle; None
    if it cannot be restored.
    """
    return restore_written(info, written_at(info, path))


def restore_written(info: Info, written: Plain) -> Any:
    """Restore a dataclass from plain data in a log; None if that fails."""
    try:
        # through text, because a cache needs a key that can be hashed
        return _restore_text(json.dumps((written, info.get("plugins"))))
    except (KeyError, TypeError, ValueError, AttributeError):
        return None


# 16 is chosen: a miss costs 10 ms of a whole scenario (measured)
@lru_cache(maxsize=16)
def _restore_text(text: str) -> Any:
    """Restore a dataclass from JSON text of its plain data and of the plugins of then;
    most are read repeatedly.
    """
    return restore(*json.loads(text))


def warn_of_commands(info: Info) -> None:
    """Warn that the flight of a log that is flown again had commands from outside in
    place of its law's.
    """
    if info.get("commanded"):
        words = (
            "was flown by commands from outside, which no log keeps; its law flies in"
            " their place"
        )
        warnings.warn(f"the log of {shown(info.get('scenario'))} {words}", stacklevel=3)


def flown_scenario(info: Info, replaced: Mapping[str, object]) -> Any:
    """Restore a log's scenario from its metadata, with some entries of the scenario
    file replaced by path.
    """
    written, plugins, code = (
        info.get(name) or {} for name in ("scenario_record", "plugins", "code")
    )
    of = (info.get("versions") or {}).get("skyarm", "unknown")
    if (
        not isinstance(written, dict)
        or written.get("type") != SCENARIO
        or not {"agent", "agents"} & {*written}
    ):
        raise ValueError(
            "scenario_record: must hold the scenario as this version writes it; skyarm"
            f" {of} wrote it"
        )
    if not matches_digest(info, written, code):
        raise ValueError(
            "scenario_record: must be of the log's digest; it was changed after skyarm"
            f" {of} wrote it"
        )
    with _convert_errors(info, plugins):
        own = {**code, **plugins}  # of a user's part: it may change between two calls
        scenario = (
            restore(written, own) if own else _restore_text(json.dumps((written, own)))
        )
    now = own_files(scenario)
    for name in sorted(code):
        if now.get(name, code[name]) != code[name]:
            raise ValueError(
                f"code {name!r} = {shown(now[name])}: must be {shown(code[name])} as it"
                " was flown"
            )
    kind: type = type(scenario)
    fields = {slot.path: slot.field for slot in slots(kind)}
    for path in replaced:
        if path not in fields:
            raise ValueError(f"path = {shown(path)}: {must_be_one_of(fields, path)}")
    return (
        replace_at(scenario, {fields[path]: value for path, value in replaced.items()})
        if replaced
        else scenario
    )


def matches_digest(info: Info, written: Any, code: Any) -> bool:
    """True if a log's digest matches its scenario and files of user code."""
    try:
        return isinstance(code, dict) and log_digest(written, code) == info.get(
            "digest"
        )
    except RecursionError:  # lists in lists, without end
        return False


@contextmanager
def _convert_errors(info: Info, plugins: Mapping[str, str]) -> Iterator[None]:
    """Context manager that converts errors in restoring a scenario to a one-line
    message that names the log's field.
    """
    try:
        yield
    except RegistryError as error:
        raise ValueError(f"log of {shown(info.get('scenario'))}: {error}") from None
    # of a record that was edited by hand
    except (KeyError, TypeError, AttributeError, OverflowError) as error:
        raise ValueError(
            f"scenario_record: must be a record that was written ({error})"
        ) from None
    except ValueError as error:
        absent = [name for name in plugins if name not in identities()]
        needs = f"; it was flown with the plugins {', '.join(absent)}" if absent else ""
        raise ValueError(f"scenario_record: {error}{needs}") from None
