"""What goes wrong with angles, in the module's counters, in the controller's log, or in both alike."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from impid_host.checks.check import Change
from impid_host.checks.factors import KNOWN, Factor, nearest
from impid_host.checks.mistakes.hypothesis import Hypothesis
from impid_host.checks.signals import Signals
from impid_host.signals.arrays import Floats
from impid_host.study.model import EncoderSetup

LEAST_ZERO = 0.05
LEAST_SCALE = 0.02
_UNITS = tuple(
    factor
    for factor in KNOWN
    if any(abs(factor.value * k - 1) < 1e-6 for k in (np.pi / 180, 1e-3, 2 * np.pi, 2 / 360 * np.pi))
)
_LOG = "robot.csv, or the mapping it is imported by"


@dataclass(frozen=True, slots=True)
class Relation:
    """controller = slope * module + zero of one joint, over all trials."""

    slope: float
    zero: float
    left: float


def relation(study: Signals, robot_joint: int, module_joint: int) -> Relation | None:
    """Least squares over all trials with one zero; None without a module or without motion."""
    pairs = [
        (trial.counted[:, module_joint], trial.angles[:, robot_joint])
        for trial in study.trials
        if trial.counted is not None and module_joint < trial.counted.shape[1]
    ]
    if not pairs:
        return None
    m, r = (np.concatenate(part) for part in zip(*pairs, strict=True))
    if np.std(m) < 1e-6 or np.std(r) < 1e-6:
        return None
    slope = float(np.cov(m, r)[0, 1] / np.var(m, ddof=1))
    zero = float(np.mean(r) - slope * np.mean(m))
    return Relation(slope, zero, float(np.std(r - slope * m - zero) / np.std(r)))


def hypotheses(
    study: Signals, encoder: EncoderSetup | None, *, agree: bool, grave: bool
) -> Iterator[Hypothesis]:
    """All mistakes of angles that this study could show.

    Args:
        agree: module and controller give the same angles, so that both would be wrong.
        grave: so much is left that the angles may be wrong in every log.
    """
    n = study.model.joints
    counted = any(trial.counted is not None for trial in study.trials)
    if not agree and counted and encoder is not None and len(encoder.counts_per_rev) == n:
        yield from _module(study, encoder)
        yield from _controller(study)
    if agree and grave:
        yield from _both(study, encoder if counted else None)


def _module(study: Signals, encoder: EncoderSetup) -> Iterator[Hypothesis]:
    n = study.model.joints
    relations = [relation(study, joint, joint) for joint in range(n)]
    for joints in _sets(n):
        where = "+".join(f"joint{joint + 1}" for joint in joints)
        yield _turned(joints, where, encoder)
        known = {joint: found for joint in joints if (found := relations[joint]) is not None}
        if len(known) < len(joints):
            continue
        if all(abs(abs(found.slope) - 1) > LEAST_SCALE for found in known.values()):
            yield _counts(known, where, encoder)
        elif all(_apart(study, joint, found) for joint, found in known.items()):
            yield _zeros(
                {joint: _apart(study, joint, found) for joint, found in known.items()}, where, encoder
            )
    if n == 2:
        yield from _counters_swapped(encoder)
        yield from _relative("module", study)


def _sets(n: int) -> list[tuple[int, ...]]:
    """Each joint, and all of them."""
    single: list[tuple[int, ...]] = [(joint,) for joint in range(n)]
    return single if n == 1 else [*single, tuple(range(n))]


def _apart(study: Signals, joint: int, found: Relation) -> float:
    """Controller minus module where their slope is 1 and their zeros are apart; else 0."""
    if abs(found.slope - 1) > LEAST_SCALE:
        return 0.0
    apart = float(
        np.mean(
            [(t.angles[:, joint] - t.counted[:, joint]).mean() for t in study.trials if t.counted is not None]
        )
    )
    return apart if abs(apart) > LEAST_ZERO else 0.0


def _turned(joints: tuple[int, ...], where: str, encoder: EncoderSetup) -> Hypothesis:
    direction, zero = list(encoder.direction), encoder.zero_rad
    for joint in joints:
        direction[joint] *= -1

    def mend(theta: Floats) -> Floats:
        theta = theta.copy()
        for joint in joints:
            theta[:, joint] = 2 * zero[joint] - theta[:, joint]
        return theta

    return _counted(
        "angle.sign",
        where,
        f"the module's encoder counts the other way ({where})",
        mend,
        f"setup.toml: [encoder] direction = {direction}",
        (Change("encoder", "direction", direction),),
    )


def _zeros(apart: dict[int, float], where: str, encoder: EncoderSetup) -> Hypothesis:
    zeros = list(encoder.zero_rad)
    for joint, offset in apart.items():
        zeros[joint] = round(zeros[joint] + offset, 4)

    def mend(theta: Floats) -> Floats:
        theta = theta.copy()
        for joint, offset in apart.items():
            theta[:, joint] += offset
        return theta

    said = ", ".join(f"{-offset:+.3f} rad on joint {joint + 1}" for joint, offset in apart.items())
    return _counted(
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
        factor = _factor(abs(found.slope))
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

    said = " and ".join(_factor(abs(found.slope)).words for found in known.values())
    return _counted(
        "angle.scale",
        where,
        f"counts_per_rev is {said} times too large",
        mend,
        f"setup.toml: [encoder] {keys}",
        changes,
    )


def _factor(slope: float) -> Factor:
    return nearest(slope) or Factor(float(f"{slope:.4g}"), f"{slope:.4g}")


def _counters_swapped(encoder: EncoderSetup) -> Iterator[Hypothesis]:
    z, per, way = encoder.zero_rad, encoder.counts_per_rev, encoder.direction

    def swap(theta: Floats) -> Floats:
        counts = [(theta[:, j] - z[j]) * way[j] * per[j] for j in range(2)]
        return np.stack([z[0] + way[0] * counts[1] / per[0], z[1] + way[1] * counts[0] / per[1]], axis=1)

    yield _counted(
        "angle.swapped",
        "joint1+joint2",
        "enc1 and enc2 are swapped",
        swap,
        "device.csv: swap the columns enc1 and enc2 (and the plugs at the module)",
    )
    turned = [z[1], z[0]], [per[1], per[0]], [way[1], way[0]]
    yield _counted(
        "angle.swapped",
        "joint1+joint2",
        "enc1 and enc2 are swapped, and so is [encoder]",
        lambda theta: theta[:, ::-1],
        f"device.csv: swap enc1 and enc2; setup.toml: [encoder] zero_rad = {turned[0]}, "
        f"counts_per_rev = {turned[1]}, direction = {turned[2]}",
        odds=0.5,
    )


def _controller(study: Signals) -> Iterator[Hypothesis]:
    n = study.model.joints
    slopes = [relation(study, joint, joint) for joint in range(n)]
    common = [found.slope for found in slopes if found is not None and found.left < 0.2]
    if len(common) == n > 1 and max(common) / min(common) < 1.05 and min(common) > 1.02:
        yield from _rescaled(range(n), float(np.mean(common)))
    for joint in range(n):
        found = slopes[joint]
        if found is not None and found.slope > 0 and abs(found.slope - 1) > LEAST_SCALE:
            yield from _rescaled(range(joint, joint + 1), found.slope)
    for joints in _sets(n):
        where = "+".join(f"joint{joint + 1}" for joint in joints)
        yield _logged(
            "angle.sign",
            where,
            f"the controller's angle has the other sign ({where})",
            _on_joints(joints, lambda angle, _joint: -angle),
            "; ".join(f'theta{joint + 1} = {{ column = "...", scale = -1 }}' for joint in joints),
            odds=0.3,
        )
        apart = {joint: _apart(study, joint, f) for joint in joints if (f := slopes[joint]) is not None}
        if len(apart) == len(joints) and all(apart.values()):
            said = ", ".join(f"{offset:+.3f} rad on joint {joint + 1}" for joint, offset in apart.items())
            yield _logged(
                "angle.zero",
                where,
                f"the controller's zero is off by {said}, against zero_rad",
                partial(_moved, by={joint: -offset for joint, offset in apart.items()}),
                "; ".join(
                    f'theta{joint + 1} = {{ column = "...", offset = {-offset:.4f} }}'
                    for joint, offset in apart.items()
                ),
                odds=0.3,
            )
    if n == 2:
        yield _logged(
            "angle.swapped",
            "joint1+joint2",
            "theta1 and theta2 are swapped in the controller's log",
            lambda theta: theta[:, ::-1],
            "give theta1 the column of theta2 and the other way round",
            odds=0.3,
        )
        yield from _relative("controller", study)


def _rescaled(joints: range, slope: float) -> Iterator[Hypothesis]:
    factor = _factor(slope)
    what = "angle.unit" if factor in KNOWN else "angle.scale"

    def mend(theta: Floats) -> Floats:
        theta = theta.copy()
        theta[:, list(joints)] /= factor.value
        return theta

    yield _logged(
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


def _relative(side: str, study: Signals) -> Iterator[Hypothesis]:
    """One of the two logs has joint 2 measured from link 1, or the other way round."""
    apply = _counted if side == "module" else _logged
    for sign, words in ((1.0, "relative to link 1"), (-1.0, "from the base")):
        expected = "planar-2r-absolute" if sign > 0 else "planar-2r-relative"
        yield apply(
            "angle.frame",
            "joint2",
            f"the {side}'s angle of joint 2 is measured {words}",
            partial(_second_with_first, sign=sign),
            (
                f'theta2 = {{ expression = "theta2 {"+" if sign > 0 else "-"} theta1" }}'
                if side == "controller"
                else "setup.toml: the module counts another angle than [robot] model says; give the model "
                "whose joint 2 is measured so, or move the encoder"
            ),
            odds=0.3 if study.model.name == expected else 1.0,
        )


def _both(study: Signals, encoder: EncoderSetup | None) -> Iterator[Hypothesis]:
    """Both logs agree, and both are wrong."""
    n = study.model.joints
    for joint in range(n):
        yield _all(
            "angle.sign",
            f"joint{joint + 1}",
            f"joint {joint + 1} counts the other way in every log",
            _on_joint(joint, lambda angle: -angle),
            _both_sides(encoder, joint, "direction", -1),
            odds=1.0,
        )
        for quarter, words in ((1, "+90"), (2, "180"), (3, "-90")):
            shift = quarter * np.pi / 2 if quarter < 3 else -np.pi / 2
            yield _all(
                "angle.zero",
                f"joint{joint + 1}",
                f"the zero of joint {joint + 1} is off by {words} degrees in every log",
                partial(_moved, by={joint: shift}),
                _both_sides(encoder, joint, "zero", shift),
                odds=1.5,
            )
    if n == 2:
        yield _all(
            "angle.swapped",
            "joint1+joint2",
            "the two joints are swapped in every log",
            lambda theta: theta[:, ::-1],
            "swap theta1 and theta2 in robot.csv, enc1 and enc2 in device.csv",
            odds=1.0,
        )
        if study.model.name == "planar-2r-absolute":
            for shift in (0.0, np.pi / 2, -np.pi / 2):
                yield _all(
                    "angle.frame",
                    "joint2",
                    "joint 2 is measured from link 1",
                    partial(_second_with_first, sign=1.0, shift=shift),
                    'setup.toml: [robot] model = "planar-2r-relative" (its joint 2 is 0 where the arm is '
                    "straight)",
                    (Change("robot", "model", "planar-2r-relative"),) if shift else (),
                    odds=1.0,
                )
        if study.model.name == "planar-2r-relative":
            for shift in (0.0, np.pi / 2, -np.pi / 2):
                yield _all(
                    "angle.frame",
                    "joint2",
                    "joint 2 is measured from the base",
                    partial(_second_with_first, sign=-1.0, shift=shift),
                    'setup.toml: [robot] model = "planar-2r-absolute"',
                    (Change("robot", "model", "planar-2r-absolute"),) if shift else (),
                    odds=1.0,
                )
    for factor in _UNITS:
        yield _all(
            "angle.unit",
            "+".join(f"joint{joint + 1}" for joint in range(n)),
            f"all angles are {factor.words} times too large",
            partial(_divided, by=factor.value),
            f'{_LOG}: theta = {{ column = "...", scale = {1 / factor.value:.6g} }}'
            + ("" if encoder is None else "; setup.toml: [encoder] counts_per_rev by the same factor"),
            odds=1.0,
        )


def _both_sides(encoder: EncoderSetup | None, joint: int, what: str, value: float) -> str:
    log = "scale = -1 }" if what == "direction" else f"offset = {value:.4f} }}"
    text = f'{_LOG}: theta{joint + 1} = {{ column = "...", {log}'
    if encoder is None:
        return text
    if what == "direction":
        flipped = list(encoder.direction)
        flipped[joint] *= -1
        return f"{text}; setup.toml: [encoder] direction = {flipped}"
    zeros = list(encoder.zero_rad)
    zeros[joint] = round(zeros[joint] + value, 4)
    return f"{text}; setup.toml: [encoder] zero_rad = {zeros}"


Angles = Callable[[Floats], Floats]


def _second_with_first(theta: Floats, *, sign: float, shift: float = 0.0) -> Floats:
    """theta2 + sign theta1 + shift in the place of theta2."""
    return np.stack([theta[:, 0], theta[:, 1] + sign * theta[:, 0] + shift], axis=1)


def _moved(theta: Floats, *, by: dict[int, float]) -> Floats:
    """Constants added to some joints."""
    theta = theta.copy()
    for joint, offset in by.items():
        theta[:, joint] += offset
    return theta


def _divided(theta: Floats, *, by: float) -> Floats:
    return theta / by


def _on_joint(joint: int, change: Angles) -> Angles:
    def mend(theta: Floats) -> Floats:
        theta = theta.copy()
        theta[:, joint] = change(theta[:, joint])
        return theta

    return mend


def _on_joints(joints: tuple[int, ...], change: Callable[[Floats, int], Floats]) -> Angles:
    def mend(theta: Floats) -> Floats:
        theta = theta.copy()
        for joint in joints:
            theta[:, joint] = change(theta[:, joint], joint)
        return theta

    return mend


def _counted(
    what: str,
    where: str,
    words: str,
    change: Angles,
    remedy: str,
    changes: tuple[Change, ...] = (),
    odds: float = 0.0,
) -> Hypothesis:
    return Hypothesis(
        what, where, words, lambda study: study.mapped(counted=change), remedy, changes, odds, one_trial=True
    )


def _logged(what: str, where: str, words: str, change: Angles, remedy: str, odds: float = 0.0) -> Hypothesis:
    return Hypothesis(
        what,
        where,
        words,
        lambda study: study.mapped(angles=change),
        f"{_LOG}: {remedy}",
        odds=odds,
        one_trial=True,
    )


def _all(
    what: str,
    where: str,
    words: str,
    change: Angles,
    remedy: str,
    changes: tuple[Change, ...] = (),
    odds: float = 0.0,
) -> Hypothesis:
    return Hypothesis(
        what,
        where,
        words,
        lambda study: study.mapped(counted=change, angles=change),
        remedy,
        changes,
        odds,
    )
