"""A ROS bag's joint states as named columns: rosbag2 folders (SQLite or MCAP) and ROS 1 bags.

Read by the library `rosbags`, an optional extra; no ROS is needed. Of each sensor_msgs/JointState topic
there are `t`, `position.JOINT`, `velocity.JOINT` and `effort.JOINT`, with the topic in front
(`/arm/position.JOINT`) where there are several. `t` is the messages' own stamp, in seconds since the first;
where a driver leaves that empty, the time of recording.
"""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impid_host.errors import InputError
from impid_host.extras import need
from impid_host.study.columns_log import ColumnsLog
from impid_host.study.notices import notice

_TYPE = "sensor_msgs/msg/JointState"
_NO_EFFORT = "the driver leaves effort empty in some messages, so there are no torques"
_FIELDS = ("position", "velocity", "effort")


def bag_of(path: Path) -> Path | None:
    """The bag that a path names: the folder of a rosbag2, or a ROS 1 file; None where it is no bag."""
    if path.suffix == ".bag" and path.is_file():
        return path
    if (path / "metadata.yaml").is_file():
        return path
    if path.suffix in (".db3", ".mcap"):
        if (path.parent / "metadata.yaml").is_file():
            return path.parent
        remedy = "run `ros2 bag reindex` on its folder, or give the whole folder"
        raise InputError(path, "has no metadata.yaml beside it", remedy)
    return None


def read_bag(path: Path) -> ColumnsLog:
    """Joint states of one bag.

    Raises:
        InputError: it is damaged, or holds none.
        MissingExtraError: the extra is not installed.
    """
    topics = _joint_states(path)
    if not topics:
        raise InputError(path, f"holds no messages of type {_TYPE}", "record the topic /joint_states")
    columns = {
        name if len(topics) == 1 else f"{topic}/{name}": column
        for topic, own in topics.items()
        for name, column in own.items()
    }
    has_effort = any(name.split("/")[-1].startswith("effort.") for name in columns)
    return ColumnsLog(path, columns, "" if has_effort else _NO_EFFORT)


def _joint_states(path: Path) -> dict[str, dict[str, NDArray[np.float64]]]:
    need("rosbags", f"{path} (a ROS bag)")
    from rosbags.highlevel import AnyReader, AnyReaderError  # noqa: PLC0415  (an optional extra)
    from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415

    messages: dict[str, list[tuple[int, Any]]] = {}
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            wanted = [one for one in reader.connections if one.msgtype == _TYPE]
            for connection, received, raw in reader.messages(connections=wanted) if wanted else ():
                state = reader.deserialize(raw, connection.msgtype)
                messages.setdefault(connection.topic, []).append((received, state))
    except (AnyReaderError, OSError, ValueError, KeyError, AssertionError) as error:
        reason = (str(error).splitlines() or [""])[0][:120]
        raise InputError(path, f"is no readable bag ({reason})", "check or record it again") from None
    return {topic: _columns(path, topic, states) for topic, states in messages.items()}


def _columns(path: Path, topic: str, states: list[tuple[int, Any]]) -> dict[str, NDArray[np.float64]]:
    """Of the messages that name the joints most messages name."""
    groups = Counter(tuple(state.name) for _, state in states)
    joints, _ = groups.most_common(1)[0]
    kept = [(received, state) for received, state in states if tuple(state.name) == joints]
    if len(groups) > 1:
        told = f"{len(states) - len(kept)} of {len(states)} messages on {topic} are of other joints"
        notice(f"{path}: {told}; left out")
    stamps = np.array([state.header.stamp.sec * 10**9 + state.header.stamp.nanosec for _, state in kept])
    if not stamps.any():
        stamps = np.array([received for received, _ in kept])
    columns = {"t": (stamps - stamps[0]) * 1e-9}
    for field in _FIELDS:
        values = [np.asarray(getattr(state, field), dtype=np.float64) for _, state in kept]
        # A driver may leave velocity or effort empty.
        if all(len(row) == len(joints) for row in values):
            table = np.stack(values)
            columns |= {f"{field}.{joint}": table[:, k] for k, joint in enumerate(joints)}
    return columns
