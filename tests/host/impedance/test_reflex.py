"""The late one-sided reflex: recovered from a simulated joint, and on measured ankles."""

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from impid_host.cli import cli
from impid_host.errors import UndeterminedError
from impid_host.impedance.reflex import Band, fit_reflex, followed_band
from impid_host.study.folder import write_study
from impid_host.study.model import RobotLog, RobotSetup, Setup, Study, Trial
from scipy import signal
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
    truth = {
        fit.with_reflex[0]: 0.015,
        fit.with_reflex[1]: 0.8,
        fit.with_reflex[2]: 60.0,
        fit.gain[0]: 5.0,
        fit.gain[1]: 0.0,
        fit.delay_s: 0.05,
        fit.corner_rad_s: 2 * np.pi * 2.0,
    }
    for number, true in truth.items():
        # Of seven intervals one may just miss its truth.
        half = 0.5 * (number.high - number.low)
        assert abs(number.value - true) < 1.6 * half
    assert [own.value for own in fit.with_reflex] == pytest.approx((0.015, 0.8, 60.0), rel=0.02)
    assert fit.gain[0].value == pytest.approx(5.0, rel=0.1)
    assert fit.delay_s.value == pytest.approx(0.05, abs=0.003)
    assert fit.delay_s.high - fit.delay_s.low < 0.006
    assert fit.delay_determined
    assert fit.claimed
    assert fit.vaf_reflex > 99.5
    assert fit.vaf_intrinsic < fit.vaf_reflex - 0.5


def test_no_reflex_is_claimed_where_there_is_none() -> None:
    rng = np.random.default_rng(8)
    w, p = 2 * np.pi * rng.uniform(0.6, 8.0, 12), rng.uniform(0, 2 * np.pi, 12)
    t = np.arange(0, 24.0, 1 / RATE)
    angle = np.multiply.outer(t, w) + p
    theta = 0.01 * np.sin(angle).sum(axis=1)
    torque = 0.01 * ((60.0 - 0.015 * w**2) * np.sin(angle) + 0.8 * w * np.cos(angle)).sum(axis=1)
    p_values = [
        fit_reflex(theta, torque + np.random.default_rng(k).normal(0, 0.05, len(t)), RATE, fit_s=16.0).p_value
        for k in range(5)
    ]
    assert min(p_values) > 0.01


def test_a_short_record_is_refused() -> None:
    with pytest.raises(UndeterminedError, match="5 s on either side"):
        fit_reflex(np.zeros(4000), np.zeros(4000), RATE, fit_s=4.0)


def test_a_drift_that_the_angle_does_not_make_is_left_out() -> None:
    """A spring shaken by noise up to 10 Hz; beside it a torque up to 0.6 Hz, not the angle's making."""
    rng = np.random.default_rng(1)
    shake = signal.sosfilt(signal.butter(2, 10.0, fs=RATE, output="sos"), rng.normal(0, 1, int(60 * RATE)))
    torque = 60.0 * shake + rng.normal(0, 3.0, len(shake))
    assert followed_band(shake, torque, RATE).low_Hz < 0.3
    spectrum = np.fft.rfft(rng.normal(0, 1, len(shake)))
    slow = np.fft.irfft(spectrum * (np.fft.rfftfreq(len(shake), 1 / RATE) < 0.6), len(shake))
    band = followed_band(shake, torque + 20.0 * slow / slow.std(), RATE)
    assert 0.4 < band.low_Hz < 1.0


def test_the_command_fits_a_reflex(tmp_path: Path) -> None:
    theta, torque = joint(40.0)
    t = np.arange(len(theta)) / RATE
    setup = Setup(RobotSetup("joint-1d"))
    trial = Trial("ankle_01", "arm", "ankle", RobotLog(t, theta[:, None], torque[:, None]))
    write_study(Study("ankle", setup, (trial,)), tmp_path / "ankle")
    out = tmp_path / "out.json"
    arguments = ["fit", str(tmp_path / "ankle"), "--with", "load.delay", "--json", str(out)]
    result = CliRunner().invoke(cli, arguments, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    found = json.loads(out.read_text())["reflex"]["ankle_01"]
    assert found["with"]["delay_s"] == pytest.approx(0.05, abs=0.003)
    low, high = found["with"]["ci95"]["delay_s"]
    assert 0.03 < low < high < 0.08
    assert found["with"]["K"] == pytest.approx(60.0, rel=0.02)
    assert found["with"]["vaf"] > found["without"]["vaf"]
    free = Trial("free_01", "free", "free", RobotLog(t, theta[:, None], torque[:, None]))
    write_study(Study("free", setup, (free,)), tmp_path / "free")
    with pytest.raises(UndeterminedError, match="no arm trial"):
        CliRunner().invoke(
            cli, ["fit", str(tmp_path / "free"), "--with", "load.delay"], catch_exceptions=False
        )


@pytest.mark.measured
@pytest.mark.parametrize(("record", "goal"), [("z_df", 95.8), ("z_pf", 92.2), ("z_df2", 96.8)])
def test_measured_ankles(measured_data: Path, record: str, goal: float) -> None:
    columns = pq.read_table(measured_data / "ankle_impedance" / f"{record}.parquet")
    theta, torque = np.asarray(columns["position_rad"]), -np.asarray(columns["torque_Nm"])
    # Where the torque begins to follow the angle is asked of the fitted part alone.
    band = followed_band(theta[:40_000], torque[:40_000], 1000.0)
    assert band.low_Hz < 0.6
    fit = fit_reflex(theta, torque, 1000.0, fit_s=40.0, band=band)
    assert fit.vaf_reflex >= goal
    assert 0.013 < fit.with_reflex[0].value < 0.018  # a foot with its footplate
    assert 40 < fit.with_reflex[2].value < 120
    assert fit.claimed
