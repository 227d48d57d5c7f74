"""The textbook's model finds the dry friction and the offset that the papers' model lacks."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from impid_host.diagnosis.textbook import textbook_fit
from impid_host.impedance.campaign import Options, StudyFit, fit_study
from impid_host.impedance.identify import RobotFit
from impid_host.study.model import Study

from .machines import Case, build, on_joint

COULOMB_N, OFFSET_N = 3.0, 5.0


def slide(folder: Path, **changes: object) -> Study:
    """12 kg and 30 N s/m on a rail, with dry friction and an offset."""
    plain = Case("slide-1d", seed=12, free=1, loaded=1, device=False, seconds=20.0)
    case = replace(
        plain,
        torque=[on_joint(0, lambda _q, w: COULOMB_N * np.sign(w) + OFFSET_N)],
        **changes,  # type: ignore[arg-type]
    )
    return build(case, folder)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, StudyFit]:
    study = slide(tmp_path_factory.mktemp("slide"))
    return study, fit_study(study, Options())


def test_friction_and_offset_are_found_with_the_mass(made: tuple[Study, StudyFit]) -> None:
    study, fit = made
    found = textbook_fit(study, fit, Options())
    assert found is not None
    assert isinstance(found.robot, RobotFit)
    truth = np.array([12.0, 30.0, COULOMB_N, OFFSET_N])
    value, sd = found.robot.estimate.value, found.robot.estimate.sd
    assert len(value) == 4
    # The log is rounded and the filters see a step: half a per cent of the mass beside the noise.
    assert np.all(np.abs(value - truth) < 4 * sd + 0.005 * truth)
    # The papers' model puts the friction into the damping.
    assert isinstance(fit.robot, RobotFit)
    assert abs(fit.robot.estimate.value[1] - 30.0) > 4.0


def test_a_robot_that_was_given_is_nobodys_model(tmp_path: Path) -> None:
    study = slide(tmp_path, free=0, prior=True)
    fit = fit_study(study, Options())
    assert textbook_fit(study, fit, Options()) is fit


def test_data_that_do_not_determine_it_have_no_textbook(made: tuple[Study, StudyFit]) -> None:
    study, fit = made
    lost = tuple(replace(trial, valid=np.zeros_like(trial.valid)) for trial in fit.trials)
    assert textbook_fit(study, replace(fit, trials=lost), Options()) is None
