"""Do trials with the same perturbation give the same forces and displacements?

Source: [P] Sec. IV: mean of the squared correlation coefficients over all pairs of trials (0.95 to 0.98
there).
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.arrays import Floats

# The lowest that [P] accepts as "similar throughout the test" is 0.95; below 0.9 we call it changed.
REPEATABLE_R2 = 0.9


@dataclass(frozen=True, slots=True)
class RepeatabilityCheck:
    """Outcome per signal.

    Attributes:
        names: the signals, n of them.
        r_squared: squared correlation of each pair of trials, shape (pairs, n).
        pairs: trial indices of each pair.
        holds: True when every signal's mean R^2 reaches `REPEATABLE_R2`.
        same_command: the commanded perturbations repeat each other as well; None where they are not known.
    """

    names: tuple[str, ...]
    r_squared: Floats
    pairs: tuple[tuple[int, int], ...]
    holds: bool
    same_command: bool | None = None

    @property
    def verdict(self) -> str:
        """One sentence for the lab book."""
        mean = self.r_squared.mean(axis=0)
        listed = ", ".join(f"{name} {value:.3f}" for name, value in zip(self.names, mean, strict=True))
        if self.same_command is False:
            return "not judged, because the trials were shaken by different perturbations"
        if self.holds:
            return f"trials repeat each other (mean R² {listed})"
        worst = int(np.argmin(self.r_squared.min(axis=1)))
        first, second = self.pairs[worst]
        return (
            f"trials differ (mean R² {listed}), most of all trials {first + 1} and {second + 1}: other "
            "perturbations were used, the subject acted, or the posture moved"
        )

    def __str__(self) -> str:
        return f"repeatability: {self.verdict}"


def repeatability(
    trials: tuple[Floats, ...], names: tuple[str, ...], commands: tuple[Floats, ...] | None = None
) -> RepeatabilityCheck:
    """Squared correlation between all pairs of trials.

    Args:
        trials: at least two arrays of shape (N, n), started at the same instant of the same perturbation; the
            longer ones are cut to the shortest.
        names: of the n signals.
        commands: the commanded perturbations, shape (N, m), where they are known.

    Raises:
        UndeterminedError: fewer than two trials.
    """
    if len(trials) < 2:
        raise UndeterminedError("repeatability needs at least two trials of the same load and perturbation")
    pairs = tuple(combinations(range(len(trials)), 2))
    r_squared = _likeness(trials, pairs)
    holds = bool(np.all(r_squared.mean(axis=0) >= REPEATABLE_R2))
    if commands is None:
        return RepeatabilityCheck(names, r_squared, pairs, holds)
    alike = bool(np.all(_likeness(commands, pairs).mean(axis=0) >= REPEATABLE_R2))
    return RepeatabilityCheck(names, r_squared, pairs, holds, alike)


def _likeness(trials: tuple[Floats, ...], pairs: tuple[tuple[int, int], ...]) -> Floats:
    samples = min(len(trial) for trial in trials)
    standard = [(t[:samples] - t[:samples].mean(axis=0)) / t[:samples].std(axis=0) for t in trials]
    return np.array([np.mean(standard[i] * standard[j], axis=0) ** 2 for i, j in pairs])
