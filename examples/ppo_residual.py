"""PPO in one file: a residual on the paper's law, learned in wind and flown on wrong plants beside `centroidal_tip`.

    python examples/ppo_residual.py                    # learns (seed 0), and flies the policy on 200 wrong plants
    python examples/ppo_residual.py --iterations 0     # flies the laws that nothing is learned for
    python examples/ppo_residual.py --plot curve.png   # the same for five seeds, with a figure

A policy displaces the reference that the law is told, a little each period: its action goes up or down from the last
one, so that a wind that stays can be learned away. It needs two extras: ``pip install "skyarm[gym,jax]"``.
"""

import argparse
import dataclasses
import time
from pathlib import Path

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np

import skyarm
import skyarm.envs as learn
from skyarm.control.laws.learned.law import Network
from skyarm.log.metrics.shortfall import LARGEST_ERROR
from skyarm.simulate.batch import Batch
from skyarm.studies.compare.perturbed_plants import Spread, draw

WORLDS, STEPS, ITERATIONS, EPOCHS, PARTS = 1024, 32, 160, 4, 4
GAMMA, LAMBDA, CLIP, RATE = 0.97, 0.95, 0.2, 2e-3
LARGEST = 0.5  # norm of a gradient; without this bound one seed in five learned badly
PACE, HELD = 0.02, 10  # a full change a period; periods that a change is held in training
REACH, INTEGRAL = 1.5, 0.5  # m of the reference at full action; 1/s, gain of the integral that needs no learning


@dataclasses.dataclass(frozen=True, slots=True)
class Stepwise:
    """A policy whose action is the last one plus ``pace`` times what its network says."""

    network: Network
    pace: float

    def __call__(self, numbers):
        """The next action; the last one ends an observation."""
        change = self.network(numbers)
        return tuple(a + self.pace * d for a, d in zip(numbers[-len(change) :], change, strict=True))


def with_integral(flight):
    """The law of a scenario on a reference that an integral of the tip error moves: what needs no learning."""
    step = INTEGRAL / flight.rates.control / REACH

    def policy(numbers):  # tip error, m, then the last action
        return (*(a + step * e for a, e in zip(numbers[3:6], numbers[:3], strict=True)), *numbers[6:])

    seen, moved = [learn.TipError(scale=1.0), "last_action"], learn.References(position=REACH)
    envs = gymnasium.make("skyarm/Scenario-v0", scenario=flight, actions=moved, observation=seen)
    return learn.as_law(policy, envs, name="integral")


