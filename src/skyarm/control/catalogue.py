"""Controllers by name: laws with their options, presets with published gains, and laws
with tuned gains.

:data:`LAWS` lists the laws, :data:`PRESETS` the presets, :func:`tuned_factors` the laws
with tuned gains, whose names end in :data:`TUNED`. :func:`make_named` makes a
controller from any of these names, :func:`make_controller` from a law and its options.
"""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from skyarm.algebra import Scalar, Vec3
from skyarm.algebra.scalars import mul
from skyarm.control.controller import Controller, ControllerError, LawOptions
from skyarm.control.law_checks import call_maker
from skyarm.control.model import GeometricGains, JointGains, Model
from skyarm.records.content import keep_results
from skyarm.records.files import did_you_mean, must_be_one_of, nearest, shown
from skyarm.records.immutable import memoize, positional
from skyarm.records.leaves import leaves, part, rebuild, replace_at
from skyarm.records.registry import Registration, registrations
from skyarm.records.registry.plugins import law_of_file_key
from skyarm.records.registry.registrations import SHIPPED
from skyarm.records.registry.shipped import TUNED
from skyarm.records.units import parameters_of

__all__ = ["TUNED", "Controller", "ControllerError"]

OWN = "own"
"""Name of a scenario's own controller, with the options that the scenario gives it."""

BEARS_UNDRIVEN = ("rotors_sim_position", "decoupled_pd", "guo2023")
"""Names of the laws that keep the base in flight without joint torques. The others
count on them and fall with a slung load whose joints nothing drives
(``tests/studies/assess/test_hanging_joints.py`` flies them)."""


@positional
class Entry:
    """Catalogue entry of a control law, whose module is imported only when a controller
    is made.
    """

    row: Registration

    @property
    def title(self) -> str:
        """One-line title of the law."""
        return self.row.title

    def function(self) -> Callable[..., Controller]:
        """Function that makes the law's controller: (model, **options) ->
        Controller.
        """
        maker: Callable[..., Controller] = self.row.load()
        return maker

    def options(self) -> tuple[str, ...]:
        """Names of the law's options."""
        return _options_of(self.function())


@memoize
def _options_of(maker: Callable[..., Controller]) -> tuple[str, ...]:
    """Names of the options that the maker of a law takes by keyword."""
    parameters = parameters_of(maker).values()
    named = tuple(p.name for p in parameters if p.kind is p.KEYWORD_ONLY)
    more = any(p.kind is p.VAR_KEYWORD for p in parameters)
    # of a maker that takes any keyword ENTRIES lists the names
    return (
        (*named, *getattr(sys.modules[maker.__module__], "ENTRIES", ()))
        if more
        else named
    )


class _Entries(Mapping[str, Entry]):
    """Lazy mapping from names to the catalogue entries of registered laws or
    autopilots.
    """

    def __init__(self, kind: str) -> None:
        self._kind = kind

    def __getitem__(self, name: str) -> Entry:
        return Entry(registrations(self._kind)[name])

    def __iter__(self) -> Iterator[str]:
        return iter(registrations(self._kind))

    def __len__(self) -> int:
        return len(registrations(self._kind))


LAWS: Mapping[str, Entry] = _Entries("law")
"""Control laws by name: those of the library and those that users registered."""

AUTOPILOTS: Mapping[str, Entry] = _Entries("autopilot")
"""Autopilots by name: external programs, connected by a socket, that control the base
in place of a law."""


def entry_of(name: str) -> Entry:
    """Catalogue entry of a law or an autopilot by its name."""
    return LAWS[name] if name in LAWS else AUTOPILOTS[name]


def make_controller(name: str, model: Model, **options: Any) -> Controller:
    """Make a controller by its law's name.

    Args:
        name: a key of ``LAWS``.
        model: model of the controller.
        options: options of the law's maker, for example ``gains``, ``joint_gains``,
            ``mixer_policy`` of the paper's laws
            (:func:`skyarm.control.laws.paper.make_hybrid_computed_torque`).

    Raises:
        ControllerError: unknown law, an option the law does not have, or one with a
            wrong value.
        AllocationError: the model's rotors do not span torque and thrust.
    """
    if not is_one_of(name, LAWS) and not is_one_of(name, AUTOPILOTS):
        raise ControllerError(
            f"controller.law = {shown(name)}: {must_be_one_of(LAWS, name, SEE)}"
        )
    if not isinstance(model, Model):
        raise ControllerError(
            f"model = {shown(model)}: must be a Model of vehicle and gravity"
        )
    entry = entry_of(name)
    for option, value in options.items():
        if option not in entry.options():
            raise ControllerError(
                f"controller.{option} = {shown(value)}:"
                f" {no_option(name, entry.options(), option)}"
            )
    make = _make_shipped if entry.row.source == SHIPPED else call_maker
    made = make(entry.function(), name, model, options)
    # a maker may return another law's controller
    return replace(made, name=name) if made.name in LAWS else made


