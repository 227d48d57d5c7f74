"""The late one-sided reflex: recovered from a simulated joint, and on measured ankles."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from impid_host.errors import UndeterminedError
from impid_host.impedance.reflex import Band, fit_reflex
from scipy.integrate import solve_ivp

RATE = 500.0


def joint(seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Angle in closed form and its torque: 0.015, 0.8, 60 and a reflex of gain 5 after 50 ms below 2 Hz."""
    rng = np.random.default_rng(8)
    w, p = 2 * np.pi * rng.uniform(0.6, 8.0, 12), rng.uniform(0, 2 * np.pi, 12)

    def at(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        angle = np.multiply.outer(t, w) + p
        v, a = (w * np.cos(angle)).sum(axis=-1), -(w**2 * np.sin(angle)).sum(axis=-1)
        return 0.01 * np.sin(angle).sum(axis=-1), 0.01 * v, 0.01 * a

    corner = 2 * np.pi * 2.0

    def muscle(t: float, y: np.ndarray) -> list[float]:
        stretch = max(float(at(np.array(t - 0.05))[1]), 0.0)
        return [y[1], corner**2 * (stretch - y[0]) - 2 * corner * y[1]]

    t = np.arange(0, seconds, 1 / RATE)
    reflex = solve_ivp(muscle, (0, seconds), [0, 0], t_eval=t, max_step=0.005, rtol=1e-6, atol=1e-9).y[0]
    x, v, a = at(t)
    return x, 0.015 * a + 0.8 * v + 60.0 * (x - 0.1) + 5.0 * reflex


def test_a_reflex_is_found_with_its_delay_and_side() -> None:
    theta, torque = joint(24.0)
    noise = np.random.default_rng(0).normal(0, 0.01, torque.shape)
    fit = fit_reflex(theta, torque + noise, RATE, fit_s=16.0, band=Band(0.5, 40.0))
    assert fit.with_reflex == pytest.approx((0.015, 0.8, 60.0), rel=0.02)
    assert fit.gain[0] == pytest.approx(5.0, rel=0.1)
    assert abs(fit.gain[1]) < 0.3
    assert fit.delay_s == pytest.approx(0.05, abs=0.004)
    assert fit.corner_rad_s == pytest.approx(2 * np.pi * 2.0, rel=0.1)
    assert fit.vaf_reflex > 99.5
    assert fit.vaf_intrinsic < fit.vaf_reflex - 0.5


def test_a_short_record_is_refused() -> None:
    with pytest.raises(UndeterminedError, match="5 s on either side"):
        fit_reflex(np.zeros(4000), np.zeros(4000), RATE, fit_s=4.0)


@pytest.mark.measured
@pytest.mark.parametrize(("record", "goal"), [("z_df", 93.4), ("z_pf", 74.8), ("z_df2", 96.7)])
def test_measured_ankles(measured_data: Path, record: str, goal: float) -> None:
    columns = pq.read_table(measured_data / "ankle_impedance" / f"{record}.parquet")
    theta, torque = np.asarray(columns["position_rad"]), -np.asarray(columns["torque_Nm"])
    fit = fit_reflex(theta, torque, 1000.0, fit_s=40.0)
    assert fit.vaf_reflex >= goal
    assert 0.013 < fit.with_reflex[0] < 0.018  # a foot with its footplate
    assert 40 < fit.with_reflex[2] < 120
