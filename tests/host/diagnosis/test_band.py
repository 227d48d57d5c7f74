"""One band for all commands: by the motion, as `fit` has it, or as it was asked for."""

from pathlib import Path

import pytest
from impid_host.diagnosis.case import prepare
from impid_host.diagnosis.holdout import FIFTH, FIT, SEALED, THIRD
from impid_host.diagnosis.prepare import views
from impid_host.errors import UndeterminedError
from impid_host.impedance.campaign import default_chain
from impid_host.robot.model import robot_model

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
