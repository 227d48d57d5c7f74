"""From full-rate signals of one trial to the rows of a regression: low-pass alike, split, decimate."""

from dataclasses import dataclass

import numpy as np

from impid_host.impedance.linear import Stretch
from impid_host.signals.align import AlignedTrial
from impid_host.signals.arrays import Floats, Mask
from impid_host.signals.chain import Chain

SERIES_RATE_HZ = 100.0


@dataclass(frozen=True, slots=True)
class Split:
    """How much of each trial's end is held out for validation; [D] holds out 10 s of 50 s.

    A trial shorter than five times `validation_s` gives up a fifth of its length instead, and one whose end
    is lost to a filter's edge half as much of what is left; 0 holds nothing out.
    """

    validation_s: float = 10.0

    def masks(self, trial: AlignedTrial, chain: Chain) -> tuple[Mask, Mask]:
        """(fit, validation), each (N,); between them a pause as long as the low-pass remembers."""
        duration = float(trial.elapsed[-1])
        held = min(self.validation_s, duration / 5)
        if held <= 0:
            return trial.valid, trial.valid
        last = float(trial.elapsed[trial.valid][-1]) if trial.valid.any() else duration
        begin = min(duration - held, last - held / 2)
        pause = 1 / chain.finish.cutoff_hz if chain.finish is not None else 0.1
        return trial.valid & (trial.elapsed < begin - pause), trial.valid & (trial.elapsed >= begin)


@dataclass(frozen=True, slots=True)
class Equation:
    """One trial's `target = design @ parameters` at the full rate, finished (low-passed) alike on both sides.

    Attributes:
        design: (N, c, p); target: (N, c); nuisance: (N, c, k) or None; instruments: (N, c, p) or None.
    """

    trial: AlignedTrial
    design: Floats
    target: Floats
    nuisance: Floats | None = None
    instruments: Floats | None = None


@dataclass(frozen=True, slots=True)
class Series:
    """Target and fit of one trial at about 100 Hz, for validation and figures.

    Attributes:
        t: s since the trial's first instant, (N,); target, fit: (N, c); held_out: rows of the validation
            part, (N,);
        shown: rows that neither gaps nor filter edges touch, (N,).
    """

    trial: str
    t: Floats
    target: Floats
    fit: Floats
    held_out: Mask
    shown: Mask

    def vaf(self) -> Floats:
        """[D] eq. 8 on the held-out rows, %, (c,)."""
        residual = self.target[self.held_out] - self.fit[self.held_out]
        spread = np.maximum(np.var(self.target[self.held_out], axis=0), 1e-300)
        result: Floats = 100 * (1 - np.var(residual, axis=0) / spread)
        return result

    def rms(self) -> Floats:
        """rms of the residual on the held-out rows, (c,)."""
        residual = self.target[self.held_out] - self.fit[self.held_out]
        result: Floats = np.sqrt(np.mean(residual**2, axis=0))
        return result


def finish(chain: Chain, values: Floats, rate_hz: float) -> Floats:
    """The chain's last low-pass, the same for regressors and targets; any shape with time first."""
    return values if chain.finish is None else chain.finish.apply(values, rate_hz)


def stretches(equation: Equation, part: Mask, chain: Chain) -> list[Stretch]:
    """The decimated rows of `part`, cut wherever a row is missing."""
    step = chain.decimation(equation.trial.rate_hz)
    kept = np.flatnonzero(part)
    kept = kept[kept % step == 0]
    if len(kept) == 0:
        return []
    runs = np.split(kept, np.flatnonzero(np.diff(kept) != step) + 1)
    return [
        Stretch(
            equation.design[run],
            equation.target[run],
            None if equation.nuisance is None else equation.nuisance[run],
            None if equation.instruments is None else equation.instruments[run],
        )
        for run in runs
    ]


def series(equation: Equation, value: Floats, held_out: Mask) -> Series:
    """Target and fit for validation and figures."""
    step = max(1, round(equation.trial.rate_hz / SERIES_RATE_HZ))
    some = slice(None, None, step)
    return Series(
        trial=equation.trial.name,
        t=equation.trial.elapsed[some],
        target=equation.target[some],
        fit=equation.design[some] @ value,
        held_out=held_out[some],
        shown=equation.trial.valid[some],
    )
