"""The load models, one table row per parameter: -F_ext = sum of parameter * (signal through its entries)."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.signals.arrays import Floats

Signal = Literal["a", "v", "x", "1"]


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
    """A load on the end-effector that is linear in its parameters; the vector (cx, cy) is K x0."""

    name: str
    columns: tuple[Column, ...]
    carries_handle: bool

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names in the order of the columns."""
        return tuple(column.name for column in self.columns)

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Units in the order of the columns."""
        return tuple(column.unit for column in self.columns)

    def regressor(self, x: Floats, v: Floats, a: Floats) -> Floats:
        """A with -F_ext = A @ parameters: (N, 2) three times -> (N, 2, q)."""
        signals: dict[Signal, Floats] = {"a": a, "v": v, "x": x, "1": np.ones_like(x)}
        A = np.zeros((len(x), 2, len(self.columns)))
        for q, column in enumerate(self.columns):
            for row, axis in column.entries:
                A[:, row, q] += column.sign * signals[column.signal][:, axis]
        return A

    def matrix_map(self, signal: Signal) -> Floats:
        """S with [xx, xy, yx, yy] = S @ parameters, (4, q); zero where the model has no such matrix."""
        S = np.zeros((4, len(self.columns)))
        for q, column in enumerate(self.columns):
            if column.signal == signal:
                for row, axis in column.entries:
                    S[2 * row + axis, q] = 1.0
        return S


_XX, _XY, _YX, _YY = (0, 0), (0, 1), (1, 0), (1, 1)
_PLACE = (
    Column("cx", "N", "1", (_XX,), -1.0),
    Column("cy", "N", "1", (_YY,), -1.0),
)

# [D] eqs. 5 and 6: M = m 1, K symmetric.
MASS_SPRING = LoadModel(
    "mass-spring",
    (
        Column("m", "kg", "a", (_XX, _YY)),
        Column("kxx", "N/m", "x", (_XX,)),
        Column("kyy", "N/m", "x", (_YY,)),
        Column("ks", "N/m", "x", (_XY, _YX)),
        *_PLACE,
    ),
    carries_handle=False,
)

# [D] eqs. 3, 4 and 9: full matrices; the handle moves with the hand.
_ARM_MATRICES: tuple[tuple[str, str, Signal], ...] = (
    ("m", "kg", "a"),
    ("b", "N*s/m", "v"),
    ("k", "N/m", "x"),
)
ARM = LoadModel(
    "arm",
    tuple(
        Column(f"{letter}{axes}", unit, signal, (entry,))
        for letter, unit, signal in _ARM_MATRICES
        for axes, entry in (("xx", _XX), ("xy", _XY), ("yx", _YX), ("yy", _YY))
    )
    + _PLACE,
    carries_handle=True,
)

LOADS: dict[str, LoadModel] = {load.name: load for load in (MASS_SPRING, ARM)}


def load_model(kind: str) -> LoadModel:
    """The load model for a kind of trial.

    Raises:
        UndeterminedError: no such load can be identified in the time domain.
    """
    if kind not in LOADS:
        raise UndeterminedError(f"kind {kind!r} has no load model in the time domain")
    return LOADS[kind]
