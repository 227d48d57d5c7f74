"""Periodic perturbations: recognised in the log, read on the robot's clock, distortion told from noise."""

import numpy as np
import pytest
from impid_host.design.force_multisine import design_force_multisines
from impid_host.impedance.periodic import PeriodicTrial, evaluate_periodic, period_rows
from scipy.interpolate import CubicSpline

FS = 500.0
PERIOD_S = 4.0
ROWS = round(PERIOD_S * FS)
D = (
    np.diag([1.4, 1.0]),
    np.array([[11.0, 3.0], [3.0, 6.0]]),
    np.array([[170.0, 30.0], [30.0, 110.0]]),
)


def stiffness(f):
    jw = 2j * np.pi * f[:, None, None]
    M, B, K = D
    return K + jw * B + jw**2 * M


def trials(cubic=0.0, noise_m=0.0, seed=0, clock=1.0):
    """The load answers exactly in its steady state; its force follows from its motion."""
    rng = np.random.default_rng(seed)
    design = design_force_multisines(4.0, realisations=3, period_s=PERIOD_S, periods=3)
    out = []
    for r in range(3):
        for e in range(2):
            command = design.command(r, e)
            f = np.fft.rfftfreq(len(command), 1 / FS)
            # a robot of 60 N/m and 5 N s/m, driven by the command, moves the load
            both = stiffness(f) + (60 + 2j * np.pi * f * 5)[:, None, None] * np.eye(2)
            d = np.linalg.solve(both, np.fft.rfft(command, axis=0)[:, :, None])[:, :, 0]
            x = np.fft.irfft(d, len(command), axis=0)
            F = np.fft.irfft(np.einsum("fij,fj->fi", stiffness(f), d), len(command), axis=0) + cubic * x**3
            log_t = 5.0 + np.arange(len(command)) / FS
            # the module's grid on the robot's clock: twice as dense, and a little off
            t = 5.0 + np.arange(2 * len(command) - 8) / (2 * FS) * clock + 1.3e-3
            F_t, x_t = (CubicSpline(log_t, s, axis=0)(t) for s in (F, x))
            out.append(
                PeriodicTrial(
                    t, F_t, x_t + noise_m * rng.standard_normal(x_t.shape), log_t, np.round(command, 5)
                )
            )
    return out


def test_the_period_is_found_and_noise_has_none():
    part = trials()[0]
    assert period_rows(part.command) == ROWS
    rng = np.random.default_rng(1)
    assert period_rows(rng.standard_normal((8000, 2))) is None
    slow = np.cumsum(rng.standard_normal((8000, 2)), axis=0)
    assert period_rows(slow) is None
    assert period_rows(None) is None
    assert period_rows(part.command[: ROWS + 100]) is None


def test_compliance_is_the_closed_form_although_the_clocks_differ():
    found = evaluate_periodic(trials(noise_m=2e-6, clock=1 + 6e-5), ROWS)
    assert found is not None
    assert found.period_s == pytest.approx(PERIOD_S)
    C = np.linalg.inv(stiffness(found.compliance.frequency_Hz))
    assert np.max(np.abs(found.compliance.G - C)) < 2e-3 * np.max(np.abs(C))
    assert found.compliance.p_value > 0.01
    for level in found.distortion:
        assert "no distortion" in level.verdict


def test_a_cubic_spring_shows_at_odd_lines_and_not_at_even_ones():
    found = evaluate_periodic(trials(cubic=3e4, noise_m=2e-6), ROWS)
    assert found is not None
    assert found.compliance.p_value < 1e-6
    for level in found.distortion:
        assert level.p_odd < 1e-6
        assert level.p_even > 0.01
        assert level.odd > 20 * level.noise
        assert "odd distortion" in level.verdict
        odd = level.kind == 1
        assert np.median(level.amplitude[odd]) > 5 * np.median(level.amplitude[level.kind == 2])


def test_what_makes_no_whole_realisations_is_left_alone():
    every = trials()
    assert evaluate_periodic(every[:3], ROWS) is None
    assert evaluate_periodic(every[:2], ROWS) is None
    # the same experiment twice cannot tell the axes apart
    assert evaluate_periodic([every[0], every[0], every[2], every[2]], ROWS) is None
