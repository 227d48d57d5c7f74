"""What goes wrong with logged torques: sign, order, unit, and whose torque it is."""

from collections.abc import Iterator
from itertools import combinations, product

import numpy as np

from impid_host.checks.factors import LIKELY, Factor
from impid_host.checks.mistakes.hypothesis import Hypothesis
from impid_host.checks.signals import Signals
from impid_host.signals.arrays import Floats

_FILE = "robot.csv, or the mapping it is imported by"


def hypotheses(study: Signals, factors: tuple[Factor, ...]) -> Iterator[Hypothesis]:
    """All mistakes of torques.

    Args:
        factors: that a weighed payload, a force sensor or the robot's size suggest for all torques.
    """
    n = study.model.joints
    yield _linear(
        "torque.sign",
        _joints(range(n)),
        "the torques have the other sign (of the robot on the load's side)",
        -np.eye(n),
        "; ".join(_scaled(joint, -1) for joint in range(n)),
    )
    for joint in range(n) if n > 1 else ():
        flip = np.eye(n)
        flip[joint, joint] = -1
        yield _linear(
            "torque.sign", f"joint{joint + 1}", f"tau{joint + 1} has the other sign", flip, _scaled(joint, -1)
        )
    for i, j in combinations(range(n), 2):
        order = np.eye(n)[[j if k == i else i if k == j else k for k in range(n)]]
        for first, second in product((1, -1), (1, -1)):
            signs = np.ones(n)
            signs[[i, j]] = first, second
            turned = "" if first == second == 1 else f", with signs {first:+d} and {second:+d}"
            yield _linear(
                "torque.swapped",
                f"joint{i + 1}+joint{j + 1}",
                f"tau{i + 1} and tau{j + 1} are swapped{turned}",
                signs[:, None] * order,
                f"give tau{i + 1} the column of tau{j + 1} and the other way round{turned}",
                odds=0.0 if not turned else 0.5,
            )
    yield from _frames(study)
    for factor in factors:
        yield _linear(
            "torque.unit",
            _joints(range(n)),
            f"the torques are {factor.words} times too large",
            np.eye(n) / factor.value,
            "; ".join(_scaled(joint, 1 / factor.value) for joint in range(n)),
            odds=0.0,
        )
    for joint in range(n) if n > 1 else ():
        for factor in LIKELY:
            for sign in (1.0, -1.0):
                scale = np.eye(n)
                scale[joint, joint] = sign / factor.value
                minus = "" if sign > 0 else ", and of the other sign"
                yield _linear(
                    "torque.unit",
                    f"joint{joint + 1}",
                    f"tau{joint + 1} is {factor.words} times too large{minus}",
                    scale,
                    _scaled(joint, sign / factor.value),
                    odds=1.0 if sign > 0 else 1.5,
                )


def _frames(study: Signals) -> Iterator[Hypothesis]:
    """Torques of a drive between the links, or of one that stands at the base."""
    if study.model.joints != 2:
        return
    absolute = study.model.name == "planar-2r-absolute"
    shift = -1.0 if absolute else 1.0
    yield _linear(
        "torque.frame",
        "joint1",
        "the torques belong to "
        + ("relative joints (drive 2 sits on link 1)" if absolute else "absolute joints (both at the base)"),
        np.array([[1.0, shift], [0.0, 1.0]]),
        f'in the mapping: tau1 = {{ expression = "tau1 {"-" if absolute else "+"} tau2" }}; or give '
        f'[robot] model = "planar-2r-{"relative" if absolute else "absolute"}"',
        odds=0.5,
    )
    yield _linear(
        "torque.frame",
        "joint2",
        "tau2 holds both drives' torques",
        np.array([[1.0, 0.0], [-1.0, 1.0]]),
        'in the mapping: tau2 = { expression = "tau2 - tau1" }',
        odds=1.0,
    )


def _linear(what: str, where: str, words: str, matrix: Floats, remedy: str, odds: float = 0.0) -> Hypothesis:
    def mend(study: Signals) -> Signals:
        return study.mapped(torque=lambda torque: torque @ matrix.T)

    return Hypothesis(what, where, words, mend, f"{_FILE}: {remedy}", odds=odds, one_trial=True)


def _scaled(joint: int, scale: float) -> str:
    return f'tau{joint + 1} = {{ column = "...", scale = {scale:.6g} }}'


def _joints(joints: range) -> str:
    return "+".join(f"joint{joint + 1}" for joint in joints) if len(joints) > 1 else "joint1"