def make_worlds(worlds):
    """Circles of all sizes from the first second on, in wind from any side; every plant another."""
    even = lambda low, high: {"uniform": [low, high]}  # noqa: E731
    body = "plant.vehicle.base"
    vary = {f"environment.wind.force_W.{axis}": even(-2.5, 2.5) for axis in "xyz"}
    vary |= {f"{body}.mass": even(0.58, 0.88), f"{body}.com.x": even(-0.01, 0.01), f"{body}.com.y": even(-0.01, 0.01)}
    vary |= {"plant.payload.mass": even(0.0, 0.1), "reference.base.radius": even(0.0, 0.5)}
    vary |= {f"plant.vehicle.links.{k}.joint.damping": even(0.0, 0.02) for k in (0, 1)}
    vary |= {f"reference.joints.{k}.amplitude": even(0.0, 0.3) for k in (0, 1)}
    vary |= {f"reference.joints.{k}.frequency_hz": even(0.2, 0.7) for k in (0, 1)}
    vary["delays.command"] = even(0.0, 0.01)
    swing = {"kind": "sine", "amplitude": 0.2, "frequency_hz": 0.5, "start": 1.0}
    table = {
        "schema": 1,
        "name": "circles_in_wind",
        "duration": 8.0,
        "rates": {"physics": 1000, "control": 200, "reference": 50},
        "plant": {"vehicle": "hummingbird_arm2_rotors", "gravity": 9.8},
        "model": {"vehicle": "hummingbird_arm2", "gravity": 9.81},
        "controller": {"preset": "paper_ct"},
        "reference": {
            "base": {"kind": "circle", "radius": 0.3, "frequency_hz": 0.08, "center": [0.0, 0.0, 1.0], "start": 1.0},
            "joints": [swing, {**swing, "phase": 1.5708}],
        },
        "environment": {"wind": {"mode": "force_wind", "force": [2.0, 0.0, 0.0], "air_velocity": [2.0, 0.0, 0.0]}},
    }
    late = skyarm.Delays(longest_command=Spread().delay)
    flight = dataclasses.replace(skyarm.scenario_from(table), delays=late, ground=False)
    reward = [
        learn.TipDistance(scale=0.3, weight=0.1),
        learn.TipNear(scale=0.03, weight=0.1),
        learn.ActionChange(weight=1.0),
        learn.Lost(weight=10.0),
    ]
    seen = [
        *(learn.PositionError(scale=0.3), learn.VelocityError(scale=0.5), "attitude", learn.BodyRate(scale=2.0)),
        *(learn.JointErrors(scale=0.2), learn.JointAngles(scale=0.3), learn.JointRates(scale=2.0)),
        *(learn.TipError(scale=0.1), "specific_force", "last_action"),
    ]
    return gymnasium.make_vec(
        "skyarm/Scenario-v0",
        num_envs=worlds,
        vectorization_mode="vector_entry_point",
        scenario=flight,
        actions=learn.References(position=REACH, angle=0.6),
        observation=seen,
        reward=reward,
        randomise=vary,
        autoreset_mode="SameStep",
        copy=False,
    )


def dense(key, inputs, outputs, gain):
    """A layer with orthogonal weights."""
    return jax.nn.initializers.orthogonal(gain)(key, (outputs, inputs), jnp.float32), jnp.zeros(outputs)


def net(layers, x):
    """Tanh between affine layers."""
    for weights, offsets in layers[:-1]:
        x = jnp.tanh(x @ weights.T + offsets)
    return x @ layers[-1][0].T + layers[-1][1]


def log_density(par, seen, sent):
    """Of the changes that were drawn."""
    z = (sent - net(par["actor"], seen)) / jnp.exp(par["spread"])
    return -0.5 * jnp.sum(z * z, -1) - jnp.sum(par["spread"])


@jax.jit
def act(par, key, seen):
    """Changes of the action, drawn."""
    middle = net(par["actor"], seen)
    return middle + jnp.exp(par["spread"]) * jax.random.normal(key, middle.shape)


def fly(envs, par, seen, drawn):
    """Hold changes for some periods; returns observations, mean rewards, and whether an episode was over in them."""
    change, total, over = PACE * np.clip(drawn, -1.0, 1.0), 0.0, False
    for _ in range(HELD):
        seen, reward, ended, truncated, info = envs.step(seen[:, -change.shape[1] :] + change)
        if truncated.any():  # what would have come after the time was over counts
            final = np.zeros(seen.shape, np.float32)
            for lane in np.flatnonzero(truncated):
                final[lane] = info["final_obs"][lane]
            reward = reward + HELD * GAMMA * np.where(truncated, np.asarray(value(par, jnp.asarray(final))), 0.0)
        total, over = total + np.where(over, 0.0, reward) / HELD, over | ended | truncated
    return seen, total, over


@jax.jit
def value(par, seen):
    """What is to come, discounted."""
    return net(par["critic"], seen)[..., 0]


def loss(par, batch):
    """Of PPO: clipped ratio and squared error of the value."""
    seen, sent, old, gain, wanted = batch
    ratio = jnp.exp(log_density(par, seen, sent) - old)
    gain = (gain - gain.mean()) / (gain.std() + 1e-8)
    policy = -jnp.minimum(ratio * gain, jnp.clip(ratio, 1.0 - CLIP, 1.0 + CLIP) * gain).mean()
    return policy + 0.5 * jnp.mean((value(par, seen) - wanted) ** 2)


