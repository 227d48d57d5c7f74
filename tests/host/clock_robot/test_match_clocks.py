"""Clock matching against logs of known offset and drift, made from a closed form."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from impid_host.clock.robot import match_clocks
from impid_host.errors import UndeterminedError

COUNT_RAD = 2 * np.pi / 400_000


@dataclass(frozen=True)
class Logs:
    """Both logs and the truth: t_device = offset + (1 + drift) * t_robot."""

    t_device: np.ndarray
    theta_device: np.ndarray
    t_robot: np.ndarray
    theta_robot: np.ndarray
    offset: float
    drift: float

    def device_time(self, t_robot: float) -> float:
        return self.offset + (1 + self.drift) * t_robot


def multisine(seed: int, amplitude_deg: float = 20.0) -> Callable[[np.ndarray], np.ndarray]:
    """Ten sinusoids in 0 to 2 Hz per joint, as in [D], on the module's clock."""
    rng = np.random.default_rng(seed)
    frequency = np.sort(rng.uniform(0.1, 2.0, (2, 10)))
    phase = rng.uniform(0, 2 * np.pi, (2, 10))
    amplitude = np.deg2rad(amplitude_deg) / 5.0

    def theta(t: np.ndarray) -> np.ndarray:
        arguments = 2 * np.pi * frequency[:, :, None] * t + phase[:, :, None]
        return (0.7 + amplitude * np.sin(arguments).sum(axis=1)).T

    return theta


def make_logs(
    theta: Callable[[np.ndarray], np.ndarray],
    *,
    offset: float = 312.3456789,
    drift: float = 80e-6,
    duration: float = 50.0,
    robot_start: float = 0.0,
    device_start: float = 0.0,
    phase: float = 0.3712,
    count_rad: float = COUNT_RAD,
) -> Logs:
    """The robot's zero is the module's `offset`; the module starts `device_start` s after it."""
    t_robot = robot_start + np.arange(0.0, duration, 1e-3)
    t_device = np.floor((offset + device_start) * 1e3) * 1e-3 + phase * 1e-3 + np.arange(0.0, duration, 1e-3)

    def quantised(t: np.ndarray) -> np.ndarray:
        return np.round(theta(t) / count_rad) * count_rad

    return Logs(
        t_device, quantised(t_device - offset), t_robot, quantised(drift_apply(t_robot, drift)), offset, drift
    )


def drift_apply(t_robot: np.ndarray, drift: float) -> np.ndarray:
    return (1 + drift) * t_robot


def errors(logs: Logs) -> tuple[float, float, bool, bool]:
    fit = match_clocks(logs.t_device, logs.theta_device, logs.t_robot, logs.theta_robot)
    offset_error = fit.device_ref_s - logs.device_time(fit.robot_ref_s)
    drift_error = fit.drift_ppm - logs.drift * 1e6
    low, high = fit.offset_ci95_s
    drift_low, drift_high = fit.drift_ci95_ppm
    covered = abs(offset_error) <= (high - low) / 2
    return offset_error, drift_error, covered, abs(drift_error) <= (drift_high - drift_low) / 2


def test_clean_motion_of_50_s_reaches_half_a_microsecond_and_a_fiftieth_ppm() -> None:
    offset_error, drift_error, _, _ = errors(make_logs(multisine(0)))
    assert abs(offset_error) < 0.5e-6
    assert abs(drift_error) < 0.02


def test_error_stays_near_the_cramer_rao_bound_and_the_interval_covers() -> None:
    # Two readings, each uniform within one count: variance 2 q^2 / 12 per difference, information
    # sum(omega^2).
    normalised, covered = [], []
    for seed in range(40):
        rng = np.random.default_rng(1000 + seed)
        theta = multisine(seed)
        logs = make_logs(theta, duration=20.0, phase=rng.uniform(), offset=rng.uniform(0, 500))
        offset_error, _, offset_in, drift_in = errors(logs)
        t = logs.t_robot
        omega = np.gradient(theta(t), t, axis=0)
        deviation = np.concatenate([omega - omega.mean(axis=0)])
        bound = np.sqrt(2 * COUNT_RAD**2 / 12 / np.sum(deviation**2))
        normalised.append(offset_error / bound)
        covered += [offset_in, drift_in]
    assert np.sqrt(np.mean(np.square(normalised))) < 1.2 * (1 + 2 / np.sqrt(2 * 40))  # two sigmas of 40 draws
    assert 0.87 <= np.mean(covered) <= 1.0


