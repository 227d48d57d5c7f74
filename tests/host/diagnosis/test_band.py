"""One band for all commands: by the motion, as `fit` has it, or as it was asked for."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from impid_host.diagnosis.band import band_hz, quick_band_hz
from impid_host.diagnosis.case import prepare
from impid_host.diagnosis.holdout import FIFTH, FIT, SEALED, THIRD, Holdout
from impid_host.diagnosis.prepare import views
from impid_host.effects.view import View
from impid_host.errors import UndeterminedError
from impid_host.impedance.campaign import default_chain
from impid_host.robot.model import robot_model

from ..effects.apparatus import apparatus
from .machines import Case, build


@pytest.mark.parametrize("model", ["joint-1d", "planar-2r-relative", "slide-1d"])
def test_a_quick_motion_is_judged_in_its_own_band(model: str, tmp_path: Path) -> None:
    """Sinusoids up to 6 Hz: a filter at 4.5 Hz would leave the torque without what moves it."""
    study = build(Case(model, seed=160, free=1, loaded=0, quick=3.0, seconds=15.0, device=False), tmp_path)
    robot = robot_model(study.setup.robot)
    (view,), _ = views(study, robot)
    assert view.report_hz == default_chain(study).cutoff_hz
    assert 8.0 < view.report_hz <= 12.5
    assert view.cutoff_hz >= view.report_hz
    (view,), _ = views(study, robot, 20.0)
    assert (view.report_hz, view.cutoff_hz >= 20.0) == (20.0, True)


def test_a_band_that_the_logs_do_not_show_is_refused_by_name(tmp_path: Path) -> None:
    study = build(Case("joint-1d", seed=163, free=1, loaded=0, seconds=15.0, device=False), tmp_path)
    with pytest.raises(UndeterminedError, match="nothing above 100 Hz; give a lower --cutoff"):
        views(study, robot_model(study.setup.robot), 150.0)


def test_the_papers_motion_is_judged_in_the_papers_band(tmp_path: Path) -> None:
    study = build(Case(seed=161, free=1, loaded=0, seconds=15.0, device=False), tmp_path)
    (view,), _ = views(study, robot_model(study.setup.robot))
    assert view.report_hz == 4.5


def test_a_short_record_seals_as_little_as_fit_does(tmp_path: Path) -> None:
    """Of 7 s two thirds leave fewer than 27 instants of two joints, without the edges of the filter."""
    for seconds, last in ((7.0, FIFTH), (25.0, THIRD)):
        study = build(Case(seed=162, free=1, loaded=0, seconds=seconds, device=False), tmp_path)
        case = prepare(study)
        assert case.holdout.last == last
        (view,) = case.views
        begin = (1 - last) * view.t[-1]
        assert view.t[case.holdout.mask(view, SEALED)].min() == pytest.approx(begin, abs=0.01)
        # The filter at 4.5 Hz remembers a second.
        assert view.t[case.holdout.mask(view, FIT)].max() == pytest.approx(begin - 1.0, abs=0.01)


RATE_HZ = 250.0
INERTIA = 0.05


def counted(step_rad: float, torque_nm: float, seed: int = 0) -> View:
    """One joint of known inertia, its angle off by a counter's uniform error, its torque by white noise."""
    rng = np.random.default_rng([21, seed])
    t = np.arange(0, 120, 1 / RATE_HZ)
    w, p = 2 * np.pi * np.array([[0.4], [1.1]]), np.array([[0.2], [1.7]])
    theta, acc = np.sin(w * t + p).sum(0), -(w**2 * np.sin(w * t + p)).sum(0)
    error = rng.uniform(-0.5 * step_rad, 0.5 * step_rad, len(t))
    # As the views have it: low-passed, here above 50 Hz at once.
    frequency = np.fft.rfftfreq(len(t), 1 / RATE_HZ)
    spectrum = np.where(frequency < 50.0, np.fft.rfft(error), 0.0)
    wrong = np.fft.irfft(spectrum * (2j * np.pi * frequency) ** 2, len(t))
    plain = next(v for v in apparatus("one joint").views if v.load is None)
    tau = INERTIA * acc + torque_nm * rng.standard_normal(len(t))
    return replace(
        plain,
        t=t,
        dt=1 / RATE_HZ,
        theta=(theta + error)[:, None],
        omega=np.zeros((len(t), 1)),
        acc=(acc + wrong)[:, None],
        tau=tau[:, None],
        valid=np.ones(len(t), dtype=bool),
    )


def everything(*views: View) -> Holdout:
    return Holdout(tuple(view.name for view in views), ())


@pytest.mark.parametrize(("step_rad", "torque_nm"), [(2e-5, 2e-3), (2e-5, 4e-3), (1e-4, 1.2e-2)])
def test_the_band_ends_where_the_counters_noise_is_a_twentieth_of_the_torques(
    step_rad: float, torque_nm: float
) -> None:
    """Densities are variances over half the rate: I^2 (2 pi f)^4 step^2 / 12 = 0.05 sd^2."""
    truth = (0.05 * torque_nm**2 / (INERTIA**2 * step_rad**2 / 12)) ** 0.25 / (2 * np.pi)
    assert 5.0 < truth < 11.0
    view = counted(step_rad, torque_nm)
    assert band_hz([view], everything(view)) == pytest.approx(truth, rel=0.03)


def test_fine_and_coarse_counters_stop_at_the_bands_ends() -> None:
    fine, coarse = counted(1e-6, 2e-3), counted(3e-3, 2e-3)
    assert band_hz([fine], everything(fine)) == 11.0
    assert band_hz([coarse], everything(coarse)) == 5.0
    assert band_hz([fine, coarse], everything(fine)) == 5.0
    assert band_hz([], everything()) == 11.0


@pytest.mark.parametrize(("share", "end_hz"), [(0.01, 20.0), (1e-4, 14.0)])
def test_a_shaken_joints_band_is_where_its_speed_ends(share: float, end_hz: float) -> None:
    """Power at 14 Hz and a share of it at 20 Hz: 99.9 % of it reach to the one or the other."""
    plain = counted(1e-6, 2e-3)
    fast = np.sin(2 * np.pi * 14 * plain.t) + np.sqrt(share) * np.sin(2 * np.pi * 20 * plain.t)
    view = replace(plain, omega=fast[:, None])
    # Lines of a spectrum of 1024 rows are a quarter of a hertz wide, and a window spreads them by one or two.
    assert quick_band_hz([view], everything(view)) == pytest.approx(end_hz, abs=0.75)


def test_a_shaken_joints_band_is_neither_narrower_nor_wider_than_a_joint_can_be() -> None:
    plain = counted(1e-6, 2e-3)
    for frequency, end in ((3.0, 11.0), (70.0, 40.0)):
        view = replace(plain, omega=np.sin(2 * np.pi * frequency * plain.t)[:, None])
        assert quick_band_hz([view], everything(view)) == end