@jax.jit
def update(par, adam, key, rate, seen, sent, rewards, over, last):
    """Advantages of a rollout (steps, worlds), then some epochs of gradient steps."""
    values = value(par, seen)

    def back(carry, step):
        gain, following = carry
        reward, ended, now = step
        gain = reward + GAMMA * following * (1.0 - ended) - now + GAMMA * LAMBDA * (1.0 - ended) * gain
        return (gain, now), gain

    start = (jnp.zeros_like(last), last)
    _, gains = jax.lax.scan(back, start, (rewards, over, values), reverse=True)
    old = log_density(par, seen, sent)
    flat = [x.reshape(-1, *x.shape[2:]) for x in (seen, sent, old, gains, gains + values)]

    def part(state, chosen):
        par, (mean, square, count) = state
        slope = jax.grad(loss)(par, [x[chosen] for x in flat])
        size = jnp.sqrt(sum(jnp.sum(g * g) for g in jax.tree.leaves(slope)))
        slope = jax.tree.map(lambda g: g * jnp.minimum(1.0, LARGEST / (size + 1e-8)), slope)
        count = count + 1.0
        mean = jax.tree.map(lambda m, g: 0.9 * m + 0.1 * g, mean, slope)
        square = jax.tree.map(lambda v, g: 0.999 * v + 0.001 * g * g, square, slope)
        bias = jnp.sqrt(1.0 - 0.999**count) / (1.0 - 0.9**count)
        par = jax.tree.map(lambda p, m, v: p - rate * bias * m / (jnp.sqrt(v) + 1e-8), par, mean, square)
        return (par, (mean, square, count)), None

    orders = [jax.random.permutation(each, len(flat[0])) for each in jax.random.split(key, EPOCHS)]
    chosen = jnp.stack(orders).reshape(EPOCHS * PARTS, -1)
    (par, adam), _ = jax.lax.scan(part, (par, adam), chosen)
    return par, adam


def train(seed, iterations=ITERATIONS, worlds=WORLDS):
    """Learn; returns environments, policy, and the curve: (steps, mean reward a step)."""
    envs = make_worlds(worlds)
    seen_size, size = envs.single_observation_space.shape[0], envs.single_action_space.shape[0]
    key, *keys = jax.random.split(jax.random.PRNGKey(seed), 7)
    par = {
        "actor": [dense(keys[0], seen_size, 64, 1.4), dense(keys[1], 64, 64, 1.4), dense(keys[2], 64, size, 0.01)],
        "critic": [dense(keys[3], seen_size, 64, 1.4), dense(keys[4], 64, 64, 1.4), dense(keys[5], 64, 1, 1.0)],
        "spread": jnp.full(size, -1.2),
    }
    zeros = jax.tree.map(jnp.zeros_like, par)
    adam = (zeros, zeros, 0.0)
    seen, _ = envs.reset(seed=seed * worlds)
    rest = np.zeros(envs.action_space.shape, np.float32)
    # worlds begin at different times, or all of a rollout would be of one part of the flight
    for part in range(min(16, worlds)):
        for _ in range(100):
            envs.step(rest)
        seen, _ = envs.reset(options={"reset_mask": np.arange(worlds) % 16 == part})
    curve, began = [], time.perf_counter()
    for iteration in range(iterations):
        rows = ([], [], [], [])
        for _ in range(STEPS):
            key, draw_key = jax.random.split(key)
            before = jnp.array(seen)
            drawn = np.asarray(act(par, draw_key, before))
            seen, reward, over = fly(envs, par, seen, drawn)
            for row, new in zip(rows, (before, drawn, reward, over), strict=True):
                row.append(np.asarray(new, np.float32))
        key, order = jax.random.split(key)
        rollout = [jnp.asarray(np.stack(row)) for row in rows]
        curve.append(((iteration + 1) * STEPS * HELD * worlds, float(np.mean(rows[2]))))
        rate = RATE * (1.0 - 0.95 * iteration / iterations)
        par, adam = update(par, adam, order, rate, *rollout, value(par, jnp.array(seen)))
        if iteration % 20 == 19:
            took = time.perf_counter() - began
            print(f"seed {seed}  steps {curve[-1][0]:>10}  reward {curve[-1][1]:.4f}  {took:.0f} s", flush=True)
    layers = [(np.asarray(w), np.asarray(b)) for w, b in par["actor"]]
    return envs, Stepwise(learn.network(layers), PACE), curve


