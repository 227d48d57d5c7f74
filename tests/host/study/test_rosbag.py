"""ROS bags written by the library's own writer, read back as joint states."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from impid_host.errors import InputError
from impid_host.extras import MissingExtraError
from impid_host.study.importing import import_logs
from impid_host.study.rosbag_log import bag_of, read_bag
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
ROWS = 200
MAPPING = """
[setup.robot]
model = "planar-2r-absolute"
link_lengths_m = [0.3, 0.3]
[columns]
t = "t"
theta1 = { expression = "col(\\"position.shoulder\\")" }
theta2 = { column = "position.elbow", unit = "rad" }
tau1 = "effort.shoulder"
tau2 = "effort.elbow"
[[trial]]
name = "free_01"
kind = "free"
"""


def motion() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    t = np.arange(ROWS) * 0.01
    return t, np.stack([np.sin(t), np.cos(t)], axis=1), np.stack([t, -t], axis=1)


def write(
    path: Path,
    plugin: StoragePlugin,
    topic: str = "/joint_states",
    *,
    stamped: bool = True,
    stray: bool = False,
) -> Path:
    types = STORE.types
    header, stamp = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    state: Callable[..., Any] = types["sensor_msgs/msg/JointState"]
    t, q, tau = motion()
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection(topic, state.__msgtype__, typestore=STORE)  # type: ignore[attr-defined]
        for k in range(ROWS):
            ns = 1_700_000_000_000_000_000 + round(t[k] * 1e9)
            own = stamp(ns // 10**9, ns % 10**9) if stamped else stamp(0, 0)
            names = ["shoulder", "elbow"]
            message = state(header(own, ""), names, q[k], np.zeros(0), tau[k])
            writer.write(connection, ns, STORE.serialize_cdr(message, connection.msgtype))
            if stray and k % 10 == 0:
                gripper = state(header(own, ""), ["finger"], np.zeros(1), np.zeros(0), np.zeros(0))
                writer.write(connection, ns, STORE.serialize_cdr(gripper, connection.msgtype))
    return path


@pytest.mark.parametrize("plugin", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
@pytest.mark.parametrize("stamped", [True, False])
def test_a_bag_becomes_a_study(tmp_path: Path, plugin: StoragePlugin, stamped: bool) -> None:
    bag = write(tmp_path / "bag", plugin, stamped=stamped)
    (tmp_path / "map.toml").write_text(MAPPING)
    (trial,) = import_logs([bag], tmp_path / "map.toml", "study").trials
    t, q, tau = motion()
    assert trial.robot.t == pytest.approx(t, abs=1e-9)
    assert np.array_equal(trial.robot.theta, q)
    assert np.array_equal(trial.robot.tau, tau)


def test_the_file_within_names_the_bag(tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", StoragePlugin.SQLITE3)
    (inside,) = bag.glob("*.db3")
    assert bag_of(inside) == bag
    (bag / "metadata.yaml").unlink()
    with pytest.raises(InputError, match="ros2 bag reindex"):
        bag_of(inside)


def test_messages_of_other_joints_are_left_out_and_said(tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", StoragePlugin.MCAP, stray=True)
    with pytest.warns(UserWarning, match="20 of 220 messages on /joint_states are of other joints"):
        log = read_bag(bag)
    assert log.names() == ["t", "position.shoulder", "position.elbow", "effort.shoulder", "effort.elbow"]
    assert len(log.column("t")) == ROWS


def test_what_is_no_bag_is_an_error_with_its_remedy(tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", StoragePlugin.MCAP)
    (inside,) = bag.glob("*.mcap")
    inside.write_bytes(inside.read_bytes()[:300])
    with pytest.raises(InputError, match="no readable bag"):
        read_bag(bag)


def test_without_the_library_the_remedy_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = write(tmp_path / "bag", StoragePlugin.MCAP)
    monkeypatch.setattr("impid_host.extras.find_spec", lambda _name: None)
    with pytest.raises(MissingExtraError, match=r"pip install 'impid\[ros\]'"):
        read_bag(bag)
