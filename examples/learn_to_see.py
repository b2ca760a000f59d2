"""A policy that sees, in NumPy: a teacher who is told the place learns by evolution, a student imitates it from depth."""

import sys

import gymnasium
import numpy as np

import skyarm
import skyarm.envs as learn

TASK = sys.argv[1] if len(sys.argv) > 1 else "ReachWhatTheWristSees"  # or FlyThroughWindow
GENERATIONS, ROUNDS, LANES = map(int, sys.argv[2:5]) if len(sys.argv) > 4 else (240, 12, 256)
REACHES = TASK == "ReachWhatTheWristSees"
STATE = ["position_error", "velocity_error", "attitude", "joint_errors"]
SEEN = [*STATE, learn.Depth(sensor="wrist", scale=1.0) if REACHES else learn.Depth(sensor="front", scale=4.0)]
SIGMA, RATE = 0.05, 0.1 if REACHES else 0.03
draw = np.random.default_rng(0).standard_normal


def make(lanes, observation):
    name = f"skyarm/{TASK}-v0"
    return gymnasium.make_vec(name, num_envs=lanes, vectorization_mode="vector_entry_point", observation=observation)


def told(envs, state):
    """What the teacher is told: the state, the numbers that were drawn for the episode, and 1."""
    drawn = np.array([*envs.unwrapped.lanes.numbers().values()], np.float32).T
    return np.hstack([state, drawn - NOMINAL, np.ones((len(drawn), 1), np.float32)])


def fly(envs, seed, act):
    """One episode in each lane: the sum of its rewards, and whether it succeeds."""
    seen, _ = envs.reset(seed=seed)
    going, total, best = np.ones(envs.num_envs, bool), np.zeros(envs.num_envs), np.zeros(envs.num_envs)
    for tick in range(envs.unwrapped.scenario.steps):
        seen, rewards, ended, _, _ = envs.step(act(seen, tick))
        total += rewards * going
        best = np.maximum(best, rewards * going)
        going &= ~ended
    # the tip has been within 2 cm of the ball; the vehicle has come through
    return total, best > np.exp(-0.1) if REACHES else going


class Adam:
    """Descent of Kingma and Ba 2015, in place."""

    def __init__(self, values):
        self.values, self.steps = values, 0
        self.means, self.squares = [np.zeros_like(v) for v in values], [np.zeros_like(v) for v in values]

    def step(self, slopes, rate):
        self.steps += 1
        for value, mean, square, slope in zip(self.values, self.means, self.squares, slopes, strict=True):
            mean += 0.1 * (slope - mean)
            square += 0.01 * (slope**2 - square)
            value -= rate * mean / (1.0 - 0.9**self.steps) / (np.sqrt(square / (1.0 - 0.99**self.steps)) + 1e-8)


# 1. the teacher, one matrix, from states
envs = make(2 * LANES, STATE)
NOMINAL = np.array(envs.unwrapped.lanes.program.base, np.float32)
teacher = np.zeros((envs.single_action_space.shape[0], 18 + len(NOMINAL)), np.float32)
climb = Adam([teacher])
for generation in range(GENERATIONS):
    noise = draw((LANES, *teacher.shape), dtype=np.float32)
    flown = teacher + SIGMA * np.concatenate([noise, -noise])
    total, _ = fly(envs, 2 * LANES * generation, lambda seen, _: np.einsum("nij,nj->ni", flown, told(envs, seen)))
    rank = total.argsort().argsort() / (2.0 * LANES - 1.0)
    climb.step([-np.tensordot(rank[:LANES] - rank[LANES:], noise, 1) / LANES], RATE * (1.0 - generation / GENERATIONS))
_, good = fly(envs, 10**6, lambda seen, _: told(envs, seen) @ teacher.T)
print(f"teacher, from states: {good.mean():.0%} of {len(good)} held-out worlds", flush=True)

# 2. the student, a network with two hidden layers, from states and depth (Ross, Gordon, Bagnell 2011: DAgger)
envs = make(LANES, SEEN)
sizes = [sum(np.prod(space.shape) for space in envs.single_observation_space.values()), 64, 64, len(teacher)]
layers = [value for a, b in zip(sizes, sizes[1:]) for value in (draw((b, a), dtype=np.float32) / a**0.5, np.zeros(b, np.float32))]
descent, inputs, answers = Adam(layers), [], []


def whole(seen):
    return np.hstack([each.reshape(len(each), -1) for each in (seen["state"], seen[SEEN[-1].sensor])])


def student(x):
    values = [x]
    for weights, offsets in zip(layers[::2], layers[1::2]):
        x = x @ weights.T + offsets
        values.append(x := x if weights is layers[4] else np.tanh(x))
    return values


def learning(by_teacher):
    def act(seen, tick):
        x, answer = whole(seen), np.clip(told(envs, seen["state"]) @ teacher.T, -1.0, 1.0)
        if tick % 5 == 0:
            inputs.append(x)
            answers.append(answer)
        return answer if by_teacher else student(x)[-1]

    return act


for k in range(ROUNDS):
    fly(envs, 10**7 + LANES * k, learning(k == 0))
    x, y = np.concatenate(inputs), np.concatenate(answers)
    chosen = np.random.default_rng(k).permutation(len(x))[:200_000]
    for batch in np.array_split(chosen, -(-len(chosen) // 256)):
        values = student(x[batch])
        error, slopes = 2.0 * (values[-1] - y[batch]) / len(batch), []
        for n in (2, 1, 0):
            slopes = [error.T @ values[n], error.sum(axis=0), *slopes]
            error = (error @ layers[2 * n]) * (1.0 - values[n] ** 2)
        descent.step(slopes, 1e-3)
    _, good = fly(envs, 10**6, lambda seen, _: student(whole(seen))[-1])
    print(f"student, from depth, round {k}: {good.mean():.0%} of {len(good)} held-out worlds", flush=True)

# 3. the student is a law, which sees in any flight
law = learn.as_law([*zip(layers[::2], layers[1::2])], envs, name="student")
log = skyarm.run(envs.unwrapped.lanes.lane_scenario(0).with_controller(law))
print(law.name, "sees", *law.sees, log.status)