@pytest.mark.parametrize("drift", [-200e-6, 200e-6])
@pytest.mark.parametrize("start", [-5.0, 5.0, 17.0])
def test_late_starts_and_fast_clocks(drift: float, start: float) -> None:
    offset_error, drift_error, _, _ = errors(make_logs(multisine(3), drift=drift, device_start=start))
    assert abs(offset_error) < 0.7e-6
    assert abs(drift_error) < 0.06


def test_partial_overlap() -> None:
    offset_error, drift_error, _, _ = errors(make_logs(multisine(4), device_start=42.0))
    assert abs(offset_error) < 1e-6
    assert abs(drift_error) < 1.0


def test_missing_and_late_rows_and_jitter() -> None:
    rng = np.random.default_rng(5)
    logs = make_logs(multisine(5))
    t_robot = logs.t_robot + rng.normal(0, 30e-6, len(logs.t_robot))
    late = rng.random(len(t_robot)) < 0.002
    t_robot[late] += 4e-4
    keep = rng.random(len(t_robot)) > 0.05
    keep[20_000:21_500] = False
    keep_device = np.ones(len(logs.t_device), dtype=bool)
    keep_device[8_000:8_400] = False
    damaged = Logs(
        logs.t_device[keep_device],
        logs.theta_device[keep_device],
        t_robot[keep],
        logs.theta_robot[keep],
        logs.offset,
        logs.drift,
    )
    offset_error, drift_error, _, _ = errors(damaged)
    assert abs(offset_error) < 1e-6  # 30 us / sqrt(95,000 rows) = 0.1 us
    assert abs(drift_error) < 0.05


def test_a_constant_between_the_two_angle_readings_does_not_shift_the_clock() -> None:
    logs = make_logs(multisine(6))
    shifted = Logs(
        logs.t_device,
        logs.theta_device,
        logs.t_robot,
        logs.theta_robot + np.array([0.01, -0.02]),
        logs.offset,
        logs.drift,
    )
    offset_error, _, _, _ = errors(shifted)
    assert abs(offset_error) < 0.5e-6


def test_slow_motion_of_few_counts_per_sample_keeps_an_honest_interval() -> None:
    covered = [
        errors(make_logs(multisine(seed, 1.0), duration=20.0, phase=0.1 * seed, count_rad=2 * np.pi / 4000))[
            2
        ]
        for seed in range(12)
    ]
    assert np.mean(covered) >= 0.75


def test_one_joint_is_enough() -> None:
    logs = make_logs(multisine(7))
    fit = match_clocks(logs.t_device, logs.theta_device[:, :1], logs.t_robot, logs.theta_robot[:, :1])
    assert abs(fit.device_ref_s - logs.device_time(fit.robot_ref_s)) < 0.5e-6


def at_rest(t: np.ndarray) -> np.ndarray:
    return np.full((len(t), 2), 0.5) + 1.2 * COUNT_RAD * np.sin(40 * t)[:, None]


def ramp(t: np.ndarray) -> np.ndarray:
    return 0.3 * np.stack([t, -t], axis=1)


def periodic(t: np.ndarray) -> np.ndarray:
    return 0.3 * np.stack([np.sin(2 * np.pi * t), np.cos(2 * np.pi * t)], axis=1)


@pytest.mark.parametrize(
    ("theta", "words"),
    [
        (at_rest, "hardly move"),
        (ramp, "one speed|speed never changes"),
        (periodic, "repeats itself"),
    ],
)
def test_a_motion_that_does_not_determine_the_clocks_is_refused(
    theta: Callable[[np.ndarray], np.ndarray], words: str
) -> None:
    logs = make_logs(theta, duration=20.0)
    with pytest.raises(UndeterminedError, match=words):
        match_clocks(logs.t_device, logs.theta_device, logs.t_robot, logs.theta_robot)


def test_logs_of_different_trials_are_refused() -> None:
    one, other = make_logs(multisine(8)), make_logs(multisine(9))
    with pytest.raises(UndeterminedError, match="same motion"):
        match_clocks(one.t_device, one.theta_device, other.t_robot, other.theta_robot)


def test_a_long_log_at_200_ppm() -> None:
    logs = make_logs(multisine(10), drift=200e-6, duration=400.0)
    offset_error, drift_error, _, _ = errors(logs)
    assert abs(offset_error) < 0.2e-6
    assert abs(drift_error) < 3e-3
