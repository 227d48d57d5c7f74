"""Which joints a log's columns are: as the robot model says, or the file that describes the robot."""

from pathlib import Path

from impid_host.errors import InputError
from impid_host.robot.model import ROBOTS
from impid_host.robot.urdf_file import read_chain
from impid_host.study.model import RobotSetup
from impid_host.study.notices import notice


def logged_joints(robot: RobotSetup, columns: int, path: Path) -> tuple[bool, ...]:
    """Which of the joints that a log follows are prismatic, n of them.

    Joints of the description that the log does not follow are told as a notice.

    Args:
        columns: theta1, theta2, ... in the log; path: of the file that is to be corrected.

    Raises:
        InputError: the description cannot be read, or has another number of joints.
    """
    kind = ROBOTS[robot.model]
    if not kind.described or robot.urdf is None:
        return (kind.slides,) * columns
    chain = read_chain(robot.urdf, robot.joints)
    if len(chain.joints) != columns:
        raise InputError(
            path,
            f"{robot.urdf.name} has {len(chain.joints)} joints in its longest chain "
            f"({', '.join(chain.joints)}), the log has theta1 to theta{columns}",
            'name those that the log follows, base to tip: robot.joints = ["...", "..."]',
        )
    if chain.fixed:
        places = ", ".join(f"{name} at {place:g}" for name, place in chain.fixed.items())
        notice(f"{robot.urdf}: the log does not follow {places}; fixed there")
    return chain.prismatic
