"""Stable-Baselines3 trains a policy on the cylinder: targets that it has not seen are missed by less.

usage: check_training.py [STEPS]
"""

import sys
import time

import gymnasium
import numpy as np
import stable_baselines3
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

import wheeleg.envs

EPISODE = 120
HELD_OUT = range(10_000, 10_020)
NAME = "Wheeleg/CylinderPosition-v0"


def score(model):
    """Mean distance to the targets in the second half of each episode, shares of the stroke."""
    env = gymnasium.make(NAME)
    distances = []
    for seed in HELD_OUT:
        seen, _ = env.reset(seed=seed)
        for step in range(EPISODE):
            action, _ = model.predict(seen, deterministic=True)
            seen, reward, *_ = env.step(action)
            if step >= EPISODE // 2:
                distances.append(-reward)
    return float(np.mean(distances))


def main():
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    torch.set_num_threads(1)
    def make():
        env = gymnasium.make(NAME, max_episode_steps=EPISODE, randomise={"moving.mass": (0.7, 1.5)})
        return Monitor(env)

    envs = DummyVecEnv([make] * 8)
    envs.seed(1)
    model = PPO("MlpPolicy", envs, n_steps=256, batch_size=256, gamma=0.97, seed=1, device="cpu")
    before = score(model)
    begun = time.monotonic()
    model.learn(steps)
    took_s = time.monotonic() - begun
    after = score(model)
    print(
        f"training: Stable-Baselines3 {stable_baselines3.__version__}, {model.num_timesteps} steps of PPO in {took_s:.0f} s; "
        f"mean distance to {len(HELD_OUT)} targets not seen before {1e3 * before:.1f}, after {1e3 * after:.1f} thousandths of "
        "the stroke (bar: half)"
    )
    assert after < 0.5 * before, (before, after)


main()
