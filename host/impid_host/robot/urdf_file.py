"""The joints that a URDF file describes, read without any library: which of them a log follows, and the tip.

A log has one column for each joint of one serial chain. What else a URDF holds, the fingers of a gripper or a
second arm, is fixed where it rests: at zero, or at the limit nearest to it.
"""

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from impid_host.errors import InputError

_LARGEST_BYTES = 16 << 20
_MOVING = ("revolute", "continuous", "prismatic")
_MANY_TURNS = "1e4"
_MOST_JOINTS = 300


@dataclass(frozen=True, slots=True)
class Chain:
    """What of a URDF moves.

    Attributes:
        joints: names of the joints that a log follows, base to tip, n.
        prismatic: which of them slide, n.
        fixed: names of the movable joints beside them, and where they rest, rad or m.
        tip: the link whose frame is the end-effector.
        xml: the file's text, endless joints given limits and coupled joints made independent.
    """

    joints: tuple[str, ...]
    prismatic: tuple[bool, ...]
    fixed: dict[str, float]
    tip: str
    xml: str


@dataclass(frozen=True, slots=True)
class _Joint:
    name: str
    kind: str
    parent: str
    child: str
    rest: float
    coupled: bool

    @property
    def moves(self) -> bool:
        return self.kind in _MOVING


def read_chain(path: Path, asked: Sequence[str] = ()) -> Chain:
    """The chain of joints that a log of this robot follows.

    Without `asked` it goes from the base along the branch with most joints, and ends where branches tie.

    Args:
        asked: names of the joints, base to tip; all others are fixed.

    Raises:
        InputError: no URDF, a joint that does not exist, joints that are not one serial chain, or none.
    """
    root = _parsed(path)
    joints = [_joint(path, element) for element in root.findall("joint")]
    if len(joints) > _MOST_JOINTS:
        raise InputError(path, f"has {len(joints)} joints, more than any robot", "check the file")
    children = [joint.child for joint in joints]
    if len(set(children)) < len(children):
        raise InputError(path, "has a link that hangs on two joints", "check the URDF: links form a tree")
    below: dict[str, list[_Joint]] = {}
    for joint in joints:
        below.setdefault(joint.parent, []).append(joint)
    links = {link.get("name", ""): None for link in root.findall("link")}
    bases = [link for link in {**links, **dict.fromkeys(below)} if link not in children]
    if len(bases) != 1:
        raise InputError(path, "has no single base link that all others hang on", "check the URDF's joints")
    kept = _asked(path, joints, asked) if asked else _longest(bases[0], below)
    if not kept:
        raise InputError(
            path,
            "has no chain of revolute or prismatic joints that is longer than all others",
            'name the logged joints, base to tip, in setup.toml: joints = ["...", "..."]',
        )
    names = {joint.name for joint in kept}
    return Chain(
        joints=tuple(joint.name for joint in kept),
        prismatic=tuple(joint.kind == "prismatic" for joint in kept),
        fixed={joint.name: joint.rest for joint in joints if joint.moves and joint.name not in names},
        tip=_tip(kept[-1].child, below),
        xml=_plain(root),
    )


def _parsed(path: Path) -> ET.Element:
    try:
        if path.stat().st_size > _LARGEST_BYTES:
            raise InputError(path, "is too large for a URDF", "check that this is the right file")
        root = ET.fromstring(path.read_bytes())
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the path") from None
    except (ET.ParseError, ValueError, LookupError) as error:
        raise InputError(
            path, f"is no XML ({error})", "check the URDF (xacro files need expanding)"
        ) from None
    if root.tag != "robot":
        raise InputError(path, f"is no URDF: its root is <{root.tag}>, not <robot>", "check the file")
    return root


def _joint(path: Path, element: ET.Element) -> _Joint:
    name, kind = element.get("name", ""), element.get("type", "")
    parent, child = element.find("parent"), element.find("child")
    if not name or parent is None or child is None:
        raise InputError(path, f"joint {name!r} lacks a name, parent or child", "check the URDF")
    if kind not in (*_MOVING, "fixed"):
        raise InputError(
            path,
            f"joint {name} is of type {kind!r}, which has other than one degree of freedom",
            "use revolute, continuous or prismatic joints",
        )
    return _Joint(
        name=name,
        kind=kind,
        parent=parent.get("link", ""),
        child=child.get("link", ""),
        rest=_rest(path, name, element.find("limit")),
        coupled=element.find("mimic") is not None,
    )


def _rest(path: Path, name: str, limit: ET.Element | None) -> float:
    if limit is None:
        return 0.0
    try:
        low, high = float(limit.get("lower", "0")), float(limit.get("upper", "0"))
    except ValueError:
        raise InputError(path, f"joint {name} has limits that are no numbers", "check the URDF") from None
    return min(max(0.0, low), high) if low < high else 0.0


def _asked(path: Path, joints: Sequence[_Joint], asked: Sequence[str]) -> list[_Joint]:
    named = {joint.name: joint for joint in joints if joint.moves}
    for name in asked:
        if name not in named:
            raise InputError(
                path, f"has no movable joint {name!r}", f"key `robot.joints` may name {', '.join(named)}"
            )
    above = {joint.child: joint for joint in joints}
    kept = [named[name] for name in asked]
    for before, after in pairwise(kept):
        link, seen = after.parent, set()
        while link != before.child and link in above and link not in seen:
            seen.add(link)
            link = above[link].parent
        if link != before.child:
            raise InputError(
                path,
                f"joint {after.name} does not follow joint {before.name}",
                "name one serial chain, base to tip, in `robot.joints`",
            )
    return kept


def _longest(base: str, below: dict[str, list[_Joint]]) -> list[_Joint]:
    kept: list[_Joint] = []
    link = base
    while link in below:
        counts = [_movable(joint, below) for joint in below[link]]
        best = max(counts)
        if best == 0 or counts.count(best) > 1:
            break
        joint = below[link][counts.index(best)]
        if joint.moves and not joint.coupled:
            kept.append(joint)
        link = joint.child
    return kept


def _movable(joint: _Joint, below: dict[str, list[_Joint]]) -> int:
    """Longest chain of free joints from this one on."""
    own = int(joint.moves and not joint.coupled)
    return own + max((_movable(after, below) for after in below.get(joint.child, [])), default=0)


def _tip(link: str, below: dict[str, list[_Joint]]) -> str:
    """The last link, along what is fixed to `link`, before several ends tie."""
    while link in below:
        depths = [_depth(joint.child, below) for joint in below[link]]
        if depths.count(max(depths)) > 1:
            break
        link = below[link][depths.index(max(depths))].child
    return link


def _depth(link: str, below: dict[str, list[_Joint]]) -> int:
    return 1 + max((_depth(joint.child, below) for joint in below.get(link, [])), default=0)


def _plain(root: ET.Element) -> str:
    for element in root.findall("joint"):
        for coupling in element.findall("mimic"):
            element.remove(coupling)
        if element.get("type") == "continuous":
            element.set("type", "revolute")
            for limit in element.findall("limit"):
                element.remove(limit)
            limits = {"lower": "-" + _MANY_TURNS, "upper": _MANY_TURNS, "effort": "1e9", "velocity": "1e9"}
            ET.SubElement(element, "limit", limits)
    # Shapes mean nothing to the dynamics, and their files are seldom there.
    for link in root.findall("link"):
        for kind in ("visual", "collision"):
            for shape in link.findall(kind):
                link.remove(shape)
    return ET.tostring(root, encoding="unicode")
