"""A thousand vehicles under random rotor speeds: how long until each is lost."""

import numpy as np

import skyarm

LANES = 1000
scenario = skyarm.load_scenario("case3", controller="paper_ct", duration=5.0)
batch = skyarm.BatchSession(scenario, LANES, ["plant.payload.mass"], single=True, autoreset=False)
batch.set({"plant.payload.mass": np.random.default_rng(0).uniform(0.0, 0.1, LANES)})
batch.reset()

generator, alive = np.random.default_rng(1), np.zeros(LANES)
actions = np.zeros((6, LANES))  # four rotor speeds, two joint torques
for _ in range(scenario.steps):
    actions[:4] = generator.normal(490.0, 25.0, (4, LANES))
    state = batch.step(actions)
    alive += ~batch.ended
print(f"lost after {np.median(alive) / 200:.2f} s (median); {batch.ended.mean():.0%} within {scenario.duration:g} s")
