"""Counts, codes and grids against numbers worked out by hand."""

import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.robot.planar_2r_absolute import Planar2RAbsolute
from impid_host.samples import FLAG_ENCODER_FAULT, FLAG_RESET, FLAG_SATURATED, DeviceSamples
from impid_host.signals.align import base_frame_acceleration, joint_acceleration, sensor_angle
from impid_host.signals.counts import (
    joint_angles,
    longest_run,
    specific_force,
    unwrap_counts,
    usable_samples,
)
from impid_host.signals.resample import bridged, common_grid, nominal_rate, onto_grid
from impid_host.study.model import AccelerometerSetup, EncoderSetup


def device(counts: list[int], codes: list[int], flags: list[int] | None = None) -> DeviceSamples:
    n = len(counts)
    return DeviceSamples(
        t_us=(1000 * np.arange(n)).astype(np.uint64),
        seq=np.arange(n, dtype=np.uint32),
        ax=np.array(codes, dtype=np.uint16),
        ay=np.array(codes, dtype=np.uint16),
        enc1=np.array(counts, dtype=np.int32),
        enc2=np.array(counts, dtype=np.int32),
        flags=np.array(flags or [0] * n, dtype=np.uint8),
    )


def sensor(mount: str, angle: float = 0.0) -> AccelerometerSetup:
    return AccelerometerSetup("ADXL203", 3.3, 65536, (1.65, 1.55), (0.62, 0.5), mount, angle)  # type: ignore[arg-type]


def test_counter_runs_on_across_its_wrap_in_both_directions() -> None:
    top = 2**31 - 1
    assert unwrap_counts(np.array([top - 1, top, -top - 1, -top], dtype=np.int32)).tolist() == [
        top - 1,
        top,
        top + 1,
        top + 2,
    ]
    assert unwrap_counts(np.array([-top - 1, top], dtype=np.int32)).tolist() == [-top - 1, -top - 2]


def test_angle_has_zero_direction_and_resolution() -> None:
    encoder = EncoderSetup((400_000, 1000), (0.1, -0.2), (1, -1))
    theta = joint_angles(device([0, 500], [0, 0]), encoder)
    assert theta[0] == pytest.approx([0.1, -0.2])
    assert theta[1] == pytest.approx([0.1 + np.pi / 400, -0.2 - np.pi])


def test_half_scale_code_is_the_first_axis_zero_g() -> None:
    force = specific_force(device([0, 0], [32768, 32768 + 12313]), sensor("link2"))
    assert force[0] == pytest.approx([0.0, 0.1 / 0.5 * 9.80665])
    # 12313 codes are 0.62001 V, one g on the first axis.
    assert force[1, 0] == pytest.approx(9.80665, rel=1e-4)


def test_flags_and_resets() -> None:
    samples = device([0] * 6, [0] * 6, [0, FLAG_SATURATED, FLAG_RESET, 0, FLAG_ENCODER_FAULT, 0])
    assert usable_samples(samples).tolist() == [True, False, True, True, False, True]
    assert longest_run(samples) == slice(2, 6)


def test_sensor_axes_turn_with_link_2_or_stay() -> None:
    theta = np.array([[0.0, np.pi / 2]])
    along = np.array([[1.0, 0.0]])
    model = Planar2RAbsolute(0.254, 0.2667)

    def in_base(mounted: AccelerometerSetup) -> list[float]:
        return list(base_frame_acceleration(along, sensor_angle(theta, mounted, model))[0])

    assert in_base(sensor("link2")) == pytest.approx([0, 1], abs=1e-12)
    assert in_base(sensor("fixed")) == pytest.approx([1, 0], abs=1e-12)
    assert in_base(sensor("link2", np.pi / 2)) == pytest.approx([-1, 0], abs=1e-12)


def test_a_sensor_at_rest_feels_the_opposite_of_gravity() -> None:
    felt = np.array([[0.0, 9.81]])
    assert base_frame_acceleration(felt, np.zeros(1), (0.0, -9.81))[0] == pytest.approx([0, 0], abs=1e-12)


def test_joint_acceleration_inverts_the_chain_rule() -> None:
    rng = np.random.default_rng(0)
    J, J_rate = rng.normal(size=(2, 5, 2, 2))
    omega, theta_dd = rng.normal(size=(2, 5, 2))
    a = np.einsum("kij,kj->ki", J, theta_dd) + np.einsum("kij,kj->ki", J_rate, omega)
    assert joint_acceleration(a, J, J_rate, omega) == pytest.approx(theta_dd)


def test_short_gaps_are_bridged_and_long_ones_marked() -> None:
    t = np.arange(0, 3, 1e-3)
    usable = np.ones(len(t), dtype=bool)
    usable[500:503] = False
    usable[1000:1200] = False
    grid = common_grid(0.0, t[-1], 1000.0)
    mask = bridged(t, usable, grid)
    assert mask[499:504].all()
    assert not mask[1001:1199].any()
    wave = np.sin(2 * np.pi * 2 * t)[:, None]
    damaged = np.where(usable[:, None], wave, 1e6)
    result = onto_grid(t, damaged, usable, grid)
    assert result[mask] == pytest.approx(wave[: grid.count][mask], abs=1e-6)
    assert np.abs(result).max() < 1.5  # a spline through the long gap would swing


def test_rate_survives_jitter_and_gaps() -> None:
    rng = np.random.default_rng(2)
    t = np.arange(0, 5, 1e-3) + rng.normal(0, 2e-5, 5000)
    assert nominal_rate(np.sort(t)[rng.random(5000) > 0.05]) == 1000.0
    assert nominal_rate(np.arange(0, 10, 1 / 95.3)) == pytest.approx(95.3)


def test_too_little_is_refused() -> None:
    with pytest.raises(UndeterminedError, match="only 3 samples"):
        nominal_rate(np.arange(3.0))
    with pytest.raises(UndeterminedError, match="at least 2 s"):
        common_grid(5.0, 4.0, 1000.0)
