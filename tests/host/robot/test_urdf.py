"""The URDF robot against the closed form of the planar arm it describes, and against Pinocchio's RNEA."""

from pathlib import Path

import numpy as np
import pinocchio
import pytest
from impid_host.errors import InputError
from impid_host.robot.planar_2r_relative import Planar2RRelative
from impid_host.robot.urdf import urdf_robot

# Two rods in a level plane: masses, centres of mass and inertias about them, l1 = 0.3 m, l2 = 0.25 m.
M1, C1, I1 = 1.2, 0.10, 0.012
M2, C2X, C2Y, I2 = 0.7, 0.12, 0.01, 0.0065
L1, L2 = 0.3, 0.25


def link(name: str, mass: float, x: float, y: float, izz: float) -> str:
    return (
        f'<link name="{name}"><inertial><origin xyz="{x} {y} 0"/><mass value="{mass}"/>'
        f'<inertia ixx="0.001" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="{izz}"/></inertial></link>'
    )


def joint(name: str, parent: str, child: str, x: float, axis: str = "0 0 1") -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x} 0 0"/><axis xyz="{axis}"/>'
        '<limit effort="9" velocity="9" lower="-3" upper="3"/></joint>'
    )


def write(path: Path, *, axis: str = "0 0 1") -> Path:
    tip = (
        f'<link name="tip"/><joint name="end" type="fixed"><parent link="l2"/><child link="tip"/>'
        f'<origin xyz="{L2} 0 0"/></joint>'
    )
    parts = [
        '<link name="base"/>',
        link("l1", M1, C1, 0.0, I1),
        link("l2", M2, C2X, C2Y, I2),
        joint("j1", "base", "l1", 0.0),
        joint("j2", "l1", "l2", L1, axis),
        tip,
    ]
    path.write_text(f'<robot name="arm">{"".join(parts)}</robot>')
    return path


def states(n: int = 50) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(2)
    return rng.uniform(-2, 2, (n, 2)), rng.normal(0, 2, (n, 2)), rng.normal(0, 9, (n, 2))


def test_level_arm_is_the_closed_form(tmp_path: Path) -> None:
    robot = urdf_robot(write(tmp_path / "arm.urdf"))
    assert robot.task_axes == ("x", "y")
    assert robot.parameter_names == ("Izz1 +0.09*m2", "mx2", "my2", "Izz2", "Fv1", "Fv2")
    plane = Planar2RRelative(L1, L2)
    zz1 = I1 + M1 * C1**2 + M2 * L1**2
    zz2 = I2 + M2 * (C2X**2 + C2Y**2)
    theta, omega, theta_dd = states()
    expected = plane.regressor(theta, omega, theta_dd) @ [zz1, zz2, M2 * C2X, M2 * C2Y, 0.3, 0.2]
    torque = robot.regressor(theta, omega, theta_dd) @ [zz1, M2 * C2X, M2 * C2Y, zz2, 0.3, 0.2]
    assert torque == pytest.approx(expected, abs=1e-10)
    assert robot.position(theta) == pytest.approx(plane.position(theta), abs=1e-12)
    assert robot.jacobian(theta) == pytest.approx(plane.jacobian(theta), abs=1e-12)
    assert robot.jacobian_rate(theta, omega) == pytest.approx(plane.jacobian_rate(theta, omega), abs=1e-10)


def test_base_parameters_give_pinocchios_own_torque_in_space(tmp_path: Path) -> None:
    path = write(tmp_path / "arm.urdf", axis="0 1 0")  # the second joint lifts the forearm: gravity acts
    robot = urdf_robot(path)
    assert robot.task_axes == ("x", "y", "z")
    theta, omega, theta_dd = states()
    model = pinocchio.buildModelFromUrdf(str(path))
    data = model.createData()
    tau = np.array([pinocchio.rnea(model, data, *row) for row in zip(theta, omega, theta_dd, strict=True)])
    rows = robot.regressor(theta, omega, theta_dd)
    fitted, _, rank, _ = np.linalg.lstsq(rows.reshape(-1, rows.shape[2]), tau.ravel(), rcond=None)
    assert rank == len(robot.parameter_names)
    assert rows @ fitted == pytest.approx(tau, abs=1e-9)
    inertia = robot.inertia(theta[:1], fitted)[0]
    assert inertia == pytest.approx(pinocchio.crba(model, data, theta[0]), abs=1e-9)
    C = robot.coriolis(theta[:1], omega[:1], fitted)[0]
    expected = pinocchio.rnea(model, data, theta[0], omega[0], np.zeros(2)) - pinocchio.rnea(
        model, data, theta[0], np.zeros(2), np.zeros(2)
    )
    assert C @ omega[0] == pytest.approx(expected, abs=1e-6)


def test_what_is_no_serial_robot_is_refused(tmp_path: Path) -> None:
    (tmp_path / "junk.urdf").write_text("no robot")
    with pytest.raises(InputError, match="is no XML"):
        urdf_robot(tmp_path / "junk.urdf")
    (tmp_path / "still.urdf").write_text('<robot name="s"><link name="base"/></robot>')
    with pytest.raises(InputError, match="has no chain"):
        urdf_robot(tmp_path / "still.urdf")


def test_without_the_library_the_remedy_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pinocchio", None)
    with pytest.raises(InputError, match=r"pip install 'impid\[urdf\]'"):
        urdf_robot(write(tmp_path / "arm.urdf"))
