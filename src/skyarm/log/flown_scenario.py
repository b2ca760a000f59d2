"""Restore the scenario of a log from the log's metadata."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from skyarm.records.files import shown
from skyarm.records.identity import log_digest, own_files
from skyarm.records.registry import RegistryError
from skyarm.records.registry.plugins import identities
from skyarm.records.restore import restore

SCENARIO = "skyarm.scenario.scenario_record:Scenario"
"""Class of what a log keeps as ``scenario_record``."""

GROUPS = ("solver", "agent", "environment")
"""Fields of a scenario that are records themselves."""


def written_scenario(info: Mapping[str, Any]) -> dict[str, Any]:
    """Scenario of a log as plain data; empty if the log stores none."""
    record = info.get("scenario_record")
    return record if isinstance(record, dict) else {}


def written_part(info: Mapping[str, Any], *names: str) -> Any:
    """Part of the logged scenario, found by nested field names, as plain data; None if it does not exist."""
    found: Any = written_scenario(info)
    for name in names:
        found = found.get(name) if isinstance(found, dict) else None
    return found


def restored_part(info: Mapping[str, Any], *names: str) -> Any:
    """Part of the logged scenario, found by nested field names, as a record; None if it cannot be restored."""
    return restore_written(info, written_part(info, *names))


def restore_written(info: Mapping[str, Any], written: Any) -> Any:
    """Restore a record from a log's plain data; None if it cannot be restored."""
    try:
        return restore(written, info.get("plugins"))
    except (KeyError, TypeError, ValueError, AttributeError):
        return None


def flown_scenario(info: Mapping[str, Any], replaced: Mapping[str, Any]) -> Any:
    """Scenario of a log's ``info`` with some fields replaced, for :meth:`skyarm.Log.scenario_with`."""
    written, plugins, code = (info.get(name) or {} for name in ("scenario_record", "plugins", "code"))
    of = (info.get("versions") or {}).get("skyarm", "unknown")
    if not isinstance(written, dict) or written.get("type") != SCENARIO or not written.keys() >= {*GROUPS}:
        raise ValueError(f"scenario_record: must hold the scenario as this version writes it; skyarm {of} wrote it")
    if not _fits(info, written, code):
        raise ValueError(f"scenario_record: must be of the log's digest; it was changed after skyarm {of} wrote it")
    with _in_words_of_the_log(plugins):
        found = restore(written, {**code, **plugins})
    now = own_files(found)
    for name in sorted(code):
        if now.get(name, code[name]) != code[name]:
            raise ValueError(f"code {name!r} = {shown(now[name])}: must be {shown(code[name])} as it was flown")
    return found.with_words(**replaced)


def _fits(info: Mapping[str, Any], written: Mapping[str, Any], code: Any) -> bool:
    """True if the logged digest matches a scenario and its files of user code."""
    try:
        return isinstance(code, dict) and log_digest(written, code) == info.get("digest")
    except RecursionError:  # lists in lists, without end
        return False


@contextmanager
def _in_words_of_the_log(plugins: Mapping[str, str]) -> Iterator[None]:
    """Context manager that rewrites errors of restoring a scenario so that they name the log and missing plugins."""
    try:
        yield
    except RegistryError as error:
        raise ValueError(f"scenario_record: {error}") from None
    except (KeyError, TypeError, AttributeError, OverflowError) as error:
        raise ValueError(f"scenario_record: must be a record that was written ({error})") from None
    except ValueError as error:
        absent = [name for name in plugins if name not in identities()]
        needs = f"; it was flown with the plugins {', '.join(absent)}" if absent else ""
        raise ValueError(f"scenario_record: {error}{needs}") from None
