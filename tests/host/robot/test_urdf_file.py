"""Which joints of a URDF a log follows, and what is fixed beside them."""

from pathlib import Path

import numpy as np
import pytest
from impid_host.errors import InputError
from impid_host.robot.urdf import urdf_robot
from impid_host.robot.urdf_file import read_chain
from impid_host.study.joints import logged_joints
from impid_host.study.model import RobotSetup

Row = tuple[str, str, str, str]
ARM: list[Row] = [
    ("a1", "continuous", "base", "l1"),
    ("a2", "revolute", "l1", "l2"),
    ("wrist", "fixed", "l2", "hand"),
]
FINGERS: list[Row] = [
    ("left", "prismatic", "hand", "left_finger"),
    ("right", "prismatic", "hand", "right_finger"),
]


def write(path: Path, rows: list[Row], extra: dict[str, str] | None = None, axis: str = "0 1 0") -> Path:
    limit = '<limit lower="0.01" upper="0.04" effort="1" velocity="1"/>'
    joints = "".join(
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.2 0 0.1"/><axis xyz="{axis}"/>'
        + (limit if kind in ("revolute", "prismatic") else "")
        + (extra or {}).get(name, "")
        + "</joint>"
        for name, kind, parent, child in rows
    )
    links = dict.fromkeys(["base", *(row[3] for row in rows)])
    path.write_text(f'<robot name="r">{"".join(f"<link name={name!r}/>" for name in links)}{joints}</robot>')
    return path


def test_a_gripper_is_fixed_where_it_rests(tmp_path: Path) -> None:
    chain = read_chain(write(tmp_path / "r.urdf", ARM + FINGERS))
    assert chain.joints == ("a1", "a2")
    assert chain.prismatic == (False, False)
    assert chain.fixed == {"left": 0.01, "right": 0.01}  # zero is outside their limits
    assert chain.tip == "hand"
    robot = urdf_robot(tmp_path / "r.urdf")
    assert robot.joints == 2
    assert robot.regressor(*np.zeros((3, 4, 2))).shape[1] == 2


def test_a_coupled_finger_moves_nothing_by_itself(tmp_path: Path) -> None:
    one = [*ARM, ("left", "prismatic", "hand", "finger")]
    path = write(tmp_path / "r.urdf", one, {"left": '<mimic joint="a2"/>'})
    assert read_chain(path).joints == ("a1", "a2")
    free = write(tmp_path / "free.urdf", one)
    assert read_chain(free).joints == ("a1", "a2", "left")
    assert read_chain(free).prismatic == (False, False, True)


def test_named_joints_are_taken_in_their_order(tmp_path: Path) -> None:
    path = write(tmp_path / "r.urdf", ARM + FINGERS)
    assert read_chain(path, ("a2", "right")).joints == ("a2", "right")
    with pytest.raises(InputError, match="no movable joint 'wrist'"):
        read_chain(path, ("wrist",))
    with pytest.raises(InputError, match="joint a1 does not follow joint a2"):
        read_chain(path, ("a2", "a1"))
    with pytest.raises(InputError, match="joint right does not follow joint left"):
        read_chain(path, ("left", "right"))


def test_a_log_with_another_number_of_joints_is_refused_with_the_names(tmp_path: Path) -> None:
    path = write(tmp_path / "r.urdf", [*ARM, ("lift", "prismatic", "hand", "tool")])
    setup = RobotSetup("urdf", urdf=path)
    assert logged_joints(setup, 3, tmp_path / "setup.toml") == (False, False, True)
    with pytest.raises(InputError, match="3 joints in its longest chain \\(a1, a2, lift\\)"):
        logged_joints(setup, 2, tmp_path / "setup.toml")
    named = RobotSetup("urdf", urdf=path, joints=("a1", "a2"))
    with pytest.warns(UserWarning, match="does not follow lift at 0.01; fixed there"):
        assert logged_joints(named, 2, tmp_path / "setup.toml") == (False, False)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([("f", "floating", "base", "l1")], "'floating'"),
        ([("a", "revolute", "base", "l1"), ("b", "revolute", "other", "l2")], "no single base"),
        ([("a", "revolute", "base", "l1"), ("b", "revolute", "base", "l1")], "hangs on two joints"),
        ([("a", "revolute", "base", "l1"), ("b", "revolute", "l1", "base")], "no single base"),
        ([("a", "revolute", "base", "l1"), ("b", "revolute", "base", "l2")], "no chain"),
    ],
)
def test_what_is_no_serial_chain_is_said(tmp_path: Path, rows: list[Row], words: str) -> None:
    with pytest.raises(InputError, match=words):
        read_chain(write(tmp_path / "r.urdf", rows))


@pytest.mark.parametrize(("kind", "axes"), [("revolute", ("x", "y", "z")), ("prismatic", ("z",))])
def test_one_joint_alone_is_a_robot(tmp_path: Path, kind: str, axes: tuple[str, ...]) -> None:
    rows = [("only", kind, "base", "l1"), ("end", "fixed", "l1", "tip")]
    robot = urdf_robot(write(tmp_path / "r.urdf", rows, axis="1 1 1" if kind == "revolute" else "0 0 1"))
    theta = np.linspace(-0.5, 0.5, 11)[:, None]
    assert robot.task_axes == axes
    assert robot.position(theta).shape == (11, len(axes))
    step = 1e-6
    slope = (robot.position(theta + step) - robot.position(theta - step)) / (2 * step)
    assert robot.jacobian(theta)[:, :, 0] == pytest.approx(slope, abs=1e-8)
    assert robot.has_gravity
    # Inertia and two gravity moments about an inclined axis; mass alone along a vertical slide.
    assert len(robot.parameter_names) == (4 if kind == "revolute" else 2)
    assert robot.parameter_units[-1] == ("N*m*s/rad" if kind == "revolute" else "N*s/m")


def test_gravity_can_point_elsewhere(tmp_path: Path) -> None:
    path = write(tmp_path / "r.urdf", ARM)  # both axes along y
    theta, still = np.random.default_rng(1).uniform(-2, 2, (2, 30, 2)) * np.array([1, 0])[:, None, None]
    level = urdf_robot(path, gravity_m_s2=(0.0, 9.81, 0.0))
    assert not level.has_gravity  # along the axes themselves
    assert np.abs(level.regressor(theta, still, still)).max() < 1e-9
    assert urdf_robot(path).has_gravity
