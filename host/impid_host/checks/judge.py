"""`check_study`: all that can be said about a study before any of its numbers is believed."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from impid_host.checks.check import Check, Checks, Verdict
from impid_host.checks.disagree import disagreements
from impid_host.checks.equations import Motions
from impid_host.checks.joint_fit import JointFit
from impid_host.checks.looks import looks, unmatched
from impid_host.checks.mistakes.hypothesis import Hypothesis
from impid_host.checks.search import Found, search
from impid_host.checks.signals import Signals, signals_of
from impid_host.signals.arrays import Floats
from impid_host.study.model import Study

_ALIKE = 0.8
_TELL = {
    frozenset({"torque", "force"}): "a trial with a weighed payload (payload_kg in its trial.toml)",
    frozenset({"torque", "links"}): "a tape measure on the links, or a weighed payload",
    frozenset({"torque", "trial"}): "weighing the payload again, or a force sensor",
    frozenset({"torque", "angle"}): "a joint turned by hand to an angle that a protractor shows",
    frozenset({"links", "accel"}): "a tape measure on the links, or the accelerometer held against gravity",
    frozenset({"angle"}): "a joint turned by hand to an angle that a protractor shows",
    frozenset({"angle", "accel"}): "a joint turned by hand to an angle that a protractor shows",
    frozenset({"force", "trial"}): "weighing the payload again",
    frozenset({"links", "force"}): "a tape measure on the links, or a weight hung on the force sensor",
    frozenset({"torque"}): "a known weight held by each joint alone",
}


def check_study(study: Study) -> Checks:
    """Look for a laboratory's mistakes in a study; seconds, without the fit's own alignment.

    Nothing is changed. A study that this cannot read onto one clock at all comes back without findings: `fit`
    says what it lacks.
    """
    signals = signals_of(study)
    if not signals.trials:
        return Checks.of(unmatched(study, signals))
    motions = Motions()
    seen = list(looks(study, signals, motions))
    signals = _without(signals, seen)
    unlike = list(_unlike(signals))
    if unlike:
        strangers = {check.where for check in unlike}
        signals = signals.with_trials(tuple(t for t in signals.trials if t.name not in strangers))
        seen += unlike
        if not signals.trials:
            return Checks.of(seen)
    outcome = search(signals, study.setup, motions)
    named = [check for found in outcome.found for check in _said(found)]
    rest = disagreements(outcome.study, outcome.fit, motions, study.setup)
    return Checks.of([*seen, *named, *rest])


def _without(signals: Signals, seen: list[Check]) -> Signals:
    """What was seen to be no measurement takes no part in the search."""
    if any(check.what in ("accel.clipped", "accel.dead") for check in seen):
        trials = tuple(replace(trial, acceleration=None) for trial in signals.trials)
        signals = signals.with_trials(trials)
    resting = {check.where.split("+")[0] for check in seen if check.what == "angle.resting"}
    kept = tuple(trial for trial in signals.trials if trial.name not in resting)
    return signals.with_trials(kept) if kept else signals


def _unlike(signals: Signals) -> Iterator[Check]:
    for trial in signals.trials:
        if trial.counted is None:
            continue
        share = max(_explained(trial.angles, trial.counted))
        if share < _ALIKE:
            yield Check(
                "clocks.disagree",
                trial.name,
                "contradiction",
                f"{trial.name}: module and robot log do not show the same motion (of no joint more than "
                f"{100 * share:.0f} % is alike)",
                {"share": share},
                f"{trial.name}: check that device.csv and robot.csv are of one trial, and the plugs",
            )


def _explained(angles: Floats, counted: Floats) -> list[float]:
    """Share of each of the controller's angles that the module's explain together."""
    design = np.concatenate([counted, np.ones((len(counted), 1))], axis=1)
    value, *_ = np.linalg.lstsq(design, angles, rcond=None)
    rest = np.var(angles - design @ value, axis=0)
    return [float(1 - r / max(v, 1e-12)) for r, v in zip(rest, np.var(angles, axis=0), strict=True)]


def _said(found: Found) -> Iterator[Check]:
    verdict: Verdict = "impossible" if found.impossible else "contradiction"
    everyone = (found.mistake, *found.rivals)
    for one in everyone:
        others = [other for other in everyone if other is not one]
        yield Check(
            one.what,
            one.where,
            verdict,
            _words(one, found.before, found.after, others),
            _evidence(found.before, found.after),
            one.remedy,
            one.changes,
        )


def _words(one: Hypothesis, before: JointFit, after: JointFit, others: list[Hypothesis]) -> str:
    gone = [violation for violation in before.violations if violation not in after.violations]
    why = f"{gone[0].words}; if " if gone else ""
    mended = [c for c, r in before.left.items() if after.left.get(c, r) < 0.7 * r]
    worst = max(mended or before.left, key=lambda channel: before.left[channel])
    share = f"{100 * before.left[worst]:.3g} % of {_channel(worst)} contradicts the rest"
    if not gone:
        why = f"{share}; if "
    text = f"{why}{one.words} and that is mended, {100 * after.left.get(worst, 0.0):.2g} % is left"
    if others:
        families = frozenset(hypothesis.what.split(".")[0] for hypothesis in (one, *others))
        tell = next((words for key, words in _TELL.items() if key == families), "")
        text += f"; {', '.join(other.label for other in others)} would explain as much"
        text += f": {tell} would tell" if tell else ""
    return text


def _channel(name: str) -> str:
    if name.startswith("tau"):
        joint, kind = name.split()
        return f"{joint} ({'free trials' if kind == 'free' else 'under load'})"
    return {
        "ax": "the accelerometer's first axis",
        "ay": "its second axis",
        "payload": "the weighed payload",
    }.get(name, f"the angle of joint {name[-1]}" if name[:-1] in ("theta", "zero") else name)


def _evidence(before: JointFit, after: JointFit) -> dict[str, object]:
    changed = [c for c, r in before.left.items() if abs(r - after.left.get(c, r)) > 0.01]
    evidence: dict[str, object] = {
        "left_now": {c: round(before.left[c], 4) for c in changed},
        "left_if_corrected": {c: round(after.left[c], 4) for c in changed if c in after.left},
        "alpha": before.alpha.tolist(),
        "alpha_if_corrected": after.alpha.tolist(),
    }
    impossible = [violation.words for violation in before.violations]
    if impossible:
        evidence["impossible_now"] = impossible
        evidence["impossible_if_corrected"] = [violation.words for violation in after.violations]
    return evidence
