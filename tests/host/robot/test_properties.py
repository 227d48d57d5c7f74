"""What code may ask of any robot model, whatever its name."""

import numpy as np
import pytest
from impid_host.robot.joint_1d import Joint1D
from impid_host.robot.model import ROBOTS, RobotModel, robot_model, torque_at_load
from impid_host.robot.planar_2r_absolute import Planar2RAbsolute
from impid_host.robot.planar_2r_relative import Planar2RRelative
from impid_host.robot.slide_1d import Slide1D
from impid_host.study.model import RobotSetup

L1, L2 = 0.254, 0.2667
LEVEL: list[RobotModel] = [Planar2RAbsolute(L1, L2), Planar2RRelative(L1, L2), Slide1D(), Joint1D()]


@pytest.mark.parametrize("name", [name for name, kind in ROBOTS.items() if not kind.described])
def test_table_agrees_with_the_models(name: str) -> None:
    kind = ROBOTS[name]
    model = robot_model(RobotSetup(name, (L1, L2)[: kind.link_lengths]))
    assert model.name == name
    assert model.joints == kind.joints == len(model.prismatic)
    assert all(model.prismatic) == kind.slides
    assert model.task_is_rotary == (tuple(model.task_axes) == ("theta",))


@pytest.mark.parametrize("model", LEVEL, ids=lambda model: model.name)
def test_gravity_regressor_is_the_slope_of_a_potential(model: RobotModel) -> None:
    """A force that comes of a potential has a symmetric slope: d tau_i / d theta_j = d tau_j / d theta_i."""
    theta = np.random.default_rng(3).uniform(-2, 2, (40, model.joints))
    Y = model.gravity_regressor(theta)
    assert Y.shape == (40, model.joints, len(model.gravity_parameters))
    step = 1e-6
    slope = np.stack(
        [
            (model.gravity_regressor(theta + shift) - model.gravity_regressor(theta - shift)) / (2 * step)
            for shift in np.eye(model.joints) * step
        ],
        axis=2,
    )
    assert slope == pytest.approx(np.swapaxes(slope, 1, 2), abs=1e-8)


def test_gravity_regressor_spans_the_arm_that_declares_its_gravity() -> None:
    theta = np.random.default_rng(4).uniform(-2, 2, (60, 2))
    still = np.zeros_like(theta)
    declared = Planar2RRelative(L1, L2, (3.0, -9.0))
    assert declared.has_gravity
    assert declared.gravity_parameters == ()
    target = declared.regressor(theta, still, still).reshape(120, -1)
    columns = Planar2RRelative(L1, L2).gravity_regressor(theta).reshape(120, -1)
    coefficients = np.linalg.lstsq(columns, target, rcond=None)[0]
    assert columns @ coefficients == pytest.approx(target, abs=1e-10)
    assert np.linalg.matrix_rank(target) == np.linalg.matrix_rank(columns) == 4


def test_torque_is_the_loads_own_only_where_no_free_trial_shows_a_machine() -> None:
    assert torque_at_load(Joint1D(), ["arm", "arm"])
    assert not torque_at_load(Joint1D(), ["free"])
    assert not torque_at_load(Joint1D(), ["free", "arm"])
    assert not torque_at_load(Slide1D(), ["mass-spring"])
