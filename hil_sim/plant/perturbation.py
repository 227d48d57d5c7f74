"""Force perturbations of the stochastic method, [P] Sec. II: random pushes while a weak PD holds."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, coherence, sosfilt

from hil_sim.plant.kinematics import joint_angles, joints_of
from hil_sim.plant.table import columns_of

Array = NDArray[np.float64]
RATE_HZ = 500.0  # of the random numbers, [P]
SEARCH = 12  # pairs of signals among which the least coherent is taken


@dataclass(frozen=True)
class Perturbation:
    """A place to hold and a force to push with; implements `Course` for the controller at the end-effector.

    Attributes:
        hold_m: where the PD holds, shape (2,).
        force_N: one row per 2 ms, shape (n, 2).
        link_lengths_m: l1, l2.
        relative: see hil_sim.plant.plant.
    """

    hold_m: Array
    force_N: Array
    link_lengths_m: tuple[float, float]
    relative: bool = False

    @property
    def start_rad(self) -> Array:
        """Joint angles at which the robot rests before the start, shape (2,)."""
        return joints_of(joint_angles(self.hold_m, self.link_lengths_m), relative=self.relative)

    def ticked(self, tick_s: float) -> "HeldPerturbation":
        """On the ticks of a controller with this period, each force held until the next."""
        return HeldPerturbation(self, round(1.0 / (RATE_HZ * tick_s)))


class HeldPerturbation:
    """Rows of x, y (m) and force (N) by the number of the tick; no force after the last."""

    def __init__(self, perturbation: Perturbation, hold_ticks: int) -> None:
        self._perturbation = perturbation
        self._hold_ticks = hold_ticks

    def ticks(self, first: int, count: int) -> Array:
        """Rows for ticks first to first + count - 1, shape (count, 4)."""
        table = self._perturbation.force_N
        index = (first + np.arange(count)) // self._hold_ticks
        force = np.where((index < table.shape[0])[:, None], table[np.minimum(index, table.shape[0] - 1)], 0.0)
        place = np.broadcast_to(self._perturbation.hold_m, (count, 2))
        return np.hstack([place, force])


def played_perturbation(path: Path, hold_m: Array, link_lengths_m: tuple[float, float]) -> Perturbation:
    """The forces of a CSV with the columns t (s), fdx and fdy (N), one row per 2 ms.

    Raises:
        ValueError: the file cannot be read, lacks a column, or has another rate.
    """
    force = columns_of(path, ("fdx", "fdy"), RATE_HZ, "a force")
    return Perturbation(hold_m, force, link_lengths_m)


def random_perturbation(
    *,
    hold_m: Array,
    rms_N: float,
    highest_Hz: float,
    duration_s: float,
    link_lengths_m: tuple[float, float],
    generator: np.random.Generator,
) -> Perturbation:
    """Uniform random numbers through a Butterworth filter of order 8; of several pairs the least coherent."""
    low = butter(8, highest_Hz, fs=RATE_HZ, output="sos")
    count = round(duration_s * RATE_HZ)
    best, least = np.zeros((count, 2)), np.inf
    for _ in range(SEARCH):
        force = sosfilt(low, generator.uniform(-1.0, 1.0, (count, 2)), axis=0)
        f, shared = coherence(force[:, 0], force[:, 1], fs=RATE_HZ, nperseg=min(2048, count // 4))
        mean = float(np.mean(shared[f < highest_Hz]))
        if mean < least:
            best, least = force, mean
    return Perturbation(hold_m, best * (rms_N / best.std(axis=0)), link_lengths_m)
