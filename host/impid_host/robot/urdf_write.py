"""A URDF with identified inertias: each moving link takes those of all that is fixed to it."""

import io
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from impid_host.errors import InputError
from impid_host.signals.arrays import Floats


def with_inertias(path: Path, joints: Sequence[str], links: Floats) -> str:
    """The text of the URDF at `path`, all but inertias as it stands there.

    A log shows what moves together, not how links that are fixed to each other share it: the link behind
    each of `joints` takes the whole, those fixed to it lose their `<inertial>`. What does not move
    keeps its own.

    Args:
        joints: names of the joints that move, base to tip, n.
        links: m, mx, my, mz (kg, kg m), Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the link's origin (kg m^2),
            (n, 10).

    Raises:
        InputError: the file cannot be read.
    """
    try:
        builder = ET.TreeBuilder(insert_comments=True)
        tree = ET.parse(path, ET.XMLParser(target=builder))
    except (OSError, ET.ParseError, ValueError) as error:
        raise InputError(path, f"cannot be read ({error})", "check the path") from None
    root = tree.getroot()
    elements = {link.get("name"): link for link in root.findall("link")}
    below: dict[str, list[tuple[str, str]]] = {}
    child_of = {}
    for joint in root.findall("joint"):
        parent, child = (joint.find(end) for end in ("parent", "child"))
        if parent is not None and child is not None:
            name, link = joint.get("name", ""), child.get("link", "")
            below.setdefault(parent.get("link", ""), []).append((name, link))
            child_of[name] = link
    for name, link in zip(joints, links, strict=True):
        waiting = [child_of[name]]
        for at in waiting:  # grows while it is read: a tree, so it ends
            waiting += [child for joint, child in below.get(at, []) if joint not in joints]
            for old in elements[at].findall("inertial"):
                elements[at].remove(old)
        elements[child_of[name]].insert(0, _inertial(link))
    ET.indent(tree)
    text = io.StringIO()
    tree.write(text, encoding="unicode", xml_declaration=True)
    return text.getvalue()


def _inertial(link: Floats) -> ET.Element:
    """`<inertial>`: about the centre of mass, axes of the link."""
    mass, first = float(link[0]), link[1:4]
    xx, xy, yy, xz, yz, zz = link[4:]
    centre = first / mass
    about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    about = about - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    element = ET.Element("inertial")
    ET.SubElement(element, "origin", xyz=" ".join(f"{own:.9g}" for own in centre), rpy="0 0 0")
    ET.SubElement(element, "mass", value=f"{mass:.9g}")
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    ET.SubElement(
        element, "inertia", {n: f"{v:.9g}" for n, v in zip(names, about[np.triu_indices(3)], strict=True)}
    )
    return element
