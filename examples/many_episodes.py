"""Shipped environments, and episodes side by side: seeds, resets, a lane by hand."""

import dataclasses

import gymnasium
import numpy as np

import skyarm
import skyarm.envs  # registers the names

# What there is: rate and length of an episode, its actions, and what is drawn for each.
for name in gymnasium.registry:
    if not name.startswith("skyarm/") or name == "skyarm/Scenario-v0":
        continue
    env = gymnasium.make(name).unwrapped
    env.reset(seed=0)
    flown, actions = env.scenario, env.lanes.task.actions
    length = f"{flown.rates.control} Hz, {flown.duration:g} s"
    print(f"{name}: {flown.title}, {length}, {type(actions).__name__}")
    print(f"    drawn: {', '.join(env.lanes.numbers())}")

# Eight lanes. Lane k of reset(seed=s) flies what a single environment flies after
# reset(seed=s + k); a list seeds each.
# "SameStep": the step that ends an episode begins the next, and its last values are in
# infos["final_obs"] and infos["final_info"]. With "NextStep", the default, the next
# step does so and ignores its action.
# copy=False: all steps return one buffer (num_envs, numbers), column by column, which
# each step overwrites; torch.from_dlpack(envs.observations) reads it without a copy.
envs = gymnasium.make_vec(
    "skyarm/HoldTipInWind-v0",
    num_envs=8,
    vectorization_mode="vector_entry_point",
    autoreset_mode="SameStep",
    copy=False,
    precision="double",  # "single" unless stated; "bit_exact": the bits of a flight
)
observations, _ = envs.reset(seed=100)
actions = np.zeros(envs.action_space.shape)
for _ in range(200):
    observations, rewards, terminated, truncated, infos = envs.step(actions)
winds = envs.lanes.numbers()["environment.wind.force_W.x"]  # N, one for each lane
print(f"wind of lane 3: {winds[3]:.3f} N, reward {rewards[3]:.3f}")

# The flight of lane 3 by hand: its scenario with drawn numbers, its seed, episode 0.
# Actions of zero correct nothing.
by_hand = skyarm.Session(dataclasses.replace(envs.lanes.lane_scenario(3), seed=103))
while by_hand.time < 200 * 0.005 - 1e-9:
    by_hand.step()
error = np.array(by_hand.reference.position) - np.array(by_hand.measurement.position)
print(f"parted by {abs(error - observations[3, :3]).max():.0e} m after 200 steps")

# Some lanes begin anew, each with the next episode of its seed.
envs.reset(options={"reset_mask": np.arange(8) < 2})

# A picture of a single environment; `fine` draws shadows and takes four times as long.
looks = {"width": 240, "height": 240, "camera": "tip", "ghost": True, "fine": False}
env = gymnasium.make(
    "skyarm/TrackTip-v0", render_mode="rgb_array", render_options=looks
)
env.reset(seed=1)
print("picture", env.render().shape)
