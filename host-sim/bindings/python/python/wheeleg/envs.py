"""Gymnasium environments. Importing this registers them:

- ``Wheeleg/CylinderPosition-v0``: one cylinder, moved to a target by its valves.
- ``Wheeleg/Robot-v0``: the robot with its firmware, moved by references of its joints and wheels.

All randomness comes from the seed of ``reset``. What is observed is what a board senses; the
truth is in ``info``.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ._wheeleg import Axis, ConfigError, Cylinder, Robot, SimulationError

__all__ = ["CylinderPosition", "WheelegRobot"]

_Floats = NDArray[np.float32]

# Codes of the position converter are 16 bits, left-aligned.
_CODES = 65536.0


class CylinderPosition(gymnasium.Env[_Floats, _Floats]):
    """Move a piston to a target by its four on/off valves, one action every ``step_ms``.

    Action: with ``action="duty"`` one number from -1 (vent A, fill B) to 1 (fill A, vent B), the
    share of the step in which the two valves are driven; with ``"on_times"`` four numbers from 0
    to 1, the shares of fill A, vent A, fill B, vent B.

    Observation: position as the converter reads it, target, both as shares of the stroke; speed,
    strokes per second, from the last two readings; the last action.

    Reward: minus the distance to the target, as a share of the stroke.

    ``randomise`` draws parameters of the axis file anew at each reset, uniform in their
    logarithm: ``{"moving.mass": (0.5, 2.0)}`` is half to twice the file's value.
    """

    metadata = {"render_modes": []}

    def __init__(
        self,
        axis: Axis | str = "bench-vq110u",
        action: str = "duty",
        step_ms: int = 10,
        randomise: dict[str, tuple[float, float]] | None = None,
    ) -> None:
        if action not in ("duty", "on_times"):
            raise ConfigError(f'action = "{action}"; allowed: "duty", "on_times"')
        if not 1 <= step_ms <= 1000:
            raise ConfigError(f"step_ms = {step_ms} is outside 1 to 1000")
        self._axis = Axis(axis) if isinstance(axis, str) else axis
        self._step_ms = int(step_ms)
        self._randomise = dict(randomise or {})
        parameters = self._axis.parameters()
        for path, (low, high) in self._randomise.items():
            if path not in parameters:
                raise ConfigError(f"randomise: there is no parameter `{path}`")
            if not 0.0 < low <= high:
                raise ConfigError(f"randomise: {path} = ({low}, {high}): needs 0 < low <= high")
        self._parameters = parameters
        width = 1 if action == "duty" else 4
        low = -1.0 if action == "duty" else 0.0
        self.action_space = spaces.Box(low, 1.0, (width,), np.float32)
        bounds = np.array([2.0, 2.0, 100.0] + [1.0] * width, np.float32)
        self.observation_space = spaces.Box(-bounds, bounds, dtype=np.float32)
        self._electrical_m = self._si("sensor.potentiometer.electrical_stroke")
        self._offset_m = self._si("sensor.potentiometer.offset")
        #: The axis of this episode, with what ``randomise`` has drawn.
        self.axis_in_use = self._axis
        self._cylinder: Cylinder | None = None
        self._target = 0.0
        self._position = 0.0
        self._last = np.zeros(width, np.float32)

    def _si(self, path: str) -> float:
        """A length of the axis file, m."""
        parameter = self._parameters[path]
        value = parameter["value"]
        if isinstance(value, list):
            raise ConfigError(f"`{path}` is a list")
        return value * {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}[parameter["unit"]]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[_Floats, dict[str, Any]]:
        """``options`` may name a ``target``, 0 to 1 of the stroke."""
        super().reset(seed=seed)
        values = {}
        for path, (low, high) in self._randomise.items():
            factor = float(np.exp(self.np_random.uniform(np.log(low), np.log(high))))
            parameter = self._parameters[path]
            value, unit = parameter["value"], parameter["unit"]
            listed = value if isinstance(value, list) else [value]
            values[path] = ([factor * v for v in listed], unit)
        self.axis_in_use = self._axis.with_values(values) if values else self._axis
        noise = int(self.np_random.integers(2**63))
        self._target = float(self.np_random.uniform(0.1, 0.9))
        if options and "target" in options:
            self._target = float(options["target"])
            if not 0.0 <= self._target <= 1.0:
                raise ConfigError(f"target = {self._target} is outside 0 to 1")
        self._cylinder = Cylinder(self.axis_in_use, seed=noise)
        self._last = np.zeros_like(self._last)
        outputs = self._cylinder.outputs()
        self._position = self._read(outputs["code"])
        return self._observation(0.0), self._info(outputs)

    def step(self, action: _Floats) -> tuple[_Floats, float, bool, bool, dict[str, Any]]:
        if self._cylinder is None:
            raise gymnasium.error.ResetNeeded("call reset first")
        given = np.clip(np.asarray(action, np.float64).reshape(-1), -1.0, 1.0)
        if given.shape != self._last.shape:
            raise ConfigError(f"the action has {given.size} numbers, not {self._last.size}")
        if not np.isfinite(given).all():
            raise ConfigError(f"the action {given} is not finite")
        self._last = given.astype(np.float32)
        if given.size == 1:
            out, back = max(given[0], 0.0), max(-given[0], 0.0)
            shares = np.array([out, back, back, out])
        else:
            shares = np.maximum(given, 0.0)
        # One pulse from the begin of the step.
        total_us = np.rint(shares * 1000.0 * self._step_ms)
        begin_us = 1000.0 * np.arange(self._step_ms)[:, None]
        on_us = np.clip(total_us - begin_us, 0.0, 1000.0)
        rows = self._cylinder.run(on_us)
        before = self._position
        outputs = {name: float(column[-1]) for name, column in rows.items()}
        self._position = self._read(outputs["code"])
        speed = (self._position - before) / (1e-3 * self._step_ms)
        error = outputs["stroke_m"] / self._axis.stroke_m - self._target
        return self._observation(speed), -abs(error), False, False, self._info(outputs)

    def _read(self, code: float) -> float:
        """The position that a code stands for, as a share of the stroke."""
        return (code / _CODES * self._electrical_m - self._offset_m) / self._axis.stroke_m

    def _observation(self, speed: float) -> _Floats:
        seen = np.array([self._position, self._target, speed], np.float32)
        space = self.observation_space
        assert isinstance(space, spaces.Box)
        return np.clip(np.concatenate([seen, self._last]), space.low, space.high)

    def _info(self, outputs: dict[str, float]) -> dict[str, Any]:
        return {"target_m": self._target * self._axis.stroke_m, **outputs}


class WheelegRobot(gymnasium.Env[_Floats, _Floats]):
    """Move the robot forward, one action every 0.1 s; the boards' firmware follows.

    Action: seven numbers from -1 to 1: the strokes of joints 1 to 6 about the start pose, times
    ``reach_m`` and within the stroke, and the travel of the wheels in this step, times ``travel_m``.

    Observation, as the boards sense: strokes about the start pose over ``reach_m`` (6), speeds of
    the joints, m/s (6), travel of the wheels in the last step over ``travel_m`` (2), foot switches
    (8), the last action (7).

    Reward: way forward in the step over ``travel_m``, less a tenth of the mean square of the
    action. The episode terminates when the robot lies on its side or its plant leaves its range,
    and is truncated at the end of the scenario.

    With ``plan``, each reset takes a case of that campaign's plan at random, with its factors:
    domain randomisation. Without, it is the robot of the scenario with other noise.
    """

    metadata = {"render_modes": []}
    step_s = 0.1
    tilt_rad = 0.8

    def __init__(
        self,
        scenario: str = "stand",
        robot: str | None = None,
        plan: str | None = None,
        reach_m: float = 0.02,
        travel_m: float = 0.02,
    ) -> None:
        for name, value, most in (("reach_m", reach_m, 0.09), ("travel_m", travel_m, 0.1)):
            if not 0.0 < value <= most:
                raise ConfigError(f"{name} = {value}; allowed: above 0, at most {most}")
        self._scenario, self._robot_name, self._plan = scenario, robot, plan
        self._cases = Robot.cases_of(plan) if plan else 0
        self._reach_m, self._travel_m = reach_m, travel_m
        self.action_space = spaces.Box(-1.0, 1.0, (7,), np.float32)
        bounds = np.array([20.0] * 6 + [10.0] * 6 + [20.0] * 2 + [1.0] * 15, np.float32)
        self.observation_space = spaces.Box(-bounds, bounds, dtype=np.float32)
        self._robot: Robot | None = None
        self._home_m = np.zeros(6)
        self._seen: dict[str, Any] = {}
        self._travel = np.zeros(2)
        self._last = np.zeros(7, np.float32)
        self._refused = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[_Floats, dict[str, Any]]:
        super().reset(seed=seed)
        if self._plan:
            case = int(self.np_random.integers(self._cases))
            self._robot = Robot.of_case(self._plan, case)
        else:
            noise = int(self.np_random.integers(2**63))
            self._robot = Robot(self._scenario, seed=noise, robot=self._robot_name)
        self._seen = self._robot.observe()
        self._home_m = self._seen["sensed_stroke_m"].copy()
        self._travel = np.zeros(2)
        self._last = np.zeros(7, np.float32)
        self._refused = 0
        return self._observation(), self._info()

    def step(self, action: _Floats) -> tuple[_Floats, float, bool, bool, dict[str, Any]]:
        if self._robot is None:
            raise gymnasium.error.ResetNeeded("call reset first")
        given = np.asarray(action, np.float64).reshape(-1)
        if given.shape != (7,) or not np.isfinite(given).all():
            raise ConfigError(f"the action {given} is not seven finite numbers")
        given = np.clip(given, -1.0, 1.0)
        self._last = given.astype(np.float32)
        strokes_mm = np.clip(1e3 * (self._home_m + self._reach_m * given[:6]), 0.0, 180.0)
        for joint, stroke_mm in enumerate(strokes_mm, start=1):
            self._command("JointReference", joint=joint, stroke=f"{stroke_mm:.3f} mm")
        travel_mm = 1e3 * self._travel_m * given[6]
        self._command("WheelReference", travel=f"{travel_mm:.3f} mm")
        before = self._seen
        terminated = False
        try:
            self._robot.run(self.step_s, every_s=self.step_s)
        except SimulationError:
            terminated = True
        self._seen = self._robot.observe()
        self._travel = self._seen["sensed_travel_m"] - before["sensed_travel_m"]
        way_m = float(self._seen["position_m"][0] - before["position_m"][0])
        roll, pitch = (float(angle) for angle in self._seen["attitude_rad"][:2])
        terminated |= max(abs(roll), abs(pitch)) > self.tilt_rad
        reward = way_m / self._travel_m - 0.1 * float(np.mean(given**2))
        return self._observation(), reward, terminated, self._robot.is_over, self._info()

    def _command(self, name: str, **arguments: str | float) -> None:
        """A command that the master refuses, as one in a safe state does, changes nothing."""
        assert self._robot is not None
        try:
            self._robot.command(name, **arguments)
        except ConfigError:
            self._refused += 1

    def _observation(self) -> _Floats:
        seen = self._seen
        switches = seen["foot_switches"].astype(np.uint8)[:, None] >> np.arange(4) & 1
        parts = [
            (seen["sensed_stroke_m"] - self._home_m) / self._reach_m,
            seen["sensed_velocity_m_s"],
            self._travel / self._travel_m,
            switches.reshape(-1),
            self._last,
        ]
        space = self.observation_space
        assert isinstance(space, spaces.Box)
        return np.clip(np.concatenate(parts).astype(np.float32), space.low, space.high)

    def _info(self) -> dict[str, Any]:
        return {**self._seen, "refused": self._refused}


gymnasium.register(
    "Wheeleg/CylinderPosition-v0", "wheeleg.envs:CylinderPosition", max_episode_steps=200
)
gymnasium.register("Wheeleg/Robot-v0", "wheeleg.envs:WheelegRobot", max_episode_steps=90)
