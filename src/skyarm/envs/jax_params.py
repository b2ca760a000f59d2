"""Numbers of an environment in JAX: a plain number for each path, or the numbers of the distribution it is drawn from.

They are a pytree, so that a policy may be learned over ranges that widen, or a number be found by its gradient, without
anything being compiled anew.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import ndtri

from skyarm.records.files import must_be_one_of, shown
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.studies.sweep.distributions import Distribution, LogUniform, Normal, Uniform

KINDS = ("uniform", "normal", "log_uniform", "list")


def params_of(distribution: Distribution, dtype: Any) -> dict[str, Any]:
    """A distribution as ``{kind: numbers}``; a grid is the list of its values."""
    if isinstance(distribution, Uniform):
        kind, numbers = "uniform", [distribution.low, distribution.high]
    elif isinstance(distribution, Normal):
        kind, numbers = "normal", [distribution.mean, distribution.std]
    elif isinstance(distribution, LogUniform):
        kind, numbers = "log_uniform", [distribution.low, distribution.high]
    else:
        kind, numbers = "list", list(distribution.values)
    return {kind: jnp.asarray(np.array(numbers), dtype)}


def drawn(given: Any, unit: Any) -> Any:
    """The number of an episode: the quantile at a number uniform in (0, 1), or a plain number as it is."""
    if not isinstance(given, Mapping):
        return given
    ((kind, numbers),) = given.items()
    if kind == "list":
        count = numbers.shape[0]
        return numbers[jnp.minimum((unit * count).astype(np.int32), count - 1)]
    first, second = numbers
    if kind == "uniform":
        return first + (second - first) * unit
    if kind == "log_uniform":
        return first * jnp.exp(jnp.log(second / first) * unit)
    # the largest number below 1: a unit of single precision may be rounded up
    below = jnp.nextafter(jnp.ones_like(unit), jnp.zeros_like(unit))
    return first + second * ndtri(jnp.minimum(unit, below))


def require_params(params: Any, paths: tuple[str, ...]) -> None:
    """Refuse numbers that are not those of the paths, while a function is traced; values are not looked at.

    Raises:
        ScenarioError: a path that is missing or unknown, or a kind that there is none of.
    """
    if not isinstance(params, Mapping):
        raise ScenarioError(f"params = {shown(params)}: must be a table of paths, as make_jax gives it")
    missing = [path for path in paths if path not in params]
    if missing:
        raise ScenarioError(f"params: {missing[0]!r} is missing")
    for path, given in params.items():
        if path not in paths:
            raise ScenarioError(f"params: path = {shown(path)}: {must_be_one_of(dict.fromkeys(paths), path)}")
        _require_one(f'params["{path}"]', given)


def _require_one(at: str, given: Any) -> None:
    if not isinstance(given, Mapping):
        shape = _shape(at, given, "one number, or {kind: numbers}")
        if shape != ():
            raise ScenarioError(f"{at}: shape {shape}, must be one number, or {{kind: numbers}}")
        return
    if len(given) != 1 or next(iter(given)) not in KINDS:
        raise ScenarioError(f"{at}: {', '.join(map(str, given))}: must have exactly one of {', '.join(KINDS)}")
    ((kind, numbers),) = given.items()
    shape = _shape(f'{at}["{kind}"]', numbers, "numbers")
    if len(shape) != 1 or (kind != "list" and shape != (2,)) or not math.prod(shape):
        raise ScenarioError(f"{at}: {kind} of shape {shape}, must be of shape {'(n,)' if kind == 'list' else '(2,)'}")


def _shape(at: str, given: Any, wanted: str) -> tuple[int, ...]:
    """Shape of numbers; what JAX makes no real numbers of is refused, which it would do in words of its own."""
    try:
        found = given if isinstance(given, jax.Array) else np.asarray(given)
    except (TypeError, ValueError):
        found = np.asarray(None)
    if not (jnp.issubdtype(found.dtype, np.floating) or jnp.issubdtype(found.dtype, np.integer)):
        raise ScenarioError(f"{at} = {shown(given)}: must be {wanted}")
    return tuple(found.shape)
