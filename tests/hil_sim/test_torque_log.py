"""The robot's log and the noise on it, against closed forms."""

import numpy as np
import pytest
from scipy.signal import welch

from hil_sim.plant.plant import Motion
from hil_sim.sensors.clock import Clock
from hil_sim.sensors.encoder import EncoderTruth
from hil_sim.sensors.force_sensor import ForceSensor, ForceSensorTruth
from hil_sim.sensors.noise import Noise, NoiseTruth
from hil_sim.sensors.torque_log import LogTruth, TorqueLog, joined

ENCODER = EncoderTruth(counts_per_rev=(4000, 4000), zero_rad=(0.0, 0.0), direction=(1, 1))


def motion(torque):
    """So many ticks in which the force on axis x is the time in ticks, and on y nothing."""
    n = len(torque)
    force = np.stack([(np.arange(8 * n) + 0.5) / 8.0, np.zeros(8 * n)], axis=1)
    fine = np.zeros((8 * n, 2))
    count = np.zeros((n, 2), dtype=np.int32)
    return Motion(fine, fine, fine, force, fine, count, np.asarray(torque, dtype=float))


def logged(truth, torque, blocks=None):
    """All rows of a log of this torque, handed over in these blocks."""
    n = len(torque)
    sensor = ForceSensor(ForceSensorTruth(noise=()), 1000.0, np.random.default_rng(1))
    log = TorqueLog(
        truth,
        zero_s=2.0,
        tick_s=1e-3,
        ticks=n - 100,
        encoder=ENCODER,
        force_sensor=sensor,
        generators=(np.random.default_rng(2), np.random.default_rng(3)),
    )
    whole, at, rows = motion(torque), 0, []
    for size in blocks or [n]:
        fine = slice(8 * at, 8 * (at + size))
        part = Motion(
            whole.q[fine],
            whole.w[fine],
            whole.acceleration[fine],
            whole.force[fine],
            whole.crept[fine],
            whole.count[at : at + size],
            whole.torque[at : at + size],
        )
        if not log.complete:
            rows.append(log.add(part, np.zeros((size, 2))))
        at += size
    assert log.complete
    return joined(rows)


def ramp(n=1100):
    """Torque held in tick i: i + 0.5, the mean of a ramp; and its half."""
    held = np.arange(n) + 0.5
    return np.stack([held, 0.5 * held], axis=1)


@pytest.mark.parametrize("delay_ms", [0.0, 3.0, 2.5, -4.0, -1.25])
def test_a_late_log_shows_the_torque_of_so_long_ago(delay_ms):
    """The mean of a ramp over any period is the ramp at its centre; a staircase of 1 ms errs by an eighth."""
    rows = logged(LogTruth(delay_s=(1e-3 * delay_ms, 0.0)), ramp())
    ticks = np.arange(1000)
    assert rows.tau_Nm[10:, 0] == pytest.approx(ticks[10:] - delay_ms, abs=0.126)
    if delay_ms == round(delay_ms):
        assert rows.tau_Nm[10:, 0] == pytest.approx(ticks[10:] - delay_ms, abs=1e-9)
    assert rows.tau_Nm[10:, 1] == pytest.approx(0.5 * ticks[10:], abs=1e-9)


def test_rows_of_two_ticks_are_means_over_two_ticks():
    rows = logged(LogTruth(every_ticks=2), ramp())
    assert rows.t_s == pytest.approx(2.0 + 2e-3 * np.arange(500))
    assert rows.tau_Nm[5:, 0] == pytest.approx(2.0 * np.arange(5, 500))
    assert rows.force_N[5:, 0] == pytest.approx(2.0 * np.arange(5, 500))


def test_rows_do_not_depend_on_how_time_is_divided():
    truth = LogTruth(
        delay_s=(0.0033, -0.002),
        noise=(NoiseTruth("pink", (0.1, 0.1)), NoiseTruth("white", (0.1, 0.1))),
        jitter_s=1e-4,
        gap_every_s=0.1,
        gap_rows=3,
        stuck_every_s=0.1,
        stuck_s=0.01,
    )
    whole, parts = logged(truth, ramp()), logged(truth, ramp(), [1, 7, 92, 500, 333, 167])
    for name in ("t_s", "theta_rad", "force_N"):
        assert np.array_equal(getattr(whole, name), getattr(parts, name))
    # Sums of the staircase may round in another order.
    assert whole.tau_Nm == pytest.approx(parts.tau_Nm, abs=1e-9)


