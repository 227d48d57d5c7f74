"""The whole path from raw counts and codes to impedance, against a robot that the test integrated."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.impedance.campaign import Options, StudyFit, fit_study
from impid_host.impedance.identify import RobotFit
from impid_host.signals.chain import DEFAULT, PUBLISHED
from impid_host.study.model import Study

from .plant import SETUP, Load, measure, simulate

ALPHA = np.array([0.06929, 0.04217, 0.04416, 0.06510, 0.07389])
M, KXX, KYY, KS = 0.786, 421.57, 213.35, -18.87
X0 = np.array([0.364, -0.009])


@pytest.fixture(scope="module")
def result(study: Study) -> StudyFit:
    return fit_study(study, Options())


def test_robot_parameters(result: StudyFit) -> None:
    assert isinstance(result.robot, RobotFit)
    estimate = result.robot.estimate
    assert np.abs(estimate.value / ALPHA - 1).max() < 0.02
    assert (result.robot.vaf > 98).all()
    inside = (estimate.ci95[:, 0] <= ALPHA) & (estimate.ci95[:, 1] >= ALPHA)
    assert inside.sum() >= 4
    assert estimate.sd[0] / ALPHA[0] < 0.005


@pytest.mark.parametrize("method", ["virtual sensor", "physical sensor"])
def test_mass_spring_load(result: StudyFit, method: str) -> None:
    fit = next(fit for fit in result.loads if fit.method == method)
    assert fit.M.value[0, 0] == pytest.approx(M, rel=0.03)
    assert fit.K.value == pytest.approx(np.array([[KXX, KS], [KS, KYY]]), rel=0.03, abs=0.03 * KYY)
    assert fit.x0.value == pytest.approx(X0, abs=0.5e-3)
    assert (fit.vaf > 98).all()
    K = np.array([[KXX, KS], [KS, KYY]])
    inside = (fit.K.ci95[..., 0] <= K) & (fit.K.ci95[..., 1] >= K)
    assert inside.sum() >= 3
    assert np.all(fit.K.ci95[..., 1] - fit.K.ci95[..., 0] < 0.06 * KXX)


def test_method_1_is_less_certain_than_method_2(result: StudyFit) -> None:
    # It carries the robot parameters' uncertainty as well.
    virtual, physical = result.loads
    assert virtual.estimate.sd[0] > physical.estimate.sd[0]


def test_clocks_of_every_trial(result: StudyFit) -> None:
    for index, trial in enumerate(result.trials):
        assert trial.clock is not None
        expected = 17.3 + 60 * index + (1 + 60e-6) * trial.clock.robot_ref_s
        assert trial.clock.device_ref_s == pytest.approx(expected, abs=1e-6)


def test_published_order_of_filtering_overestimates_alpha2(clean_study: Study) -> None:
    # docs/identification.md: 3.4 to 5.9 % on clean data; the default order is free of it.
    published = fit_study(clean_study, Options(chain=PUBLISHED)).robot
    default = fit_study(clean_study, Options(chain=DEFAULT)).robot
    assert isinstance(published, RobotFit)
    assert isinstance(default, RobotFit)
    high = 100 * (published.estimate["alpha2"] / ALPHA[1] - 1)
    assert 2.8 <= high <= 5.9  # how much depends on the motion; 3.2 with these two
    assert abs(100 * (default.estimate["alpha2"] / ALPHA[1] - 1)) < 0.1
    assert np.all(published.estimate.residual_rms > 8 * default.estimate.residual_rms)


def test_prior_stands_in_for_free_trials(study: Study) -> None:
    setup = type(study.setup)(
        robot=study.setup.robot,
        encoder=study.setup.encoder,
        accelerometer=study.setup.accelerometer,
        handle_mass_kg=0.0,
        prior_alpha=tuple(ALPHA),
    )
    loaded = Study("loaded", setup, study.of_kind("mass-spring"))
    result = fit_study(loaded, Options())
    assert result.loads[0].M.value[0, 0] == pytest.approx(M, rel=0.01)
    # Without a prior the force sensor still serves; without one, nothing does.
    sensed = fit_study(Study("loaded", study.setup, study.of_kind("mass-spring")), Options())
    assert [fit.method for fit in sensed.loads] == ["physical sensor"]
    assert sensed.loads[0].M.value[0, 0] == pytest.approx(M, rel=0.01)
    bare = tuple(replace(t, robot=replace(t.robot, force=None)) for t in study.of_kind("mass-spring"))
    with pytest.raises(UndeterminedError, match="free trial"):
        fit_study(Study("bare", study.setup, bare), Options())


def test_a_gap_is_left_out_and_said(study: Study) -> None:
    trial = study.trials[0]
    device = trial.device
    assert device is not None
    keep = np.ones(len(device), dtype=bool)
    keep[9000:9700] = False
    columns = {n: getattr(device, n) for n in device.__slots__}
    cut: dict[str, Any] = {n: None if own is None else own[keep] for n, own in columns.items()}
    holed = type(device)(**cut)
    damaged = type(trial)(trial.name, trial.kind, trial.load, trial.robot, holed)
    result = fit_study(Study("holed", study.setup, (damaged, study.trials[1])), Options())
    aligned = result.trials[0]
    hole = (aligned.t > device.t_us[9000] * 1e-6) & (aligned.t < device.t_us[9700] * 1e-6)
    assert not aligned.valid[hole].any()
    assert isinstance(result.robot, RobotFit)
    assert np.abs(result.robot.estimate.value / ALPHA - 1).max() < 0.02


def test_arm_with_its_handle_taken_off() -> None:
    # [D] Table V is of this size; full B and K, mass M + handle as the robot feels it.
    arm = Load(
        m=1.2 + 0.135,
        K=((90.0, 20.0), (12.0, 45.0)),
        x0=(0.37, 0.01),
        B=((14.0, 2.0), (1.0, 7.0)),
    )
    motions = {
        "free_01": simulate(31, 26.0),
        "arm_01": simulate(32, 26.0, load=arm, span_deg=10.0),
        "arm_02": simulate(33, 26.0, load=arm, span_deg=10.0),
    }
    trials = [
        measure(motion, name, "free" if motion.load is None else "arm", 26.0, seed=index)
        for index, (name, motion) in enumerate(motions.items())
    ]
    fits = fit_study(Study("arm", SETUP, tuple(trials)), Options()).loads
    assert [fit.method for fit in fits] == ["virtual sensor", "physical sensor"]
    for fit in fits:
        assert fit.B is not None
        assert fit.M.value == pytest.approx(1.2 * np.eye(2), abs=0.04)
        assert fit.B.value == pytest.approx(np.array(arm.B), abs=0.4)
        assert fit.K.value == pytest.approx(np.array(arm.K), abs=3.0)
        assert fit.x0.value == pytest.approx(np.array(arm.x0), abs=1.5e-3)
        assert (fit.vaf > 98).all()
        truths = ((fit.M, 1.2 * np.eye(2)), (fit.B, np.array(arm.B)), (fit.K, np.array(arm.K)))
        for quantity, true in truths:
            half = 0.5 * np.ptp(quantity.ci95, axis=-1)
            assert np.all(np.abs(quantity.value - true) < 2 * half)  # four standard errors
