"""What goes wrong with link lengths: order, unit, and a rule that was held badly."""

from collections.abc import Iterator

import numpy as np

from impid_host.checks.check import Change
from impid_host.checks.equations import Motions, low, turned
from impid_host.checks.factors import KNOWN, nearest
from impid_host.checks.mistakes.hypothesis import Hypothesis
from impid_host.checks.signals import Signals

LEAST = 0.06  # below it is a tolerance, which `diagnose` estimates


def hypotheses(study: Signals, motions: Motions, common: tuple[float, ...]) -> Iterator[Hypothesis]:
    """Other lengths.

    Args:
        common: factors on both lengths that a weighed payload, a force sensor or the accelerometer suggest.
    """
    lengths = study.robot.link_lengths_m
    if len(lengths) != 2:
        return
    yield _lengths("links.swapped", "joint1+joint2", "the two link lengths are swapped", lengths[::-1])
    for scale in common:
        factor = nearest(1 / scale)
        if factor in KNOWN:
            new = tuple(float(f"{length / factor.value:.6g}") for length in lengths)
            said = f"the link lengths are {factor.words} times too large"
            yield _lengths("links.unit", "joint1+joint2", said, new)
        elif abs(scale - 1) > LEAST:
            new = tuple(round(length * scale, 4) for length in lengths)
            said = f"both links are {100 * (1 / scale - 1):+.1f} % off"
            yield _lengths("links.length", "joint1+joint2", said, new, 0.2)
    found = by_accelerometer(study, motions)
    if found is None:
        return
    off = [abs(new / old - 1) > LEAST for new, old in zip(found, lengths, strict=True)]
    for k in (0, 1):
        if not off[k]:
            continue
        one, factor = list(lengths), nearest(lengths[k] / found[k])
        if factor in KNOWN:
            one[k] = float(f"{lengths[k] / factor.value:.6g}")
            said = f"the length of link {k + 1} is {factor.words} times too large"
            yield _lengths("links.unit", f"joint{k + 1}", said, tuple(one), 0.1)
        else:
            one[k] = round(found[k], 4)
            said = f"link {k + 1} is {100 * (lengths[k] / found[k] - 1):+.1f} % off"
            yield _lengths("links.length", f"joint{k + 1}", said, tuple(one), 0.2)
    if all(off):
        said = "both link lengths are off"
        yield _lengths("links.length", "joint1+joint2", said, tuple(round(new, 4) for new in found), 0.5)


def by_accelerometer(study: Signals, motions: Motions) -> tuple[float, float] | None:
    """Link lengths by which the encoders' accelerations are the accelerometer's, m."""
    bare = [study.with_lengths((1.0, 1e-9)), study.with_lengths((1e-9, 1.0))]
    rows, readings = [], []
    for trial in study.trials:
        if trial.acceleration is None:
            continue
        columns = []
        for one in bare:
            felt = motions.of(trial, one).felt
            if felt is None:
                return None
            columns.append(turned(felt[study.mount], -study.mount_angle))
        rows.append(np.stack(columns, axis=2))
        readings.append(low(trial.acceleration))
    if not rows:
        return None
    design, reading = np.concatenate(rows), np.concatenate(readings)
    design, reading = design - design.mean(axis=0), reading - reading.mean(axis=0)
    value, *_ = np.linalg.lstsq(design.reshape(-1, 2), reading.ravel(), rcond=None)
    return (float(value[0]), float(value[1])) if np.all(value > 0.02) else None


def _lengths(what: str, where: str, words: str, new: tuple[float, ...], odds: float = 0.0) -> Hypothesis:
    return Hypothesis(
        what,
        where,
        words,
        lambda study: study.with_lengths(new),
        f"setup.toml: [robot] link_lengths_m = {list(new)}",
        (Change("robot", "link_lengths_m", list(new)),),
        odds,
    )
