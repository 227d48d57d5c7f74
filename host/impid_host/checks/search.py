"""The mistakes tried on a study: one is believed where it explains nearly all that nothing else does.

All hypotheses are scored by the same joint fit. The best is believed, undone, and the search goes on with
what is left, since a laboratory may have made two.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from impid_host.checks.equations import Motions
from impid_host.checks.factors import LIKELY, Factor, nearest
from impid_host.checks.joint_fit import JointFit, fit_jointly, payloads
from impid_host.checks.mistakes import accelerometer, angle, force, geometry, torque, trial
from impid_host.checks.mistakes.hypothesis import Hypothesis, in_one_trial
from impid_host.checks.signals import Signals
from impid_host.study.model import Setup

# A study whose channels explain each other this far is in order, and nothing is tried on it.
IN_ORDER = 0.03
# log(r^2) summed over channels: a mistake must explain as much as one channel from all to a fifth.
LEAST_GAIN = 3.2
# What a mistake explains it explains to this, or by this factor.
LEFT = 0.15
TIMES = 3.0
TIE = 1.6
MOST = 3
_ROUNDS = 3
# A change that mends a number leaves every channel at least as well explained, but for chance.
_NO_WORSE = 1.1
# Only a study as bad as this has angles that are wrong in every log alike.
GRAVE = 0.25
_MECHANICS = ("tau", "fx", "fy")


@dataclass(frozen=True, slots=True)
class Found:
    """One mistake that is believed, and what would explain the study as well.

    Attributes:
        before, after: the joint fit without and with the change.
        rivals: hypotheses of nearly the same score.
    """

    mistake: Hypothesis
    before: JointFit
    after: JointFit
    rivals: tuple[Hypothesis, ...]

    @property
    def impossible(self) -> bool:
        """Whether physics says so, and not only another measurement."""
        return len(self.after.violations) < len(self.before.violations)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What the search came to: the mistakes, and the study with all of them undone."""

    found: tuple[Found, ...]
    study: Signals
    fit: JointFit


def search(study: Signals, setup: Setup, motions: Motions) -> Outcome:
    """Find the mistakes of a study, one after the other."""
    first = Outcome((), study, fit_jointly(study, motions))
    found: list[Found] = []
    fit = first.fit
    for _ in range(_ROUNDS):
        if in_order(fit):
            break
        best = _best(study, setup, motions, fit)
        if best is None:
            break
        found.append(best)
        study, fit = best.mistake.mend(study), best.after
    if any(_by_mechanics_alone(one) for one in found) and not _hangs_together(first.fit, fit):
        return first
    return Outcome(tuple(found), study, fit)


def _hangs_together(before: JointFit, after: JointFit) -> bool:
    """Whether torques and forces are explained with all mistakes undone, or far better than before.

    In a study of which much is left whatever is tried, the change that helps most is not what was done.
    """
    return all(
        r < GRAVE or r * TIMES < before.left.get(channel, 0.0)
        for channel, r in after.left.items()
        if channel.startswith(_MECHANICS)
    )


def _by_mechanics_alone(found: Found) -> bool:
    """Whether nothing but torques and forces speaks for a mistake."""
    before, after = found.before.left, found.after.left
    return all(
        c.startswith(_MECHANICS) for c, r in before.items() if r > max(1.5 * after.get(c, r), IN_ORDER)
    )


def in_order(fit: JointFit) -> bool:
    """Nothing impossible, and every channel explained by the others."""
    return not fit.violations and fit.worst < IN_ORDER


@dataclass(frozen=True, slots=True)
class _Scored:
    mistake: Hypothesis
    fit: JointFit

    @property
    def score(self) -> float:
        return self.fit.score + self.mistake.odds


