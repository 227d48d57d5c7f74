"""Measured arms through the shipped mappings: published figures, other records of the same machine."""

from pathlib import Path

import numpy as np
import pytest
from impid_host.impedance.campaign import Options, default_chain, fit_study
from impid_host.impedance.identify import RobotFit, robot_equation
from impid_host.robot.model import robot_model
from impid_host.signals.align import align
from impid_host.study.importing import import_logs
from impid_host.study.model import Study

pytestmark = pytest.mark.measured
MAPPINGS = Path(__file__).resolve().parents[3] / "docs" / "mappings"
TERMS = ("friction.coulomb", "actuator.offset")


def lwr(data: Path, k: int) -> Study:
    return import_logs([data / "kuka_lwr4" / f"measurements_{k}.parquet"], MAPPINGS / "kuka_lwr4.toml", "lwr")


def test_lwr_predicts_the_repeated_motion(measured_data: Path) -> None:
    first, second = (lwr(measured_data, k) for k in (1, 2))
    chain = default_chain(first)
    robot = fit_study(first, Options(chain, terms=TERMS)).robot
    assert isinstance(robot, RobotFit)
    assert robot.resting == ()
    structure = robot.parameters.structure
    (trial,) = second.trials
    other = align(trial, second.setup, robot_model(second.setup.robot), chain)
    equation = robot_equation(other, structure, chain)
    target = equation.target[other.valid]
    left = target - equation.design[other.valid] @ robot.parameters.value
    # FloBaRoID's own URDF with friction leaves 1.55, 0.98 N m of the two largest joints.
    assert 100 * np.linalg.norm(left) / np.linalg.norm(target) < 4.4
    assert np.sqrt(np.mean(left[:, 1] ** 2)) < 1.0


def test_ur10e_alone_on_its_third_joint(measured_data: Path) -> None:
    study = import_logs(
        [measured_data / "ur10e" / "single_joint_3.parquet"], MAPPINGS / "ur10e.toml", "joint3"
    )
    robot = fit_study(study, Options(default_chain(study), terms=TERMS)).robot
    assert isinstance(robot, RobotFit)
    assert robot.resting == (0, 1, 3, 4, 5)
    assert (robot.vaf > 98).all()
    # The authors' viscous and Coulomb friction of joint 3: 10.4 N m s, 5.0 N m, by another motion.
    assert robot.estimate["Fv3"] == pytest.approx(10.378, rel=0.3)
    assert robot.estimate["Fc3"] == pytest.approx(4.994, rel=0.2)


def test_leg_tells_its_virtual_force_from_the_shipped_mapping_alone(measured_data: Path) -> None:
    log = measured_data / "leg_force_sensor" / "press_cycles.parquet"
    study = import_logs([log], MAPPINGS / "leg_force_sensor.toml", "leg")
    (compared,) = fit_study(study, Options(default_chain(study))).forces
    alone, fitted = compared.errors
    # The data's README: F = -J^-T tau is about 2.6 N rms from a force of about 13 N rms.
    assert compared.signal_rms[1] == pytest.approx(13, abs=1.5)
    assert 2 < alone.rms[1] < 4
    assert (fitted.rms < 0.6 * alone.rms).all()