_make_shipped = keep_results(64)(call_maker)
"""Function as ``call_maker`` for makers of the library, which are pure: the members of
a team share a law, and so do scenarios that are read again. A user's maker may look at
whatever it likes. 64 is chosen: a miss makes the law anew."""


def suitable_options(law: str, given: Mapping[str, float]) -> dict[str, Any]:
    """Subset of given options that a law accepts."""
    options = entry_of(law).options()
    return {name: value for name, value in given.items() if name in options}


HUMMINGBIRD = GeometricGains(
    position=Vec3(4.0, 4.0, 4.0),
    velocity=Vec3(2.2, 2.2, 2.2),
    attitude=Vec3(0.7, 0.7, 0.035),
    rate=Vec3(0.1, 0.1, 0.025),
)
"""Gains of RotorS (lee_controller_hummingbird.yaml), repeated in Tables A1 and A2 of
Barakou et al. 2026."""

ACCELERATION = JointGains(stiffness=(350.0, 150.0), damping=(12.0, 10.0))
"""Joint gains on acceleration (1/s^2 and 1/s) of Barakou et al. 2026, Table A1."""

TORQUE = JointGains(stiffness=(1.0, 0.5), damping=(0.04, 0.02))
"""Joint gains on torque (N m/rad and N m s/rad) of Barakou et al. 2026, Table A2."""


@positional
class Preset:
    """Named preset: a law with its published gains or other options.

    Attributes:
        title: one line for people. law: a key of ``LAWS``. options: options of the law.
    """

    title: str
    law: str
    options: LawOptions


PRESETS: Mapping[str, Preset] = {
    "paper_ct": Preset(
        "the paper's computed torque, gains of its Table A1",
        "hybrid_computed_torque",
        {"gains": HUMMINGBIRD, "joint_gains": ACCELERATION},
    ),
    "paper_ct_euler": Preset(
        "`paper_ct` in the paper's Euler angles, undefined at a pitch of 90 degrees",
        "hybrid_computed_torque",
        {"gains": HUMMINGBIRD, "joint_gains": ACCELERATION, "euler": True},
    ),
    "paper_pd": Preset(
        "the paper's baseline, gains of its Table A2",
        "decoupled_pd",
        {"gains": HUMMINGBIRD, "joint_gains": TORQUE},
    ),
    "rotors_sim_hummingbird": Preset(
        "RotorS's controller with its Hummingbird's gains, joints free",
        "rotors_sim_position",
        {"gains": HUMMINGBIRD},
    ),
    "centroidal_joint": Preset(
        "the centroidal law, base and joints on their references",
        "centroidal",
        {"mode": "joint"},
    ),
    "centroidal_tip": Preset(
        "the centroidal law, the tip on its reference", "centroidal", {"mode": "tip"}
    ),
}
"""Presets by name: controllers of Barakou et al. 2026 with their gains, and the
centroidal law in both modes."""


def preset(
    name: str, model: Model, known: Mapping[str, float] | None = None
) -> Controller:
    """Make the controller of a named preset for a model.

    Args:
        name: a key of ``PRESETS``.
        model: model of the controller.
        known: properties of the loop, as far as the law has such options: ``delay``,
            ``control_period``, ``reference_period``, s.

    Raises:
        ControllerError: unknown name, or gains for another number of joints.
    """
    if not is_one_of(name, PRESETS):
        raise ControllerError(
            f"controller.preset = {shown(name)}: {must_be_one_of(PRESETS, name, SEE)}"
        )
    law, options = PRESETS[name].law, PRESETS[name].options
    try:
        return make_controller(
            # a preset's own options come last, so that the loop's do not change what it
            # stands for
            law,
            model,
            **{**suitable_options(law, known or {}), **options},
        )
    except ControllerError as error:
        cure = (
            f"; its gains are of one vehicle: law = {law!r} has some for any, or takes"
            " yours"
            if "gains" in options
            else ""
        )
        raise ControllerError(
            f"controller.preset = {name!r}: does not fit this model ({error}){cure}"
        ) from None


def rescale(controller: Controller, factors: Mapping[str, Scalar]) -> Controller:
    """Controller with some constants, given by parameter paths such as base.position,
    multiplied by factors.

    Raises:
        ControllerError: a path that its constants do not have.
    """
    par = controller.par
    for path, factor in factors.items():
        place = tuple(path.split("."))
        try:
            numbers = part(par, place)
        except (AttributeError, IndexError):
            raise ControllerError(
                f"controller.{path}: the law has no such constant"
            ) from None
        par = replace_at(
            par,
            {place: rebuild(numbers, [mul(leaf, factor) for leaf in leaves(numbers)])},
        )
    return replace(controller, par=par)


