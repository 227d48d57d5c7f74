"""What goes wrong with angles in every log alike, so that module and controller agree."""

from collections.abc import Iterator
from functools import partial
from itertools import combinations

import numpy as np

from impid_host.checks.check import Change
from impid_host.checks.factors import KNOWN
from impid_host.checks.mistakes.angle_maps import LOG, divided, everywhere, moved, on_joint, second_with_first
from impid_host.checks.mistakes.hypothesis import Hypothesis
from impid_host.checks.signals import Signals
from impid_host.study.model import EncoderSetup

_UNITS = tuple(
    factor
    for factor in KNOWN
    if any(abs(factor.value * k - 1) < 1e-6 for k in (np.pi / 180, 1e-3, 2 * np.pi, 2 / 360 * np.pi))
)


def in_every_log(study: Signals, encoder: EncoderSetup | None) -> Iterator[Hypothesis]:
    """Both logs agree, and both are wrong."""
    n = study.model.joints
    for joint in range(n):
        yield everywhere(
            "angle.sign",
            f"joint{joint + 1}",
            f"joint {joint + 1} counts the other way in every log",
            on_joint(joint, lambda angle: -angle),
            _both_sides(encoder, joint, "direction", -1),
            odds=1.0,
        )
        for quarter, words in ((1, "+90"), (2, "180"), (3, "-90")):
            shift = quarter * np.pi / 2 if quarter < 3 else -np.pi / 2
            yield everywhere(
                "angle.zero",
                f"joint{joint + 1}",
                f"the zero of joint {joint + 1} is off by {words} degrees in every log",
                partial(moved, by={joint: shift}),
                _both_sides(encoder, joint, "zero", shift),
                odds=1.5,
            )
    for i, j in combinations(range(n), 2):
        order = [j if k == i else i if k == j else k for k in range(n)]
        module = "" if encoder is None else f", enc{i + 1} and enc{j + 1} in device.csv"
        yield everywhere(
            "angle.swapped",
            f"joint{i + 1}+joint{j + 1}",
            f"joints {i + 1} and {j + 1} are swapped in every log",
            partial(np.take, indices=order, axis=1),
            f"swap theta{i + 1} and theta{j + 1} in robot.csv{module}",
            odds=1.0,
        )
    if n == 2:
        yield from _other_model(study)
        if study.model.name == "planar-2r-absolute":
            for shift in (0.0, np.pi / 2, -np.pi / 2):
                yield everywhere(
                    "angle.frame",
                    "joint2",
                    "joint 2 is measured from link 1",
                    partial(second_with_first, sign=1.0, shift=shift),
                    'setup.toml: [robot] model = "planar-2r-relative" (its joint 2 is 0 where the arm is '
                    "straight)",
                    (Change("robot", "model", "planar-2r-relative"),) if shift else (),
                    odds=1.0,
                )
        if study.model.name == "planar-2r-relative":
            for shift in (0.0, np.pi / 2, -np.pi / 2):
                yield everywhere(
                    "angle.frame",
                    "joint2",
                    "joint 2 is measured from the base",
                    partial(second_with_first, sign=-1.0, shift=shift),
                    'setup.toml: [robot] model = "planar-2r-absolute"',
                    (Change("robot", "model", "planar-2r-absolute"),) if shift else (),
                    odds=1.0,
                )
    for factor in _UNITS:
        yield everywhere(
            "angle.unit",
            "+".join(f"joint{joint + 1}" for joint in range(n)),
            f"all angles are {factor.words} times too large",
            partial(divided, by=factor.value),
            f'{LOG}: theta = {{ column = "...", scale = {1 / factor.value:.6g} }}'
            + ("" if encoder is None else "; setup.toml: [encoder] counts_per_rev by the same factor"),
            odds=1.0,
        )


def _other_model(study: Signals) -> Iterator[Hypothesis]:
    """Angles and torques both as the other of the two planar models has them."""
    other = {"planar-2r-absolute": "planar-2r-relative", "planar-2r-relative": "planar-2r-absolute"}
    name = other.get(study.model.name)
    if name is not None:
        yield Hypothesis(
            "angle.frame",
            "joint2",
            f"the robot is a {name}",
            lambda signals: signals.with_model(name),
            f'setup.toml: [robot] model = "{name}"',
            (Change("robot", "model", name),),
            0.5,
        )


def _both_sides(encoder: EncoderSetup | None, joint: int, what: str, value: float) -> str:
    log = "scale = -1 }" if what == "direction" else f"offset = {value:.4f} }}"
    text = f'{LOG}: theta{joint + 1} = {{ column = "...", {log}'
    if encoder is None:
        return text
    if what == "direction":
        flipped = list(encoder.direction)
        flipped[joint] *= -1
        return f"{text}; setup.toml: [encoder] direction = {flipped}"
    zeros = list(encoder.zero_rad)
    zeros[joint] = round(zeros[joint] + value, 4)
    return f"{text}; setup.toml: [encoder] zero_rad = {zeros}"