def _best(study: Signals, setup: Setup, motions: Motions, before: JointFit) -> Found | None:
    """Study-wide mistakes first; labels of trials, then mistakes within one, where those leave something."""
    scored: list[_Scored] = []
    for stage in (_study_wide, _labels, _in_one_trial):
        tried = stage(study, setup, motions, before)
        scored += [_Scored(one, _fitted(one, study, motions)) for one in tried]
        accepted = [one for one in scored if _explains(before, one.fit, one.mistake)]
        if any(in_order(one.fit) for one in accepted):
            break
    if not accepted:
        return None
    accepted.sort(key=lambda one: one.score)
    best = accepted[0]
    rivals: list[Hypothesis] = []
    for one in accepted[1:]:
        named = {best.mistake.label, *(rival.label for rival in rivals)}
        if one.score < best.score + TIE and one.mistake.label not in named:
            rivals.append(one.mistake)
    return Found(best.mistake, before, best.fit, tuple(rivals[: MOST - 1]))


def _explains(before: JointFit, after: JointFit, mistake: Hypothesis) -> bool:
    """Whether a change makes the study much better, and good where it makes it better and where it acts."""
    if before.score - after.score - mistake.odds < LEAST_GAIN:
        return False
    better = [
        channel
        for channel, r in after.left.items()
        if channel in before.left and before.left[channel] > max(1.5 * r, IN_ORDER)
    ]
    worse = any(r > 2 * before.left.get(channel, 0.0) and r > 0.1 for channel, r in after.left.items())
    worse |= bool({one.where for one in after.violations} - {one.where for one in before.violations})
    changed = {channel for channel in after.left if channel.split()[0] in _joints(mistake.where)}
    acted_on = {*better, *changed}
    far = [c for c in acted_on if after.left[c] * TIMES >= before.left.get(c, 0.0)]
    # A weak joint's noise beside others that are explained is no reason for doubt.
    good = not far or (all(after.left[c] < GRAVE for c in far) and _mean(after, acted_on) < LEFT)
    return not worse and ((bool(better) and good) or _makes_possible(before, after, mistake))


def _mean(fit: JointFit, channels: set[str]) -> float:
    return float(np.sqrt(np.mean([fit.left[channel] ** 2 for channel in channels])))


def _makes_possible(before: JointFit, after: JointFit, mistake: Hypothesis) -> bool:
    """Whether impossible numbers of what the change touches are gone, all explained no worse than before.

    Of a channel of which much is left either way a change of sign says nothing: that a number comes out
    possible then is chance.
    """
    touched = _joints(mistake.where)
    gone = {one.where for one in before.violations} - {one.where for one in after.violations}
    mended = {joint for where in gone for joint in _joints(where)}
    judged = [channel for channel in after.left if channel.split()[0] in touched | mended]
    return (
        len(after.violations) < len(before.violations)
        and (not touched or not mended or bool(touched & mended))
        and all(after.left[channel] < GRAVE for channel in judged)
        and all(after.left[channel] < max(_NO_WORSE * r, IN_ORDER) for channel, r in before.left.items())
    )


def _joints(where: str) -> set[str]:
    """Torques of the joints that a place names."""
    return {f"tau{part[5:]}" for part in where.split("+") if part.startswith("joint")}


def _fitted(one: Hypothesis, study: Signals, motions: Motions) -> JointFit:
    return fit_jointly(one.mend(study), motions.child())


def _study_wide(study: Signals, setup: Setup, motions: Motions, before: JointFit) -> Iterator[Hypothesis]:
    """The families that could mend a channel that is off."""
    off = {channel[:2] for channel, r in before.left.items() if r > IN_ORDER}
    if before.violations:
        off |= {"ta"}
    mechanics = off & {"ta", "fx", "fy", "pa"}
    if off & {"th", "ze"} or off & {"ax", "ay"} or mechanics:
        agree = not off & {"th", "ze"}
        yield from angle.hypotheses(study, setup.encoder, agree=agree, grave=before.worst > GRAVE)
    if off & {"ax", "ay"}:
        yield from accelerometer.hypotheses(study, motions, setup.accelerometer)
    if mechanics:
        factors = torque_factors(study, motions, before)
        yield from torque.hypotheses(study, factors)
        yield from force.hypotheses(study, motions)
        yield from trial.payload(study, factors)
    yield from geometry.hypotheses(study, motions, length_factors(study, motions))


