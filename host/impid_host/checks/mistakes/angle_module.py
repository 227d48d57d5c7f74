"""What goes wrong with the module's counters: direction, counts per turn, zeros, plugs."""

from collections.abc import Iterator

import numpy as np

from impid_host.checks.check import Change
from impid_host.checks.mistakes.angle_maps import (
    LEAST_SCALE,
    Relation,
    apart,
    counted,
    factor_of,
    joint_sets,
    relation,
)
from impid_host.checks.mistakes.hypothesis import Hypothesis
from impid_host.checks.signals import Signals
from impid_host.signals.arrays import Floats
from impid_host.study.model import EncoderSetup


def in_module(study: Signals, encoder: EncoderSetup) -> Iterator[Hypothesis]:
    n = study.model.joints
    relations = [relation(study, joint, joint) for joint in range(n)]
    for joints in joint_sets(n):
        where = "+".join(f"joint{joint + 1}" for joint in joints)
        yield _turned(joints, where, encoder)
        known = {joint: found for joint in joints if (found := relations[joint]) is not None}
        if len(known) < len(joints):
            continue
        if all(abs(abs(found.slope) - 1) > LEAST_SCALE for found in known.values()):
            yield _counts(known, where, encoder)
        elif all(apart(study, joint, found) for joint, found in known.items()):
            yield _zeros(
                {joint: apart(study, joint, found) for joint, found in known.items()}, where, encoder
            )
    if n == 2:
        yield from _counters_swapped(encoder)


def _turned(joints: tuple[int, ...], where: str, encoder: EncoderSetup) -> Hypothesis:
    direction, zero = list(encoder.direction), encoder.zero_rad
    for joint in joints:
        direction[joint] *= -1

    def mend(theta: Floats) -> Floats:
        theta = theta.copy()
        for joint in joints:
            theta[:, joint] = 2 * zero[joint] - theta[:, joint]
        return theta

    return counted(
        "angle.sign",
        where,
        f"the module's encoder counts the other way ({where})",
        mend,
        f"setup.toml: [encoder] direction = {direction}",
        (Change("encoder", "direction", direction),),
    )


def _zeros(offsets: dict[int, float], where: str, encoder: EncoderSetup) -> Hypothesis:
    zeros = list(encoder.zero_rad)
    for joint, offset in offsets.items():
        zeros[joint] = round(zeros[joint] + offset, 4)

    def mend(theta: Floats) -> Floats:
        theta = theta.copy()
        for joint, offset in offsets.items():
            theta[:, joint] += offset
        return theta

    said = ", ".join(f"{-offset:+.3f} rad on joint {joint + 1}" for joint, offset in offsets.items())
    return counted(
        "angle.zero",
        where,
        f"zero_rad is off by {said}, against the controller's angle",
        mend,
        f"setup.toml: [encoder] zero_rad = {zeros}",
        (Change("encoder", "zero_rad", zeros),),
    )


def _counts(known: dict[int, Relation], where: str, encoder: EncoderSetup) -> Hypothesis:
    """Other numbers of counts per turn, about the declared zeros."""
    counts, direction, zero = list(encoder.counts_per_rev), list(encoder.direction), encoder.zero_rad
    scale = {}
    for joint, found in known.items():
        factor = factor_of(abs(found.slope))
        scale[joint] = factor.value * float(np.sign(found.slope))
        counts[joint] = float(f"{counts[joint] / factor.value:.8g}")
        direction[joint] = int(direction[joint] * np.sign(found.slope))
    changes: tuple[Change, ...] = (Change("encoder", "counts_per_rev", counts),)
    keys = f"counts_per_rev = {counts}"
    if direction != list(encoder.direction):
        changes += (Change("encoder", "direction", direction),)
        keys += f", direction = {direction}"

    def mend(theta: Floats) -> Floats:
        theta = theta.copy()
        for joint, k in scale.items():
            theta[:, joint] = zero[joint] + k * (theta[:, joint] - zero[joint])
        return theta

    said = " and ".join(factor_of(abs(found.slope)).words for found in known.values())
    return counted(
        "angle.scale",
        where,
        f"counts_per_rev is {said} times too large",
        mend,
        f"setup.toml: [encoder] {keys}",
        changes,
    )


def _counters_swapped(encoder: EncoderSetup) -> Iterator[Hypothesis]:
    z, per, way = encoder.zero_rad, encoder.counts_per_rev, encoder.direction

    def swap(theta: Floats) -> Floats:
        counts = [(theta[:, j] - z[j]) * way[j] * per[j] for j in range(2)]
        return np.stack([z[0] + way[0] * counts[1] / per[0], z[1] + way[1] * counts[0] / per[1]], axis=1)

    yield counted(
        "angle.swapped",
        "joint1+joint2",
        "enc1 and enc2 are swapped",
        swap,
        "device.csv: swap the columns enc1 and enc2 (and the plugs at the module)",
    )
    turned = [z[1], z[0]], [per[1], per[0]], [way[1], way[0]]
    yield counted(
        "angle.swapped",
        "joint1+joint2",
        "enc1 and enc2 are swapped, and so is [encoder]",
        lambda theta: theta[:, ::-1],
        f"device.csv: swap enc1 and enc2; setup.toml: [encoder] zero_rad = {turned[0]}, "
        f"counts_per_rev = {turned[1]}, direction = {turned[2]}",
        odds=0.5,
    )
