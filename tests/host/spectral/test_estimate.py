import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.impedance.spectral.estimate import TrialSignals, estimate_spectral
from impid_host.impedance.spectral.second_order import second_order_impedance
from impid_host.impedance.spectral.welch import FINE, SMOOTH

ROBOT = {"M": np.array([[1.0, 0.15], [0.15, 1.3]]), "B": 2.0 * np.eye(2), "K": 40.0 * np.eye(2)}


def _trial(truth, rng, *, voluntary=0.0, force_noise=0.0, samples=25000):
    """A held robot shaking an arm, in closed form; the hand itself pushes with rms `voluntary` N."""
    arm = truth.arm

    def load(w):
        return truth.dynamic_stiffness(w, arm.M, arm.B, arm.K)

    def both(w):
        return np.linalg.inv(load(w) + truth.dynamic_stiffness(w, **ROBOT))

    perturbation = truth.coloured(rng, samples, 2)
    own = voluntary * truth.coloured(rng, samples, 2, cutoff_Hz=3.0, rms=1.0)
    d = truth.respond(both, perturbation + own)
    # force of the robot on the arm: what the load needs, less what the hand adds itself
    F = truth.respond(lambda w: load(w) @ both(w), perturbation + own) - own
    return TrialSignals(F + force_noise * rng.standard_normal(F.shape), d, perturbation)


def _parameters(fit):
    return np.concatenate([fit.M.ravel(), fit.B.ravel(), fit.K.ravel()])


def _deviations(fit):
    return np.concatenate([fit.M_sd.ravel(), fit.B_sd.ravel(), fit.K_sd.ravel()])


def _true(truth):
    return np.concatenate([truth.arm.M.ravel(), truth.arm.B.ravel(), truth.arm.K.ravel()])


def test_a_quiet_arm_is_found_by_both_estimates_and_settings(truth):
    trials = [_trial(truth, np.random.default_rng(s)) for s in range(3)]
    for setting in (FINE, SMOOTH):
        result = estimate_spectral(trials, truth.FS, setting, surrogates=0)
        assert result.segments == 3 * setting.segments(25000)
        for response in (result.direct, result.derived):
            np.testing.assert_allclose(response.fit.M, truth.arm.M, atol=0.03)
            np.testing.assert_allclose(response.fit.B, truth.arm.B, atol=0.7)
            np.testing.assert_allclose(response.fit.K, truth.arm.K, atol=6.0)
            assert np.median(response.multiple_coherence[result.band]) > 0.99
            assert response.agreement[1].r_squared > 0.99


def test_voluntary_movement_biases_the_direct_estimate_and_not_the_derived_one(truth):
    """The hold loop turns the subject's own force into F and d alike; only the perturbation is free of it."""
    rng = np.random.default_rng(7)
    trials = [_trial(truth, rng, voluntary=2.0) for _ in range(24)]
    result = estimate_spectral(trials, truth.FS, SMOOTH, surrogates=20)
    true = _true(truth)
    sd = _deviations(result.derived.fit)
    # seen without a force of its own the hand would look like minus the robot: less stiff, less heavy
    direct, derived = _parameters(result.direct.fit), _parameters(result.derived.fit)
    diagonal = [0, 3, 8, 11]
    assert np.all(np.abs(derived - true)[diagonal] < 4 * sd[diagonal])
    assert np.max(np.abs(direct - true) / sd) > 8
    assert np.linalg.norm((derived - true) / sd) < 0.3 * np.linalg.norm((direct - true) / sd)


def test_stated_deviations_are_the_scatter_between_trials(truth):
    rng = np.random.default_rng(8)
    fits = [
        estimate_spectral([_trial(truth, rng, voluntary=1.0)], truth.FS, SMOOTH, surrogates=10).derived.fit
        for _ in range(30)
    ]
    scatter = np.std([_parameters(fit) for fit in fits], axis=0, ddof=1)
    stated = np.sqrt(np.mean([_deviations(fit) ** 2 for fit in fits], axis=0))
    # 30 trials know each scatter to 13 %; the mean over the twelve parameters much better
    # Ten surrogates: Student's t with nine degrees of freedom, and the mean of ten.
    ratio = stated / scatter / (2.262 / 1.96 * np.sqrt(1.1))
    assert np.all(ratio > 0.6)
    assert np.all(ratio < 1.6)
    assert np.exp(np.mean(np.log(ratio))) == pytest.approx(1.0, abs=0.15)


def test_the_published_fit_s_intervals_take_its_bias_into_account(truth):
    """Where Z_xy passes zero its gain in dB errs upwards, and the short window smears the resonance."""
    rng = np.random.default_rng(14)
    plain, mended = [], []
    for _ in range(12):
        trials = [_trial(truth, rng, voluntary=0.5) for _ in range(3)]
        fit = estimate_spectral(trials, truth.FS, SMOOTH, surrogates=20).derived.fit
        plain.append((_parameters(fit) - _true(truth)) / _deviations(fit))
        mended.append((_parameters(fit) - fit.bias.ravel() - _true(truth)) / _deviations(fit))
        centre = np.concatenate([fit.ci95(name).mean(axis=2).ravel() for name in "MBK"])
        np.testing.assert_allclose(centre, _parameters(fit) - fit.bias.ravel(), rtol=1e-12)
    assert np.max(np.abs(np.mean(plain, axis=0))) > 1.0
    # means of twelve: each stays below 3.5 standard errors
    assert np.max(np.abs(np.mean(mended, axis=0))) < 3.5 / np.sqrt(12)
    assert np.sqrt(np.mean(np.square(mended))) == pytest.approx(1.0, abs=0.25)


