"""Other simulators and environments, where they are installed, beside this library's.

MuJoCo, MJX and Pinocchio are given our vehicle, plant only: no controller and no
rotors, which is in their favour. crazyflow, RotorPy, PyFlyt and gym-pybullet-drones fly
a quadrotor of their own without an arm. Beside their environments fly a quadrotor
without an arm and one with a two-joint arm of this library, with the same kind of
action, the same control rate and the same number of integration steps a control period.
A single environment of a peer flies on past the end of its episode, so that its slow
beginnings are not timed; ours begins anew.
"""

from __future__ import annotations

import importlib.util
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from bench_engines import MUJOCO_STEP as STEP
from bench_engines import Flight, model_of, steps_of
from bench_timing import Contender

from skyarm.compile.llvm.kernel import Kernel, host_width
from skyarm.compile.llvm.llvm_text import Lanes
from skyarm.plant.compiled import Steps
from skyarm.scenario.scenario_file import scenario_from
from skyarm.scenario.scenario_record import Scenario
from skyarm.vehicle.vehicle_records import Vehicle


@dataclass(frozen=True)
class Extent:
    """Extent of the environments' contests.

    Attributes:
        worlds: of vector environments. steps: of these a round. single_steps: of single
            ones a round.
    """

    worlds: int = 1024
    steps: int = 64
    single_steps: int = 500


USUAL = Extent()

VEHICLES = {"no arm": "hummingbird", "two-joint arm": "hummingbird_arm2_rotors"}

STARTS = {
    **{f"initial.position.{axis}": {"uniform": [-1.0, 1.0]} for axis in "xy"},
    "initial.position.z": {"uniform": [1.0, 2.0]},
    **{f"initial.velocity.{axis}": {"uniform": [-1.0, 1.0]} for axis in "xyz"},
}
"""Beginnings of the vector environments, as crazyflow draws them."""


def installed(name: str) -> bool:
    """Whether a module can be imported, without doing it."""
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def pinocchio(vehicle: Vehicle, calls: int = 4000) -> list[Contender]:
    """Pinocchio's forward dynamics alone, called from Python, as if a call were a step
    of 1 ms.
    """
    if not installed("pinocchio"):
        return []
    import pinocchio as pin

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "vehicle.xml"
        described = model_of(vehicle)
        described.compile()
        path.write_text(described.to_xml())
        model = pin.buildModelFromMJCF(str(path))
    data = model.createData()
    q, v, tau = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)

    def run() -> float:
        for _ in range(calls):
            pin.aba(model, data, q, v, tau)
        return calls * STEP

    return [
        Contender(
            "pinocchio aba",
            "forward dynamics only, one core, a call from Python each 1 ms",
            run,
        )
    ]


def guests(vehicle: Vehicle) -> list[Contender]:
    """All that are installed."""
    return [make(vehicle) for name, make in GUESTS.items() if installed(name)]


def crazyflow(worlds: int = 4096, steps: int = 50) -> Contender:
    """crazyflow's closed loop: state controller at 100 Hz, physics at 500 Hz, f32, no
    arm.
    """
    from crazyflow.control import Control
    from crazyflow.sim import Sim

    sim: Any = Sim(n_worlds=worlds, n_drones=1, control=Control.state)
    wanted = np.zeros((worlds, 1, 16))
    # 1 m up, level: position, velocity, acceleration, quaternion xyzw
    wanted[..., 2], wanted[..., 12] = 1.0, 1.0

    def run() -> float:
        sim.state_control(wanted)
        sim.step(steps)
        sim.data.states.pos.block_until_ready()
        return worlds * steps / float(sim.freq)

    return Contender(
        f"crazyflow {worlds}",
        f"closed loop of its own drone, no arm, 500 Hz, f32, {worlds} worlds",
        run,
    )


