"""Types of the compiled part. What each call does stands in its docstring: ``help(wheeleg)``."""

from collections.abc import Mapping, Sequence
from typing import Any, TypedDict, final, type_check_only

import numpy as np
from numpy.typing import ArrayLike, NDArray

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

__version__: str
LAWS: list[str]

_Floats = NDArray[np.float64]

class ConfigError(ValueError): ...
class SimulationError(RuntimeError): ...

@type_check_only
class Parameter(TypedDict):
    """A parameter of an axis file."""

    value: float | list[float]
    unit: str
    min: float
    max: float
    source: str
    doc: str

@type_check_only
class Snapshot(TypedDict):
    """What a board says after a tick."""

    measured_m: float
    velocity_m_s: float
    reference_m: float
    duty: float
    settled: bool
    driving: bool
    faults: list[str]

@type_check_only
class Event(TypedDict):
    """Something that happened to a robot."""

    t_s: float
    kind: str
    code: str
    text: str

@final
class Axis:
    def __new__(cls, name_or_path: str) -> Axis: ...
    @staticmethod
    def parse(text: str, file: str = "axis.toml") -> Axis: ...
    @staticmethod
    def built_in() -> list[str]: ...
    def with_values(
        self, values: Mapping[str, bool | float | str | tuple[Sequence[float], str]]
    ) -> Axis: ...
    @property
    def name(self) -> str: ...
    @property
    def description(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def stroke_m(self) -> float: ...
    def parameters(self) -> dict[str, Parameter]: ...

@final
class Cylinder:
    load_n: float
    mass_kg: float
    def __new__(cls, axis: Axis | str, *, seed: int) -> Cylinder: ...
    def tick(self, on_us: Sequence[float] | NDArray[Any]) -> None: ...
    def run(self, on_us: ArrayLike, load_n: ArrayLike | None = None) -> dict[str, _Floats]: ...
    def outputs(self) -> dict[str, float]: ...
    def state(self) -> bytes: ...
    def restore(self, state: bytes) -> None: ...
    def state_hash(self) -> str: ...

@final
class BoardState: ...

@final
class Board:
    def __new__(
        cls,
        axis: Axis | str,
        *,
        law: str = "predictive",
        parameters: Mapping[str, float] | None = None,
    ) -> Board: ...
    def tick(
        self, code: float, reference_m: float, velocity_m_s: float = 0.0
    ) -> NDArray[np.uint16]: ...
    def run(
        self, code: ArrayLike, reference_m: ArrayLike, velocity_m_s: ArrayLike | None = None
    ) -> NDArray[np.uint16]: ...
    def snapshot(self) -> Snapshot: ...
    def parameters(self) -> dict[str, float]: ...
    def state(self) -> BoardState: ...
    def restore(self, state: BoardState) -> None: ...

@final
class AxisSimState: ...

@final
class AxisSim:
    load_n: float
    mass_kg: float
    def __new__(
        cls,
        axis: Axis | str,
        *,
        seed: int,
        law: str = "predictive",
        parameters: Mapping[str, float] | None = None,
        sheet: Axis | str | None = None,
    ) -> AxisSim: ...
    def tick(self, reference_m: float, velocity_m_s: float = 0.0) -> dict[str, float]: ...
    def run(
        self,
        reference_m: ArrayLike,
        velocity_m_s: ArrayLike | None = None,
        load_n: ArrayLike | None = None,
    ) -> dict[str, _Floats]: ...
    def snapshot(self) -> Snapshot: ...
    def parameters(self) -> dict[str, float]: ...
    def state(self) -> AxisSimState: ...
    def restore(self, state: AxisSimState) -> None: ...
    def state_hash(self) -> str: ...

@final
class Robot:
    def __new__(cls, scenario: str = "stand", *, seed: int, robot: str | None = None) -> Robot: ...
    @staticmethod
    def of_case(plan: str, index: int) -> Robot: ...
    @staticmethod
    def cases_of(plan: str) -> int: ...
    def run(self, seconds: float | None = None, *, every_s: float = 0.01) -> dict[str, _Floats]: ...
    def tick(self) -> None: ...
    def observe(self) -> dict[str, Any]: ...
    def command(self, name: str, **arguments: str | float | bool) -> None: ...
    def take_events(self) -> list[Event]: ...
    @property
    def time_s(self) -> float: ...
    @property
    def is_over(self) -> bool: ...
    @property
    def seed(self) -> int: ...
    def log_hash(self) -> str: ...
    def state(self) -> bytes: ...
    def restore(self, state: bytes) -> None: ...