def tip_errors(law, plants=200):
    """mm, mean over 10 to 20 s of the paper's Case 3 in wind: on the true plant, and on wrong ones, inf where lost."""
    flight = skyarm.load_scenario("case3_wind", duration=20.0)
    flight = dataclasses.replace(flight, controller=law, ground=False)
    log = skyarm.run(flight)
    between = (log.time >= 10.0) & (log.time < 20.0)
    own = 1e3 * np.linalg.norm(log.tip - log.tip_reference, axis=1)[between].mean()
    late = dataclasses.replace(flight, delays=skyarm.Delays(longest_command=Spread().delay))
    values = draw(late, Spread(), plants, seed=1)
    mean, last = "ee_error_mean_continuous", "ee_error_last_mean_continuous"
    found = Batch(late, tuple(values), metrics=(mean, last)).fly(values, seed=0)
    flown = found.completed & (found.metrics[last] <= LARGEST_ERROR)
    return own, 1e3 * np.where(flown, found.metrics[mean], np.inf)


def row(name, law):
    """A line of the table; a quantile is lost where more flights than it allows are."""
    own, wrong = tip_errors(law)
    flown = wrong[np.isfinite(wrong)]
    numbers = (own, flown.mean() if flown.size else np.inf, *np.percentile(wrong, [50, 95], method="nearest"))
    print("|", name, *(f"| {each:.2f}".replace("inf", "lost") for each in numbers), f"| {flown.size} |", flush=True)


def main():
    """Learn, fly, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--iterations", type=int, default=ITERATIONS)
    parser.add_argument("--worlds", type=int, default=WORLDS)
    parser.add_argument("--plot", type=Path, help="learn with five seeds and draw their curves")
    given = parser.parse_args()
    seeds = range(5) if given.plot else [given.seed] if given.iterations else []
    runs = [train(seed, given.iterations, given.worlds) for seed in seeds]
    print(
        "\n| flown | nominal plant, mm | perturbed: mean, mm | median, mm | 95 %, mm | completed, of 200 |\n|-|-|-|-|-|-|"
    )
    row("the paper's law", skyarm.load_scenario("case3_wind").controller)
    row("the paper's law and an integral of the tip error, 0.5 1/s", with_integral(skyarm.load_scenario("case3_wind")))
    for seed, (envs, policy, _) in zip(seeds, runs, strict=True):
        row(f"policy, seed {seed}", learn.as_law(policy, envs, name="learned"))
    row("`centroidal_tip`", skyarm.load_scenario("case3_wind", controller="centroidal_tip").controller)
    if given.plot:
        plot(given.plot, [curve for _, _, curve in runs])


def plot(path, curves):
    """Curves of the seeds, and their mean."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.0, 3.2), layout="constrained")
    for curve in curves:
        axes.plot(*np.array(curve).T / [[1e6], [1.0]], color="0.7", linewidth=1.0)
    axes.plot(*np.mean(curves, axis=0).T / [[1e6], [1.0]], linewidth=2.0)
    axes.set(xlabel="steps, million", ylabel="mean reward of a step")
    figure.savefig(path)


if __name__ == "__main__":
    main()