def test_virtual_force_correlates_with_position_noise_and_only_the_derived_estimate_withstands(truth):
    """F from the robot's own motion: F = F_c - robot(d_measured), so noise on d is noise on F as well."""
    arm = truth.arm
    rng = np.random.default_rng(15)

    def robot(w):
        return truth.dynamic_stiffness(w, **ROBOT)

    trials = []
    for _ in range(6):
        perturbation = truth.coloured(rng, 25000, 2)
        d = truth.respond(
            lambda w: np.linalg.inv(truth.dynamic_stiffness(w, arm.M, arm.B, arm.K) + robot(w)), perturbation
        )
        measured = d + truth.coloured(rng, 25000, 2, cutoff_Hz=20.0, rms=0.0003)
        trials.append(TrialSignals(perturbation - truth.respond(robot, measured), measured, perturbation))
    result = estimate_spectral(trials, truth.FS, FINE)
    fit = result.derived.fit
    true, sd = _true(truth), _deviations(fit)
    direct, derived = _parameters(result.direct.fit), _parameters(fit) - fit.bias.ravel()
    assert np.sqrt(np.mean(((derived - true) / sd) ** 2)) < 1.8
    assert np.sqrt(np.mean(((direct - true) / sd) ** 2)) > 5


def test_coherence_of_the_direct_estimate_falls_with_sensor_noise_as_the_closed_form_says(truth):
    rng = np.random.default_rng(9)
    noise = 0.001
    F = truth.coloured(rng, 100_000, 1)
    k, b, m = 300.0, 8.0, 1.0
    d = truth.respond(lambda w: 1 / (k + 1j * w * b - w**2 * m)[:, None, None], F)
    result = estimate_spectral(
        [TrialSignals(F, d + noise * rng.standard_normal(d.shape))], truth.FS, SMOOTH, surrogates=0
    )
    frequency = result.frequency_Hz
    band = (frequency > 6) & (frequency < 12)
    # F is 3 N rms of 4th-order Butterworth noise at 15 Hz; its density is flat below 12 Hz
    power = 9 / (15 * np.pi / 8 / np.sin(np.pi / 8)) / (1 + (frequency[band] / 15) ** 8)
    C2 = 1 / ((k - (2 * np.pi * frequency[band]) ** 2 * m) ** 2 + (2 * np.pi * frequency[band] * b) ** 2)
    expected = C2 * power / (C2 * power + noise**2 / 250)
    assert np.mean(expected) < 0.98
    np.testing.assert_allclose(np.mean(result.direct.multiple_coherence[band]), np.mean(expected), atol=0.02)


def test_agreement_can_be_with_a_model_known_beforehand(truth):
    trial = _trial(truth, np.random.default_rng(10))
    arm = truth.arm
    good = estimate_spectral([trial], truth.FS, FINE, expected=(arm.M, arm.B, arm.K), surrogates=0)
    bad = estimate_spectral([trial], truth.FS, FINE, expected=(arm.M, arm.B, 2 * arm.K), surrogates=0)
    assert good.best.agreement[0].r_squared > bad.best.agreement[0].r_squared
    assert [a.upper_Hz for a in good.best.agreement] == [5.0, 10.0]


def test_one_joint_and_three_axes_pass_through_the_same_code(truth):
    rng = np.random.default_rng(11)
    for n in (1, 3):
        F = truth.coloured(rng, 25000, n)
        M, B, K = np.eye(n) + 0.1, 9 * np.eye(n) + 1, 200 * np.eye(n) + 20
        d = truth.respond(lambda w, M=M, B=B, K=K: np.linalg.inv(truth.dynamic_stiffness(w, M, B, K)), F)
        fit = estimate_spectral([TrialSignals(F, d)], truth.FS, SMOOTH, surrogates=0).direct.fit
        np.testing.assert_allclose(fit.K, K, atol=12)
        np.testing.assert_allclose(fit.M, M, atol=0.05)


def test_the_result_prints_both_estimates_and_every_check(truth):
    trials = [_trial(truth, np.random.default_rng(s)) for s in range(2)]
    text = str(estimate_spectral(trials, truth.FS, SMOOTH))
    for part in (
        "direct estimate",
        "derived estimate",
        "VAF",
        "stationarity:",
        "normality:",
        "repeatability:",
    ):
        assert part in text


def test_without_the_perturbation_there_is_no_derived_estimate(truth):
    trial = _trial(truth, np.random.default_rng(12))
    result = estimate_spectral(
        [TrialSignals(trial.force, trial.displacement)], truth.FS, SMOOTH, surrogates=0
    )
    assert result.derived is None
    assert result.best is result.direct


def test_what_cannot_be_evaluated_is_refused(truth):
    with pytest.raises(UndeterminedError, match="no stochastic trials"):
        estimate_spectral([], truth.FS)
    with pytest.raises(ValueError, match="must agree"):
        TrialSignals(np.zeros((10, 2)), np.zeros((9, 2)))
    broken = np.ones((10, 2))
    broken[3, 1] = np.nan
    with pytest.raises(UndeterminedError, match="missing samples"):
        TrialSignals(np.ones((10, 2)), broken)
    F = truth.coloured(np.random.default_rng(1), 25000, 1)
    same = np.concatenate([F, F], axis=1)
    with pytest.raises(UndeterminedError, match="linearly dependent"):
        estimate_spectral([TrialSignals(same, same)], truth.FS)


def test_fitted_model_is_what_the_agreement_uses(truth):
    result = estimate_spectral([_trial(truth, np.random.default_rng(13))], truth.FS, SMOOTH, surrogates=0)
    fit = result.derived.fit
    frequency = result.frequency_Hz[result.band]
    np.testing.assert_allclose(
        fit.impedance(frequency), second_order_impedance(frequency, fit.M, fit.B, fit.K)
    )