def mjx(vehicle: Vehicle, worlds: int = 256, steps: int = 20) -> Contender:
    """MJX on the processor or GPU that JAX finds, f32."""
    import jax
    from mujoco import mjx as library

    model: Any = library.put_model(model_of(vehicle).compile())
    start = library.make_data(model)

    def advance(data: Any) -> Any:
        return jax.lax.fori_loop(0, steps, lambda _, x: library.step(model, x), data)

    batch: Any = jax.jit(jax.vmap(advance))
    data = jax.vmap(lambda _: start)(np.arange(worlds))

    def run() -> float:
        batch(data).qpos.block_until_ready()
        return worlds * steps * STEP

    return Contender(
        "mjx",
        f"plant only, Euler 1 ms, {worlds} worlds on {jax.devices()[0].platform}",
        run,
    )


def rotorpy(steps: int = 100) -> Contender:
    """RotorPy's own quadrotor in hover, no arm and no controller, its adaptive
    integrator asked every 1 ms.
    """
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    craft: Any = Multirotor(quad_params)
    hover = np.sqrt(quad_params["mass"] * 9.81 / (4.0 * quad_params["k_eta"]))
    control = {"cmd_motor_speeds": np.full(4, hover)}

    def run() -> float:
        state = craft.initial_state
        for _ in range(steps):
            state = craft.step(state, control, STEP)
        return steps * STEP

    return Contender(
        "rotorpy", "plant of its own quadrotor, no arm, a call each 1 ms, one core", run
    )


def environments(extent: Extent = USUAL) -> list[Contender]:
    """Environments with drawn actions, whose episodes end and begin; none without
    Gymnasium.
    """
    if not installed("gymnasium"):
        return []
    from skyarm.envs.named_tasks import make_vector
    from skyarm.envs.vector_environment import VectorEnvironment

    windy = "the paper's Case 3 in wind"
    return [
        stepped(
            VectorEnvironment(extent.worlds, scenario="case3_wind"),
            "env commands",
            f"{windy}, rotors and joints",
            extent.steps,
        ),
        stepped(
            VectorEnvironment(extent.worlds, scenario="case3_wind", actions="residual"),
            "env residual",
            f"{windy}, residual on the paper's law",
            extent.steps,
        ),
        stepped(
            make_vector(extent.worlds, task="Hover"),
            "env no arm",
            "a quadrotor without an arm, starts drawn",
            extent.steps,
        ),
    ]


def stepped(envs: Any, name: str, words: str, steps: int) -> Contender:
    """Some steps of all worlds by drawn actions; it returns environment steps in place
    of simulated seconds.
    """
    shape = (steps, *(envs.action_space.shape or ()))
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, shape).astype(np.float32)
    envs.reset(seed=0)

    def run() -> float:
        for action in actions:
            envs.step(action)
        return float(envs.num_envs * steps)

    return Contender(name, f"{words}, f32, {envs.num_envs} worlds, 1 thread", run)


def peers(extent: Extent = USUAL) -> Iterator[list[Contender]]:
    """A list for each installed peer: the peer, and ours beside it; nothing without
    Gymnasium.
    """
    if installed("gymnasium"):
        yield from (make(extent) for name, make in PEERS.items() if installed(name))


def absent() -> list[str]:
    """Libraries that would be measured and are not installed."""
    names = ("gymnasium", "jax", "pinocchio", *GUESTS, *PEERS)
    return [name for name in dict.fromkeys(names) if not installed(name)]


def beside_crazyflow(extent: Extent) -> list[Contender]:
    """Vector environments at 500 Hz, one Euler step a control period, f32, drawn
    actions, episodes that begin anew.

    crazyflow's drones take angles and thrust, with its usual dynamics (a fitted
    second-order response of the angles, no rotors) and with its rigid body with rotors;
    ours take body rates and thrust, and fly rigid bodies with rotors.
    """
    import jax
    from crazyflow.dynamics import Dynamics
    from crazyflow.envs.reach_pos_env import ReachPosEnv

    wait: Any = jax.block_until_ready

    def flown(dynamics: Any) -> Contender:
        envs: Any = ReachPosEnv(num_envs=extent.worlds, dynamics=dynamics)
        space = envs.single_action_space
        drawn = np.random.default_rng(0).uniform(
            space.low, space.high, (extent.steps, extent.worlds, *space.shape)
        )
        actions = [jax.numpy.asarray(each, np.float32) for each in drawn]
        envs.reset(seed=0)

        def run() -> float:
            for action in actions:
                found = envs.step(action)
            wait(found[:4])
            return float(extent.steps * extent.worlds)

        words = f"its position task, angles and thrust, f32, {extent.worlds} worlds"
        return Contender(f"crazyflow {dynamics}", words, run)

    return [
        *(flown(each) for each in (Dynamics.so_rpy, Dynamics.first_principles)),
        *_vectors(500, extent),
    ]


