"""A residual on the paper's law, learned in wind by an evolution strategy in NumPy; a thousand policies fly at once."""

import dataclasses
import sys

import gymnasium
import numpy as np

import skyarm
import skyarm.envs as learn

GENERATIONS, PAIRS, SIGMA, RATE = int(sys.argv[1]) if len(sys.argv) > 1 else 120, 512, 0.02, 0.02
reward = [learn.TipDistance(), learn.TipNear(weight=0.5), learn.ActionChange(weight=0.5), learn.Lost(weight=300.0)]
task = {"actions": learn.Residual(span=0.2), "reward": reward}
envs = gymnasium.make_vec("skyarm/HoldTipInWind-v0", num_envs=2 * PAIRS, autoreset_mode="SameStep", copy=False, **task)
shape = envs.single_action_space.shape + envs.single_observation_space.shape
policy, mean, square = np.zeros((3, *shape), np.float32)
draw = np.random.default_rng(0).standard_normal

for generation in range(GENERATIONS):
    noise = draw((PAIRS, *shape), dtype=np.float32)
    flown = policy + SIGMA * np.concatenate([noise, -noise])
    observations, _ = envs.reset(seed=generation * 2 * PAIRS)
    total = np.zeros(2 * PAIRS)
    for _ in range(1000):
        observations, rewards, *_ = envs.step(np.matmul(flown, observations[:, :, None])[:, :, 0])
        total += rewards
    rank = total.argsort().argsort() / (2 * PAIRS - 1.0)
    slope = np.tensordot(rank[:PAIRS] - rank[PAIRS:], noise, 1) / (2 * PAIRS * SIGMA)
    mean, square = 0.9 * mean + 0.1 * slope, 0.99 * square + 0.01 * slope**2  # Adam
    scale = np.sqrt(square / (1.0 - 0.99 ** (generation + 1))) + 1e-8
    policy += RATE * mean / (1.0 - 0.9 ** (generation + 1)) / scale

flight = skyarm.load_scenario("case3_wind")  # another motion; its wind is at the edge of those that were learned in
learned = learn.as_law([(policy, np.zeros(shape[0]))], envs, name="learned")
for law in (flight.controller, learned):
    log = skyarm.run(dataclasses.replace(flight, controller=law))
    print(law.name, log.status, f"{1e3 * np.linalg.norm(log.tip - log.tip_reference, axis=1).mean():.0f} mm")
