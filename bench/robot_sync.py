"""Measured figures of the clock match between module and robot log: error, bound, coverage, time.

    python bench/robot_sync.py [--draws 40]

Ten sinusoids in 0 to 2 Hz over about 40 degrees per joint, 50 s at 1 kHz, 400,000 counts per revolution on
both logs, random offset and drift within 200 ppm. The Cramer-Rao bound takes both readings as uniform within
one count.
"""

import argparse
import time

import numpy as np
from impid_host.clock.robot import match_clocks

COUNT_RAD = 2 * np.pi / 400_000
DURATION_S = 50.0


def draw(seed: int) -> tuple[float, float, float, bool, bool, float]:
    """Offset error (s), drift error, offset error over its bound, covered (offset, drift), seconds taken."""
    rng = np.random.default_rng(seed)
    angular = 2 * np.pi * rng.uniform(0.1, 2.0, (2, 10, 1))
    phase = rng.uniform(0, 2 * np.pi, (2, 10, 1))
    offset, drift, lag = rng.uniform(0, 500), rng.uniform(-200e-6, 200e-6), rng.uniform(-5, 5)

    def theta(t: np.ndarray) -> np.ndarray:
        exact = (0.7 + 0.07 * np.sin(angular * t + phase).sum(axis=1)).T
        return np.asarray(np.round(exact / COUNT_RAD) * COUNT_RAD)

    t_robot = np.arange(0, DURATION_S, 1e-3)
    t_device = offset + lag + np.arange(0, DURATION_S, 1e-3)
    logs = t_device, theta(t_device - offset), t_robot, theta((1 + drift) * t_robot)
    begin = time.perf_counter()
    fit = match_clocks(*logs)
    taken = time.perf_counter() - begin
    error = fit.device_ref_s - (offset + (1 + drift) * fit.robot_ref_s)
    shared = (t_robot > lag) & (t_robot < lag + DURATION_S)
    omega = 0.07 * (angular * np.cos(angular * t_robot[shared] + phase)).sum(axis=1)
    bound = np.sqrt(2 * COUNT_RAD**2 / 12 / np.sum((omega - omega.mean(axis=1, keepdims=True)) ** 2))
    inside = abs(error) <= 0.5 * np.ptp(fit.offset_ci95_s)
    drift_inside = abs(fit.drift_ppm - drift * 1e6) <= 0.5 * np.ptp(fit.drift_ci95_ppm)
    return error, fit.drift - drift, error / bound, bool(inside), bool(drift_inside), taken


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--draws", type=int, default=40)
    draws = np.array([draw(seed) for seed in range(parser.parse_args().draws)], dtype=float)
    offset, drift, over_bound, inside, drift_inside, taken = draws.T
    print(
        f"{len(draws)} logs of {DURATION_S:.0f} s, offset up to 500 s, start within 5 s, drift within 200 ppm"
    )
    print(f"offset error   rms {offset.std() * 1e6:.3f} us, largest {np.abs(offset).max() * 1e6:.3f} us")
    print(f"drift error    rms {drift.std() * 1e6:.4f} ppm, largest {np.abs(drift).max() * 1e6:.4f} ppm")
    print(f"over the Cramer-Rao bound (rms)  {np.sqrt(np.mean(over_bound**2)):.2f}")
    print(
        f"95 % intervals cover  offset {100 * inside.mean():.0f} %, drift {100 * drift_inside.mean():.0f} %"
    )
    print(f"time per trial  {np.median(taken):.2f} s")


if __name__ == "__main__":
    main()
