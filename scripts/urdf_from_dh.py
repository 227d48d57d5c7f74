"""Writes the URDFs of docs/mappings/urdf/: kinematics of published robots, from their published DH tables.

Base parameters depend on the joints' axes alone, so the links carry no inertia. Usage:
`python scripts/urdf_from_dh.py docs/mappings/urdf`
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np


@dataclass(frozen=True, slots=True)
class Robot:
    """A serial arm of revolute joints.

    Attributes:
        convention: "standard": Rz(q) Tz(d) Tx(a) Rx(alpha); "modified": Rx(alpha) Tx(a) Rz(q) Tz(d) (Craig,
            Khalil).
        rows: a (m), d (m), alpha (quarter turns), one for each joint.
        flange: d behind a modified table's last joint, m.
        source: of the table.
    """

    name: str
    convention: Literal["standard", "modified"]
    rows: Sequence[tuple[float, float, int]]
    source: str
    flange: float = 0.0


ROBOTS = (
    Robot(
        "ur10e",
        "standard",
        [
            (0.0, 0.1807, 1),
            (-0.6127, 0.0, 0),
            (-0.57155, 0.0, 0),
            (0.0, 0.17415, 1),
            (0.0, 0.11985, -1),
            (0.0, 0.11655, 0),
        ],
        "Universal Robots, DH Parameters for calculations of kinematics and dynamics, UR10e",
    ),
    Robot(
        "kuka_lwr4",
        "standard",
        [
            (0.0, 0.0, 1),
            (0.0, 0.0, -1),
            (0.0, 0.4, -1),
            (0.0, 0.0, 1),
            (0.0, 0.39, 1),
            (0.0, 0.0, -1),
            (0.0, 0.078, 0),
        ],
        "C. Gaz, F. Flacco, A. De Luca, Identifying the dynamic model used by the KUKA LWR: a reverse "
        "engineering approach, ICRA 2014, Table I; flange of the data sheet",
    ),
    Robot(
        "franka_panda",
        "modified",
        [
            (0.0, 0.333, 0),
            (0.0, 0.0, -1),
            (0.0, 0.316, 1),
            (0.0825, 0.0, 1),
            (-0.0825, 0.384, -1),
            (0.0, 0.0, 1),
            (0.088, 0.0, 1),
        ],
        "Franka Emika, Robot and interface specifications, Denavit-Hartenberg parameters",
        flange=0.107,
    ),
    Robot(
        "staubli_tx40",
        "modified",
        [
            (0.0, 0.32, 0),
            (0.0, 0.0, -1),
            (0.225, 0.035, 0),
            (0.0, 0.225, 1),
            (0.0, 0.0, -1),
            (0.0, 0.0, 1),
        ],
        "Staubli, TX40 data sheet (links of 225 mm, shoulder offset of 35 mm), in Khalil's convention",
        flange=0.065,
    ),
)


def origins(robot: Robot) -> list[tuple[tuple[float, float, float], float]]:
    """Each joint's frame in the one before it, the flange last: place (m) and turn about x (rad)."""
    places: list[tuple[tuple[float, float, float], float]] = []
    if robot.convention == "standard":
        places = [((0.0, 0.0, 0.0), 0.0)]
        places += [((a, 0.0, d), alpha * np.pi / 2) for a, d, alpha in robot.rows]
        return places
    for a, d, alpha in robot.rows:
        angle = alpha * np.pi / 2
        places.append(((a, -d * round(np.sin(angle)), d * round(np.cos(angle))), angle))
    return [*places, ((0.0, 0.0, robot.flange), 0.0)]


def urdf(robot: Robot) -> str:
    """The file's text."""
    lines = ['<?xml version="1.0"?>', f"<!-- {robot.source}. -->", f'<robot name="{robot.name}">']
    lines.append('  <link name="base"/>')
    *joints, flange = origins(robot)
    parent = "base"
    for number, ((x, y, z), turn) in enumerate(joints, 1):
        lines += [
            f'  <joint name="joint{number}" type="continuous">',
            f'    <parent link="{parent}"/><child link="link{number}"/>',
            f'    <origin xyz="{x:g} {y:g} {z:g}" rpy="{turn:.15g} 0 0"/><axis xyz="0 0 1"/>',
            "  </joint>",
            f'  <link name="link{number}"/>',
        ]
        parent = f"link{number}"
    (x, y, z), turn = flange
    lines += [
        '  <joint name="flange_joint" type="fixed">',
        f'    <parent link="{parent}"/><child link="flange"/>',
        f'    <origin xyz="{x:g} {y:g} {z:g}" rpy="{turn:.15g} 0 0"/>',
        "  </joint>",
        '  <link name="flange"/>',
        "</robot>",
    ]
    return "\n".join(lines) + "\n"


def main(folder: Path) -> None:
    """Write them all."""
    folder.mkdir(parents=True, exist_ok=True)
    for robot in ROBOTS:
        (folder / f"{robot.name}.urdf").write_text(urdf(robot), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