def _labels(study: Signals, _setup: Setup, _motions: Motions, _before: JointFit) -> Iterator[Hypothesis]:
    if len(study.trials) > 1:
        for one in study.trials:
            yield from trial.relabelled(study, one)


def _in_one_trial(study: Signals, setup: Setup, motions: Motions, before: JointFit) -> Iterator[Hypothesis]:
    """The mistakes of channels, in each trial without which the rest is far better."""
    if len(study.trials) < 3:
        return
    for one in study.trials:
        rest = study.with_trials(tuple(other for other in study.trials if other is not one))
        without = fit_jointly(rest, motions.child())
        if before.score - without.score < LEAST_GAIN:
            continue
        alone = study.with_trials((one,))
        # The robot from the others, the force sensor's map from this one.
        with_robot = study.with_trials(
            tuple(other for other in study.trials if other is one or other.kind == "free")
        )
        whole = [
            *torque.hypotheses(alone, LIKELY),
            *angle.hypotheses(alone, setup.encoder, agree=False, grave=False),
            *(force.hypotheses(with_robot, motions.child()) if one.kind != "free" else ()),
        ]
        yield from (in_one_trial(mistake, one.name) for mistake in whole if mistake.one_trial)


def torque_factors(study: Signals, motions: Motions, before: JointFit) -> tuple[Factor, ...]:
    """Factors on all torques that a weighed payload, a force sensor or the robot's size suggest."""
    found: list[Factor] = []
    for ratio in _mass_ratios(study, motions):
        _append(found, nearest(ratio))
    gain = _force_gain(study, motions)
    if gain is not None:
        _append(found, nearest(1 / gain))
    if any(one.odd_size for one in before.violations):
        for value in (1e3, 1e-3):
            _append(found, nearest(value))
    return tuple(found)


def _append(found: list[Factor], factor: Factor | None) -> None:
    if factor is not None and all(abs(factor.value / other.value - 1) > 0.05 for other in found):
        found.append(factor)


def length_factors(study: Signals, motions: Motions) -> tuple[float, ...]:
    """Factors on both lengths that scales, force sensor or accelerometer suggest: M goes with 1 / l^2."""
    found = [float(np.sqrt(ratio)) for ratio in _mass_ratios(study, motions) if ratio > 0]
    gain = _force_gain(study, motions)
    if gain is not None:
        found.append(1 / gain)
    accelerations = accelerometer.acceleration_map(study, motions, study.mount)
    if accelerations is not None:
        found.append(float(np.sqrt(abs(np.linalg.det(accelerations.raw)))))
    return tuple(scale for scale in found if np.isfinite(scale) and 1e-4 < scale < 1e4)


def _mass_ratios(study: Signals, motions: Motions) -> list[float]:
    """Fitted over weighed mass, load by load; the fit knows nothing of the scales."""
    weighed = payloads(study)
    if not weighed:
        return []
    bare = study.with_trials(tuple(replace(one, payload_kg=None) for one in study.trials))
    fit = fit_jointly(bare, motions)
    return [abs(float(fit.loads[name][0])) / kg for name, kg in weighed.items() if name in fit.loads]


def _force_gain(study: Signals, motions: Motions) -> float | None:
    """Force sensor over torques, if their map is one."""
    robot = force.by_torques(study, motions) if force.has_force(study) else None
    if robot is None:
        return None
    maps = [force.force_map(study, motions, robot, frame) for frame in force.FRAMES]
    good = [found for found in maps if found is not None and found.is_map]
    if not good:
        return None
    best = min(good, key=lambda found: float(found.left.max()))
    return float(np.sqrt(abs(np.linalg.det(best.raw))))
