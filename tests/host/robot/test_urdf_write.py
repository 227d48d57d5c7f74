"""A URDF with identified inertias moves as those inertias say, by Pinocchio's recursion."""

from pathlib import Path

import numpy as np
import pinocchio
import pytest
from click.testing import CliRunner
from impid_host.cli import cli
from impid_host.errors import InputError
from impid_host.robot.urdf_write import with_inertias

# A mount fixed to the world, two moving links, a hand bolted on crooked, a finger that no log follows.
BODY = '<inertial><mass value="3"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
LIMIT = '<limit effort="9" velocity="9" lower="-3" upper="3"/>'
ARM = f"""<robot name="arm">
<!-- kept -->
<link name="base"/><link name="mount">{BODY}</link>
<link name="l1"><visual><geometry><sphere radius="0.1"/></geometry></visual></link>
<link name="l2"/><link name="hand">{BODY}</link><link name="finger">{BODY}</link>
<joint name="bolts" type="fixed"><parent link="base"/><child link="mount"/></joint>
<joint name="j1" type="revolute"><parent link="mount"/><child link="l1"/>
 <origin xyz="0 0 0.3" rpy="0.2 0 0"/><axis xyz="0 1 0"/>{LIMIT}</joint>
<joint name="j2" type="revolute"><parent link="l1"/><child link="l2"/>
 <origin xyz="0.3 0 0" rpy="0 0.4 0"/><axis xyz="0.6 0 0.8"/>{LIMIT}</joint>
<joint name="glue" type="fixed"><parent link="l2"/><child link="hand"/>
 <origin xyz="0 0.1 0" rpy="0 0 1"/></joint>
<joint name="grip" type="prismatic"><parent link="hand"/><child link="finger"/><axis xyz="1 0 0"/>
 <limit effort="9" velocity="9" lower="0" upper="0.04"/></joint>
</robot>"""


def possible(seed: int) -> np.ndarray:
    """m, h, second moments of six masses at random places."""
    rng = np.random.default_rng(seed)
    masses, places = rng.uniform(0.1, 1, 6), rng.normal(0.05, 0.1, (6, 3))
    about = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, places, strict=True))
    assert isinstance(about, np.ndarray)
    xx, xy, xz, yy, yz, zz = about[np.triu_indices(3)]
    return np.array([masses.sum(), *(masses @ places), xx, xy, yy, xz, yz, zz])


def test_it_moves_as_the_inertias_say(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM)
    links = np.array([possible(1), possible(2)])
    text = with_inertias(tmp_path / "arm.urdf", ("j1", "j2"), links)
    assert "<!-- kept -->" in text
    assert "<visual>" in text
    assert text.count("<mass") == 3  # of the mount, and of what moves
    whole = pinocchio.buildModelFromXML(text)
    model = pinocchio.buildReducedModel(whole, [whole.getJointId("grip")], pinocchio.neutral(whole))
    data = model.createData()
    rng = np.random.default_rng(3)
    for _ in range(20):
        q, v, a = rng.uniform(-2, 2, 2), rng.normal(0, 2, 2), rng.normal(0, 9, 2)
        regressor = pinocchio.computeJointTorqueRegressor(model, data, q, v, a)
        assert pinocchio.rnea(model, data, q, v, a) == pytest.approx(regressor @ links.ravel(), abs=1e-6)


def test_the_option_asks_for_what_it_needs(tmp_path: Path) -> None:
    done = CliRunner().invoke(cli, ["fit", str(tmp_path), "--urdf", str(tmp_path / "out.urdf")])
    assert done.exit_code == 2
    assert "add --physical" in done.output
    with pytest.raises(InputError, match="cannot be read"):
        with_inertias(tmp_path / "none.urdf", (), np.zeros((0, 10)))