def test_gaps_jitter_and_a_late_start_have_their_size():
    n = 200_100
    torque = np.zeros((n, 2))
    rows = logged(LogTruth(gap_every_s=1.0, gap_rows=5, late_start_s=0.5), torque)
    steps = np.round(1e3 * np.diff(rows.t_s)).astype(int)
    assert rows.t_s[0] == pytest.approx(2.5, abs=0.006)
    # Two gaps may touch; that they are 200 within chance is three deviations of a Poisson number.
    assert abs((steps[steps > 1] // 5).sum() - 200) < 3 * np.sqrt(200)
    assert set(np.unique(steps)) <= {1, 6, 11, 16}
    late = logged(LogTruth(jitter_s=2e-5), torque).t_s - 2.0 - 1e-3 * np.arange(n - 100)
    assert late.min() >= -1e-9
    assert np.sqrt(np.mean(late**2)) == pytest.approx(2e-5, rel=0.01)


def test_quantised_and_clipped_torque():
    rows = logged(LogTruth(quantum_Nm=(0.3, 0.0), limit_Nm=(np.inf, 100.0)), ramp())
    assert rows.tau_Nm[:, 0] / 0.3 == pytest.approx(np.round(rows.tau_Nm[:, 0] / 0.3), abs=1e-9)
    assert abs(rows.tau_Nm[10:, 0] - np.arange(10, 1000)).max() <= 0.15 + 1e-9
    assert rows.tau_Nm[:, 1].max() == 100.0
    assert rows.tau_Nm[100, 1] == pytest.approx(50.0)


def test_a_stuck_log_repeats_its_last_value():
    """50 ms every 500 ms on the mean (counted from the end of the last): one row in eleven repeats."""
    rows = logged(LogTruth(stuck_every_s=0.5, stuck_s=0.05), ramp(100_100))
    same = np.all(np.diff(rows.tau_Nm, axis=0) == 0.0, axis=1)
    assert same.mean() == pytest.approx(50 / 550, rel=0.2)


@pytest.mark.parametrize("kind", ["white", "ar", "pink"])
def test_noise_has_its_rms_and_its_colour(kind):
    noise = Noise(NoiseTruth(kind, (0.5, 2.0), corner_Hz=5.0), 1000.0, np.random.default_rng(8))
    values = noise.add_to(np.zeros((2_000_000, 2)))
    # Pink noise has few independent values at its lowest frequencies.
    assert values.std(axis=0) == pytest.approx([0.5, 2.0], rel=0.05 if kind == "pink" else 0.01)
    f, density = welch(values[:, 1], fs=1000.0, nperseg=65536)

    def level(low, high):
        return density[(f > low) & (f < high)].mean()

    if kind == "white":
        assert level(1, 5) / level(300, 400) == pytest.approx(1.0, rel=0.1)
        assert level(10, 490) == pytest.approx(2.0**2 / 500.0, rel=0.02)
    if kind == "ar":
        # 1 / (1 + (f / 5)^2) far below the Nyquist frequency.
        assert level(4.8, 5.2) / level(0.05, 0.5) == pytest.approx(0.5, rel=0.1)
        assert level(49, 51) / level(0.05, 0.5) == pytest.approx(1 / 101, rel=0.1)
    if kind == "pink":
        for low in (0.3, 3.0, 30.0):
            assert level(low, 1.2 * low) / level(5 * low, 6 * low) == pytest.approx(5.0, rel=0.2)


def test_heteroscedastic_noise_grows_with_the_quantity():
    noise = Noise(NoiseTruth("heteroscedastic", (0.1, 0.1)), 1000.0, np.random.default_rng(8))
    values = noise.add_to(np.tile([1.0, -20.0], (100_000, 1)))
    assert values.std(axis=0) == pytest.approx([0.1, 2.0], rel=0.02)


def test_a_drives_noise_may_grow_with_the_speed():
    """A joint that turns at -3 rad/s in the second half of each 1000 ticks, and rests in the first."""
    log = TorqueLog(
        LogTruth(noise=(NoiseTruth("speed", (0.1, 0.2)),)),
        zero_s=0.0,
        tick_s=1e-3,
        ticks=100_000,
        encoder=ENCODER,
        force_sensor=None,
        generators=(np.random.default_rng(2), np.random.default_rng(3)),
    )
    rests = motion(np.zeros((1000, 2)))
    rests.w[4000:] = -3.0
    rows = joined([log.add(rests, np.zeros((1000, 2))) for _ in range(101)])
    halves = rows.tau_Nm.reshape(-1, 2, 500, 2)
    assert not halves[:, 0].any()
    assert halves[:, 1].reshape(-1, 2).std(axis=0) == pytest.approx([0.3, 0.6], rel=0.02)


def test_force_sensor_gain_offset_and_steps():
    truth = ForceSensorTruth(noise=(), offset_N=(0.5, -0.5), gain_error=(0.02, 0.0), quantum_N=0.25)
    read = ForceSensor(truth, 1000.0, np.random.default_rng(1)).read(np.array([[10.0, 10.0]]), np.zeros(1))
    assert read[0] == pytest.approx([10.75, 9.5])


def test_an_eccentric_disc_errs_once_per_turn_and_knows_its_inverse():
    encoder = EncoderTruth((400000, 400000), (0.0, 0.0), (1, 1), (0.02, 0.0), (0.5, 0.0), (0.0, 0.01))
    q = np.stack([np.linspace(0.0, 2 * np.pi, 1001)] * 2, axis=1)
    error = encoder.angle(encoder.count(q)) - q
    assert error[:, 0] == pytest.approx(0.02 * np.sin(q[:, 0] + 0.5), abs=1e-5)
    assert error[:, 1] == pytest.approx(0.01, abs=1e-5)
    assert encoder.reading(encoder.place_of(np.array([0.8, 0.3]))) == pytest.approx([0.8, 0.3], abs=1e-12)


def test_a_drifting_clock_is_ahead_by_a_legendre_polynomial():
    clock = Clock(0.0, 10.0, drift_s=(0.004, 0.001), span_s=50.0)
    u = np.array([-1.0, 0.0, 0.5, 1.0])
    expected = 0.004 * (3 * u**2 - 1) / 2 + 0.001 * (5 * u**3 - 3 * u) / 2
    assert clock.ahead(25.0 * (u + 1.0)) == pytest.approx(expected, abs=1e-15)


def test_a_clock_that_follows_the_temperature_swings_in_rate():
    clock = Clock(0.0, 0.0, wander_ppm=3.0, wander_period_s=200.0)
    t = np.linspace(0.0, 400.0, 40_001)
    assert np.gradient(clock.ahead(t), t).max() == pytest.approx(3e-6, rel=1e-4)
