"""The Gymnasium environments."""

import gymnasium
import numpy as np
import pytest
import wheeleg.envs
from gymnasium.utils.env_checker import check_env

MADE = [
    ("Wheeleg/CylinderPosition-v0", {}),
    ("Wheeleg/CylinderPosition-v0", {"action": "on_times", "randomise": {"moving.mass": (0.5, 2.0)}}),
    ("Wheeleg/Robot-v0", {}),
    ("Wheeleg/Robot-v0", {"plan": "three-step-spread"}),
]


@pytest.mark.parametrize(("name", "arguments"), MADE)
@pytest.mark.filterwarnings("error")
def test_gymnasium_accepts_it(name, arguments):
    check_env(gymnasium.make(name, **arguments).unwrapped, skip_render_check=True)


def played(env: gymnasium.Env, seed: int, steps: int) -> np.ndarray:
    seen, _ = env.reset(seed=seed)
    env.action_space.seed(seed)
    rows = [np.append(seen, 0.0)]
    for _ in range(steps):
        seen, reward, *_ = env.step(env.action_space.sample())
        rows.append(np.append(seen, reward))
    return np.array(rows)


@pytest.mark.parametrize(("name", "arguments"), MADE[:3])
def test_one_seed_gives_equal_bits_and_another_does_not(name, arguments):
    first, second = gymnasium.make(name, **arguments), gymnasium.make(name, **arguments)
    once = played(first, 3, 12)
    np.testing.assert_array_equal(once, played(second, 3, 12))
    np.testing.assert_array_equal(once, played(first, 3, 12))
    assert np.any(once != played(first, 4, 12))


def test_what_is_observed_is_sensed_and_the_truth_is_beside_it():
    env = gymnasium.make("Wheeleg/CylinderPosition-v0")
    seen, info = env.reset(seed=1)
    for _ in range(40):
        seen, reward, _, _, info = env.step(np.array([1.0], np.float32))
    stroke_m = wheeleg.Axis("bench-vq110u").stroke_m
    assert abs(seen[0] * stroke_m - info["stroke_m"]) < 0.2e-3
    assert seen[0] * stroke_m != info["stroke_m"]
    assert reward == pytest.approx(-abs(info["stroke_m"] - info["target_m"]) / stroke_m)
    assert info["stroke_m"] > 0.1
    near, _ = env.reset(seed=1, options={"target": 0.25})
    assert near[1] == 0.25


def test_the_robot_goes_where_its_wheels_take_it():
    env = gymnasium.make("Wheeleg/Robot-v0")
    for way in (1.0, -1.0):
        env.reset(seed=1)
        action = np.array([0, 0, 0, 0, 0, 0, way], np.float32)
        steps = [env.step(action) for _ in range(20)]
        _, _, terminated, truncated, info = steps[-1]
        assert way * info["position_m"][0] > 0.03, info["position_m"]
        assert not terminated and not truncated and info["refused"] == 0
        # The reward is the way forward less the cost of the action.
        rewarded = sum(reward for _, reward, *_ in steps) + 20 * 0.1 / 7
        assert abs(rewarded - info["position_m"][0] / 0.02) < 0.3


def test_many_at_once():
    envs = gymnasium.make_vec("Wheeleg/CylinderPosition-v0", num_envs=3)
    seen, _ = envs.reset(seed=1)
    assert seen.shape == (3, 4)
    seen, *_ = envs.step(envs.action_space.sample())
    assert seen.shape == (3, 4)


@pytest.mark.parametrize(
    ("name", "arguments", "told"),
    [
        ("CylinderPosition", {"action": "volts"}, "on_times"),
        ("CylinderPosition", {"step_ms": 0}, "step_ms"),
        ("CylinderPosition", {"randomise": {"moving.mas": (1, 2)}}, "moving.mas"),
        ("CylinderPosition", {"randomise": {"moving.mass": (2, 1)}}, "moving.mass"),
        ("WheelegRobot", {"reach_m": 0.5}, "reach_m"),
    ],
)
def test_wrong_arguments_are_refused(name, arguments, told):
    with pytest.raises(wheeleg.ConfigError, match=told):
        getattr(wheeleg.envs, name)(**arguments)