@lru_cache(maxsize=1)
def tuned_factors() -> Mapping[str, Mapping[str, float]]:
    """Tuned gains by law and parameter path, as factors on the law's default gains for
    any vehicle.

    How the factors in the file next to this one were found is described in
    docs/laws.md.
    """
    text = Path(__file__).with_name("tuned.toml").read_text("utf-8")
    laws: Mapping[str, Mapping[str, float]] = tomllib.loads(text)["law"]
    return laws


def make_tuned(name: str, model: Model, **options: Any) -> Controller:
    """Make a controller of a law by name, with tuned gains in place of the default
    ones.

    Raises:
        ControllerError: a law that has not been tuned.
    """
    factors = tuned_factors()
    if not is_one_of(name, factors):
        raise ControllerError(
            f"controller.law = {shown(name)}: has no tuned gains; there are"
            f" {sorted(factors)}"
        )
    return rescale(make_controller(name, model, **options), factors[name])


def make_named(
    name: str, model: Model, known: Mapping[str, float] | None = None
) -> Controller:
    """Make a controller by any name (preset, law or tuned law), with default options.

    Args:
        name: a key of ``PRESETS`` or ``LAWS``, or that of a tuned law and ``TUNED``.
        model: model of the controller.
        known: properties of the loop (:func:`preset`).

    Raises:
        ControllerError: unknown name, or a controller that does not fit the model.
        AllocationError: the model's rotors do not span torque and thrust.
    """
    if not is_named(name):
        raise ControllerError(f"controller = {shown(name)}: {must_be_named(name)}")
    if name in PRESETS:
        return preset(name, model, known)
    law = name if name in LAWS or name in AUTOPILOTS else name.removesuffix(TUNED)
    make = make_tuned if law != name else make_controller
    return make(law, model, **suitable_options(law, known or {}))


def is_named(name: object) -> bool:
    """True if a value is the name of a preset, law, tuned law or autopilot."""
    return any(is_one_of(name, names) for names in (every_name(), AUTOPILOTS))


def is_one_of(name: object, names: Container[str]) -> bool:
    """True if a value is a string and one of ``names``."""
    # a file may give a list, which cannot be looked up: it has no hash
    return isinstance(name, str) and name in names


def every_name() -> tuple[str, ...]:
    """Names of all presets, laws and laws with tuned gains."""
    return (*PRESETS, *LAWS, *(f"{law}{TUNED}" for law in tuned_factors()))


def law_of(name: str) -> str:
    """Name of the law that a preset, a law or a tuned law is of."""
    return PRESETS[name].law if name in PRESETS else name.removesuffix(TUNED)


def require_different(names: Sequence[str], field: str) -> None:
    """Reject a list of names that contains a controller twice.

    Raises:
        ControllerError: one line with the field and the two names.
    """
    seen: dict[str, str] = {}
    for name in names:
        # two texts may name one law of a file, so names are compared by its key
        key = law_of_file_key(name)
        if key in seen:
            alike = f"{shown(seen[key])} and {shown(name)} are one"
            raise ControllerError(
                f"{field} = {shown(list(names))}: must be a list of different presets"
                f" or laws; {alike}"
            )
        seen[key] = name


SEE = "skyarm show"
"""Command that lists all presets and laws."""

FILE_LIKE = re.compile(r"(?P<stem>.+?)(\.py:?|\.\w+:\w*|\.py:.*)")
"""Pattern of texts that were probably meant as FILE.py:make but do not have that
form."""


def must_be_named(name: object, others: str = "") -> str:
    """Error text for an unknown controller name: suggestions and the allowed values."""
    every = every_name()
    if isinstance(name, str) and (match := FILE_LIKE.fullmatch(name)):
        hint = (
            "a law of a file is FILE.py:make, its function named behind a colon, as"
            f" {match['stem']}.py:make; "
        )
    else:
        hint = did_you_mean(name, every)
    near = ", ".join(nearest(name, every))
    allowed = (
        f"a preset, a law or LAW{TUNED} ({near} ...; {SEE!r} shows all), or"
        " FILE.py:make on the command line"
    )
    return f"{hint}must be {others}{allowed}"


def no_option(law: str, options: Sequence[str], option: str) -> str:
    """Error text for an option that a control law does not have."""
    return (
        f"{'autopilot' if law in AUTOPILOTS else 'law'} {law!r} has no such option; "
        f"{did_you_mean(option, options)}it has {', '.join(options)}"
    )
