"""Wheeleg's pneumatic plant and the firmware of its boards.

- ``Axis``: the file of one cylinder with its valves, mass and sensor.
- ``Cylinder``: its plant. You give the valves' on-times.
- ``Board``: the firmware of a joint board. You give readings and references.
- ``AxisSim``: both in closed loop. You give references.
- ``Robot``: the whole robot in a scenario. You give commands of the master.

Numbers are SI, with the unit in the name (``stroke_m``, ``pressure_a_pa``); on-times are whole
microseconds. A tick is 1 ms. Every source of randomness has an explicit seed: equal seeds and
inputs give equal bits. What is simulated runs without the interpreter lock.

``import wheeleg.envs`` registers the Gymnasium environments.
"""

from ._wheeleg import (
    LAWS,
    Axis,
    AxisSim,
    AxisSimState,
    Board,
    BoardState,
    ConfigError,
    Cylinder,
    Robot,
    SimulationError,
    __version__,
)

__all__ = [
    "LAWS",
    "Axis",
    "AxisSim",
    "AxisSimState",
    "Board",
    "BoardState",
    "ConfigError",
    "Cylinder",
    "Robot",
    "SimulationError",
    "__version__",
]