def beside_pyflyt(extent: Extent) -> list[Contender]:
    """Single environments at 120 Hz, two integration steps a control period, body rates
    and thrust.
    """
    from PyFlyt.gym_envs.quadx_envs.quadx_hover_env import QuadXHoverEnv

    env: Any = QuadXHoverEnv(
        agent_hz=120, flight_dome_size=np.inf, max_duration_seconds=1e9
    )
    climbing = np.array([0.0, 0.0, 0.0, 0.6])
    name = "PyFlyt QuadX-Hover"
    peer = _single(env, climbing, name, "rates and thrust", extent.single_steps)
    return [peer, *_singles(120, 240, "rates_and_thrust", extent)]


def beside_pybullet_drones(extent: Extent) -> list[Contender]:
    """Single environments at 30 Hz, eight integration steps a control period, speeds of
    the rotors.
    """
    from gym_pybullet_drones.envs.HoverAviary import HoverAviary
    from gym_pybullet_drones.utils.enums import ActionType

    env: Any = HoverAviary(act=ActionType.RPM, ctrl_freq=30, pyb_freq=240)
    hover = np.zeros(env.action_space.shape)
    name = "gym-pybullet-drones Hover"
    peer = _single(env, hover, name, "speeds of rotors", extent.single_steps)
    return [peer, *_singles(30, 240, "rotors_and_joints", extent)]


def place_to_reach(
    vehicle: str, control: int, physics: int, duration: float
) -> Scenario:
    """A vehicle of the library that is to hold a place, by Euler steps."""
    table: dict[str, Any] = {
        "schema": 1,
        "name": "place_to_reach",
        "duration": duration,
        "rates": {"physics": physics, "control": control, "reference": control},
        "plant": {"vehicle": vehicle, "integrator": "euler"},
        "controller": {"law": "decoupled_pd"},
        "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.5]}},
    }
    if vehicle != VEHICLES["no arm"]:
        table["reference"]["joints"] = [0.0, 0.0]
    return scenario_from(table, "place_to_reach")


def _vectors(rate: int, extent: Extent) -> list[Contender]:
    """Ours: many worlds, one integration step a control period, one thread."""
    from skyarm.envs.vector_environment import VectorEnvironment

    found = []
    for words, vehicle in VEHICLES.items():
        envs = VectorEnvironment(
            extent.worlds,
            scenario=place_to_reach(vehicle, rate, rate, 10.0),
            actions="rates_and_thrust",
            observation=("position_error", "attitude", "velocity_error", "body_rate"),
            reward=("position_near", "lost"),
            randomise=STARTS,
        )
        found.append(
            stepped(
                envs,
                f"ours, {words}",
                f"place to hold, rates and thrust, {rate} Hz",
                extent.steps,
            )
        )
    return found


def _singles(
    control: int, physics: int, actions: str, extent: Extent
) -> list[Contender]:
    """Ours: one world, double precision."""
    from skyarm.envs.single_environment import Environment

    found = []
    for words, vehicle in VEHICLES.items():
        scenario = place_to_reach(vehicle, control, physics, 60.0)
        env = Environment(
            scenario=scenario,
            actions=actions,
            precision="double",
            reward=("position_near", "lost"),
        )
        action = np.zeros(env.action_space.shape or ())
        steps = extent.single_steps
        found.append(
            _single(
                env,
                action,
                f"ours, {words}",
                f"{actions}, f64",
                steps,
                begins_anew=True,
            )
        )
    return found


