"""Whitened rows made by hand, of a regression whose truth is known: what the search's parts are tried on."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from impid_host.diagnosis.noise import Noise
from impid_host.diagnosis.rows import Run, Slot, slots_of
from impid_host.diagnosis.table import Table, table_of
from impid_host.effects.effect import UNATTRIBUTED, Term

STEP_S = 0.05
GAUSS = 1e4
Signal = Callable[[np.random.Generator, np.ndarray], np.ndarray]


def term(
    effect: str, *where: str, size: int = 1, shapes: Sequence[float] = (0.0,), **changes: object
) -> Term:
    """A term of that name; its columns are the rows' business."""
    plain = Term(
        effect, where, lambda _view, _shape: {}, lambda _beta, _shape: {}, size=size, shapes=tuple(shapes)
    )
    return replace(plain, **changes)  # type: ignore[arg-type]


def curve(on: str, variable: str, size: int = 4) -> Term:
    """An unnamed structure."""
    return term(UNATTRIBUTED, on, variable, size=size, variant=f"{variable} by {size}")


@dataclass
class Rows:
    """Rows of one torque channel (or more) over several trials.

    Attributes:
        columns: by label and shape, the signal of each trial, (trials, N, q); made when first asked for.
    """

    terms: Sequence[Term]
    seed: int = 0
    trials: int = 4
    count: int = 400
    channels: int = 1
    base: int = 2
    alike: dict[str, str] = field(default_factory=dict)  # label -> label whose columns it has
    loaded: frozenset[str] = frozenset()  # trials under load
    shaped: Callable[[float, np.ndarray], np.ndarray] = lambda shape, t: np.sin(2 * np.pi * shape * t)

    def __post_init__(self) -> None:
        self.t = STEP_S * np.arange(self.count)
        self.rng = np.random.default_rng([5, self.seed])
        self.base_columns = self.rng.standard_normal((self.channels, self.trials, self.count, self.base))
        self.made: dict[tuple[str, float], np.ndarray] = {}

    def of(self, own: Term, shape: float) -> np.ndarray:
        """(channels, trials, N, q)."""
        label = self.alike.get(own.label, own.label)
        key = (label, shape)
        if key not in self.made:
            if len(own.shapes) > 1 or shape != 0.0:
                signal = self.shaped(shape, self.t)
                block = np.broadcast_to(signal[:, None], (self.channels, self.trials, self.count, 1)).copy()
            else:
                rng = np.random.default_rng([7, self.seed, *label.encode()])
                block = rng.standard_normal((self.channels, self.trials, self.count, own.size))
            self.made[key] = block
        return self.made[key]

    def runs(self, slots: Sequence[Slot], target: np.ndarray, *, base: bool = True) -> list[Run]:
        """Target (channels, trials, N)."""
        result = []
        for channel in range(self.channels):
            for trial in range(self.trials):
                blocks = [self.of(slot.term, slot.shape)[channel, trial] for slot in slots]
                used = [np.arange(slot.columns.start, slot.columns.stop) for slot in slots]
                result.append(
                    Run(
                        f"free_{trial + 1:02d}",
                        "torque",
                        channel,
                        "fit",
                        0.0,
                        STEP_S,
                        target[channel, trial],
                        self.base_columns[channel, trial] if base else np.zeros((self.count, self.base)),
                        np.concatenate(used) if used else np.zeros(0, dtype=np.intp),
                        np.concatenate([np.zeros((self.count, 0)), *blocks], axis=1),
                    )
                )
        return result

    def target(self, truth: dict[str, object], noise: float = 1.0, shape: float = 0.0) -> np.ndarray:
        """Base at (3, -2, ...), the labelled terms at their coefficients, white noise."""
        result = noise * self.rng.standard_normal((self.channels, self.trials, self.count))
        result += self.base_columns @ (3.0 - 5.0 * np.arange(self.base))
        for own in self.terms:
            if own.label in truth:
                result += self.of(own, shape) @ np.atleast_1d(np.array(truth[own.label], dtype=float))
        return result

    def table(self, target: np.ndarray, tail: float = GAUSS) -> Table:
        """Of all terms at all their shapes."""
        slots = slots_of(self.terms)
        keys = [("torque", channel) for channel in range(self.channels)]
        noise = Noise(dict.fromkeys(keys, np.ones(1)), dict.fromkeys(keys, tail))
        silent = np.zeros_like(target)

        def make(fresh: Sequence[Slot]) -> list[Run]:
            return self.runs(fresh, silent, base=False)

        return table_of(self.runs(slots, target), slots, noise, make, self.loaded)


def stacked(table: Table, base: Sequence[np.ndarray], slots: Sequence[int]) -> np.ndarray:
    """[base | columns of the slots] of all rows, as numpy would take them."""
    columns = table.columns(slots)
    return np.concatenate(
        [np.column_stack([b, run.columns(columns)]) for b, run in zip(base, table.runs, strict=True)]
    )
