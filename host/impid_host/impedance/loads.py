"""The load models, one table row per parameter: -F_ext = sum of parameter * (signal through its entries)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.signals.arrays import Floats

Signal = Literal["a", "v", "x", "1"]
LoadKind = Literal["mass-spring", "arm"]


@dataclass(frozen=True, slots=True)
class Column:
    """One parameter: `entries` are (axis of the force, axis of the signal)."""

    name: str
    unit: str
    signal: Signal
    entries: tuple[tuple[int, int], ...]
    sign: float = 1.0


@dataclass(frozen=True, slots=True)
class LoadModel:
    """A load on the end-effector that is linear in its parameters; the last columns (signal "1") are K x0.

    Attributes:
        axes: names of the d axes it moves along; ("theta",) is a rotary joint with its torque.
    """

    name: LoadKind
    columns: tuple[Column, ...]
    carries_handle: bool
    axes: tuple[str, ...] = ("x", "y")

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names in the order of the columns."""
        return tuple(column.name for column in self.columns)

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Units in the order of the columns."""
        return tuple(column.unit for column in self.columns)

    @property
    def rotary(self) -> bool:
        """True where the load is a torque against an angle."""
        return self.axes == ROTARY_AXES

    @property
    def force_unit(self) -> str:
        """N, or N*m on a rotary joint."""
        return "N*m" if self.rotary else "N"

    @property
    def place_unit(self) -> str:
        """m, or rad on a rotary joint."""
        return "rad" if self.rotary else "m"

    @property
    def place(self) -> list[int]:
        """Indices of the d columns K x0."""
        return [q for q, column in enumerate(self.columns) if column.signal == "1"]

    def has(self, signal: Signal) -> bool:
        """True where the model has a matrix on this signal."""
        return any(column.signal == signal for column in self.columns)

    def unit(self, signal: Signal) -> str:
        """Unit of the matrix on this signal."""
        return next(column.unit for column in self.columns if column.signal == signal)

    def regressor(self, x: Floats, v: Floats, a: Floats) -> Floats:
        """A with -F_ext = A @ parameters: (N, d) three times -> (N, d, q)."""
        signals: dict[Signal, Floats] = {"a": a, "v": v, "x": x, "1": np.ones_like(x)}
        A = np.zeros((len(x), len(self.axes), len(self.columns)))
        for q, column in enumerate(self.columns):
            for row, axis in column.entries:
                A[:, row, q] += column.sign * signals[column.signal][:, axis]
        return A

    def matrix_map(self, signal: Signal) -> Floats:
        """S with the matrix on `signal`, row by row, = S @ parameters, (d*d, q); zero where there is none."""
        d = len(self.axes)
        S = np.zeros((d * d, len(self.columns)))
        for q, column in enumerate(self.columns):
            if column.signal == signal:
                for row, axis in column.entries:
                    S[d * row + axis, q] = 1.0
        return S


ROTARY_AXES = ("theta",)
_LINEAR_UNITS: dict[Signal, str] = {"a": "kg", "v": "N*s/m", "x": "N/m", "1": "N"}
_ROTARY_UNITS: dict[Signal, str] = {"a": "kg*m^2", "v": "N*m*s/rad", "x": "N*m/rad", "1": "N*m"}


def _units(axes: Sequence[str]) -> dict[Signal, str]:
    return _ROTARY_UNITS if tuple(axes) == ROTARY_AXES else _LINEAR_UNITS


def _letters(axes: Sequence[str]) -> tuple[str, str, str]:
    return ("I", "B", "K") if tuple(axes) == ROTARY_AXES else ("m", "b", "k")


def _suffix(axes: Sequence[str], *places: int) -> str:
    return "" if len(axes) == 1 else "".join(axes[place] for place in places)


def _place(axes: Sequence[str]) -> tuple[Column, ...]:
    unit = _units(axes)["1"]
    return tuple(Column(f"c{_suffix(axes, i)}", unit, "1", ((i, i),), -1.0) for i in range(len(axes)))


def mass_spring(axes: tuple[str, ...] = ("x", "y")) -> LoadModel:
    """[D] eqs. 5 and 6: M = m 1, K symmetric."""
    units, (inertia, _, stiffness) = _units(axes), _letters(axes)
    d = range(len(axes))
    diagonal = [Column(f"{stiffness}{_suffix(axes, i, i)}", units["x"], "x", ((i, i),)) for i in d]
    corners = [(i, j) for i in d for j in d if i < j]
    shared = [
        Column(
            "ks" if len(axes) == 2 else f"{stiffness}{_suffix(axes, i, j)}", units["x"], "x", ((i, j), (j, i))
        )
        for i, j in corners
    ]
    mass = Column(inertia, units["a"], "a", tuple((i, i) for i in d))
    return LoadModel("mass-spring", (mass, *diagonal, *shared, *_place(axes)), False, axes)


def arm(axes: tuple[str, ...] = ("x", "y")) -> LoadModel:
    """[D] eqs. 3, 4 and 9: full matrices; the handle moves with the hand."""
    units, letters = _units(axes), _letters(axes)
    signals: tuple[Signal, ...] = ("a", "v", "x")
    d = range(len(axes))
    columns = tuple(
        Column(f"{letter}{_suffix(axes, i, j)}", units[signal], signal, ((i, j),))
        for letter, signal in zip(letters, signals, strict=True)
        for i in d
        for j in d
    )
    return LoadModel("arm", columns + _place(axes), axes != ROTARY_AXES, axes)


MASS_SPRING = mass_spring()
ARM = arm()
_BUILDERS = {"mass-spring": mass_spring, "arm": arm}
LOADS: dict[str, LoadModel] = {load.name: load for load in (MASS_SPRING, ARM)}


def load_model(kind: str, axes: tuple[str, ...] = ("x", "y")) -> LoadModel:
    """The load model for a kind of trial, on a robot whose end-effector moves along `axes`.

    Raises:
        UndeterminedError: no such load can be identified in the time domain.
    """
    if kind not in _BUILDERS:
        raise UndeterminedError(f"kind {kind!r} has no load model in the time domain")
    return _BUILDERS[kind](axes)