def _single(
    env: Any,
    action: Any,
    name: str,
    words: str,
    steps: int,
    *,
    begins_anew: bool = False,
) -> Contender:
    """Some steps of one world from Python."""
    env.reset(seed=0)

    def run() -> float:
        for _ in range(steps):
            *_, ended, truncated, _ = env.step(action)
            if begins_anew and (ended or truncated):
                env.reset()
        return float(steps)

    return Contender(name, f"single environment, {words}", run)


GUESTS: dict[str, Callable[[Vehicle], Contender]] = {
    "crazyflow": lambda _: crazyflow(),
    "mujoco.mjx": mjx,
    "rotorpy": lambda _: rotorpy(),
}
"""Name of a library as it is imported -> its simulation of the paper's vehicle, or of
its own."""

PEERS: dict[str, Callable[[Extent], list[Contender]]] = {
    "crazyflow": beside_crazyflow,
    "PyFlyt": beside_pyflyt,
    "gym_pybullet_drones": beside_pybullet_drones,
}
"""Name of a library as it is imported -> its environment and ours beside it."""


def six_joints(duration: float) -> Scenario:
    """A hexarotor that holds its six-joint arm still under computed torque."""
    return scenario_from(
        {
            "schema": 1,
            "name": "six_joints",
            "duration": duration,
            "plant": {"vehicle": "hexarotor_arm6"},
            "controller": {"law": "hybrid_computed_torque"},
            "reference": {
                "base": {"kind": "hover", "position": [0.0, 0.0, 2.0]},
                "joints": [0.0, 0.5, -0.5, 0.0, 0.3, 0.0],
            },
        },
        "six_joints",
    )


BARE_RATE = 500
"""Hz, of physics and control of the bare quadrotor: crazyflow's own."""


def bare_quadrotor(duration: float, threads: int, blocks: int) -> Contender:
    """The Hummingbird without an arm in hover under its geometric controller, at the
    rates that crazyflow steps with.

    The whole controller runs at every step; crazyflow's runs its position loop at every
    fifth.
    """
    scenario = scenario_from(
        {
            "schema": 1,
            "name": "bare_quadrotor",
            "duration": duration,
            "rates": {"physics": BARE_RATE, "control": BARE_RATE, "reference": 100},
            "plant": {"vehicle": "hummingbird", "integrator": "euler"},
            "controller": {"law": "rotors_sim_position"},
            "reference": {"base": {"kind": "hover", "position": [0.0, 0.0, 1.0]}},
        },
        "bare_quadrotor",
    )
    flight = Flight.of(scenario, lambda seconds: Steps(round(BARE_RATE * seconds)))
    lanes = Lanes(host_width(single=True), single=True, contract=True)
    run = flight.runner(Kernel(flight.loop, lanes), blocks * lanes.width, threads)
    what = (
        f"closed loop of a quadrotor without an arm, Euler and control at {BARE_RATE}"
        " Hz, f32"
    )
    return Contender("bare f32", what, run)


def jax(scenario: Scenario, threads: int) -> list[Contender]:
    """JAX on the processor, if it is installed."""
    if importlib.util.find_spec("jax") is None:
        return []
    from jax_kernel import JaxKernel

    flight = Flight.of(scenario, steps_of(scenario), loops=False)
    found: list[Contender] = []
    for name in ("f64", "f32"):
        with _precision(name):
            kernel = JaxKernel(flight.loop, single=name == "f32")
        run = flight.runner(kernel, 64 * threads * (2 if name == "f32" else 1), threads)
        what = f"closed loop, RK4 5 ms, JAX on the processor, {name}"
        found.append(Contender(f"jax rk4 {name}", what, partial(_run_in, name, run)))
    return found


@contextmanager
def _precision(name: str) -> Iterator[None]:
    """JAX in double precision for a while: others in the same process rely on its
    single.
    """
    from jax import config

    settings: Any = config
    before = settings.read("jax_enable_x64")
    settings.update("jax_enable_x64", name == "f64")
    try:
        yield
    finally:
        settings.update("jax_enable_x64", before)


def _run_in(name: str, run: Callable[[], float]) -> float:
    with _precision(name):
        return run()
