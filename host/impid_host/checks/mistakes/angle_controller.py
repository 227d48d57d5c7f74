"""What goes wrong with the controller's logged angles; and joint 2 measured otherwise in one log."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from impid_host.checks.factors import KNOWN
from impid_host.checks.mistakes.angle_maps import (
    LEAST_SCALE,
    apart,
    counted,
    factor_of,
    joint_sets,
    logged,
    moved,
    on_joints,
    relation,
    second_with_first,
)
from impid_host.checks.mistakes.hypothesis import Hypothesis
from impid_host.checks.signals import Signals
from impid_host.signals.arrays import Floats


def in_controller(study: Signals) -> Iterator[Hypothesis]:
    n = study.model.joints
    slopes = [relation(study, joint, joint) for joint in range(n)]
    common = [found.slope for found in slopes if found is not None and found.left < 0.2]
    if len(common) == n > 1 and max(common) / min(common) < 1.05 and min(common) > 1.02:
        yield from _rescaled(range(n), float(np.mean(common)))
    for joint in range(n):
        found = slopes[joint]
        if found is not None and found.slope > 0 and abs(found.slope - 1) > LEAST_SCALE:
            yield from _rescaled(range(joint, joint + 1), found.slope)
    for joints in joint_sets(n):
        where = "+".join(f"joint{joint + 1}" for joint in joints)
        yield logged(
            "angle.sign",
            where,
            f"the controller's angle has the other sign ({where})",
            on_joints(joints, lambda angle, _joint: -angle),
            "; ".join(f'theta{joint + 1} = {{ column = "...", scale = -1 }}' for joint in joints),
            odds=0.3,
        )
        offsets = {joint: apart(study, joint, f) for joint in joints if (f := slopes[joint]) is not None}
        if len(offsets) == len(joints) and all(offsets.values()):
            said = ", ".join(f"{offset:+.3f} rad on joint {joint + 1}" for joint, offset in offsets.items())
            yield logged(
                "angle.zero",
                where,
                f"the controller's zero is off by {said}, against zero_rad",
                partial(moved, by={joint: -offset for joint, offset in offsets.items()}),
                "; ".join(
                    f'theta{joint + 1} = {{ column = "...", offset = {-offset:.4f} }}'
                    for joint, offset in offsets.items()
                ),
                odds=0.3,
            )
    if n == 2:
        yield logged(
            "angle.swapped",
            "joint1+joint2",
            "theta1 and theta2 are swapped in the controller's log",
            lambda theta: theta[:, ::-1],
            "give theta1 the column of theta2 and the other way round",
            odds=0.3,
        )
        yield from relative("controller", study)


def _rescaled(joints: range, slope: float) -> Iterator[Hypothesis]:
    factor = factor_of(slope)
    what = "angle.unit" if factor in KNOWN else "angle.scale"

    def mend(theta: Floats) -> Floats:
        theta = theta.copy()
        theta[:, list(joints)] /= factor.value
        return theta

    yield logged(
        what,
        "+".join(f"joint{joint + 1}" for joint in joints),
        f"the controller's angles are {factor.words} times too large",
        mend,
        "; ".join(
            f'theta{joint + 1} = {{ column = "...", '
            + ('unit = "deg" }' if "degrees" in factor.words else f"scale = {1 / factor.value:.6g} }}")
            for joint in joints
        ),
        odds=0.1,
    )


def relative(side: str, study: Signals) -> Iterator[Hypothesis]:
    """One of the two logs has joint 2 measured from link 1, or the other way round."""
    apply = counted if side == "module" else logged
    for sign, words in ((1.0, "relative to link 1"), (-1.0, "from the base")):
        expected = "planar-2r-absolute" if sign > 0 else "planar-2r-relative"
        yield apply(
            "angle.frame",
            "joint2",
            f"the {side}'s angle of joint 2 is measured {words}",
            partial(second_with_first, sign=sign),
            (
                f'theta2 = {{ expression = "theta2 {"+" if sign > 0 else "-"} theta1" }}'
                if side == "controller"
                else "setup.toml: the module counts another angle than [robot] model says; give the model "
                "whose joint 2 is measured so, or move the encoder"
            ),
            odds=0.3 if study.model.name == expected else 1.0,
        )
