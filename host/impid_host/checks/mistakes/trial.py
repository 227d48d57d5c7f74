"""What goes wrong with a trial's label: a load that was not there, or another one, or another mass."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from impid_host.checks.factors import Factor, nearest
from impid_host.checks.mistakes.hypothesis import Hypothesis
from impid_host.checks.signals import Signals, TrialSignals


def relabelled(study: Signals, trial: TrialSignals) -> Iterator[Hypothesis]:
    """Every other label that this study has for one trial, and a load of its own."""
    loads = {other.load: other for other in study.trials if other.kind != "free" and other is not trial}
    if trial.kind != "free":
        yield _as(trial, "free", "free", "trial.kind", "it is a free trial: nothing hangs on the robot")
    what = "trial.kind" if trial.kind == "free" else "trial.load"
    for name, other in loads.items():
        if trial.kind == "free" or name != trial.load:
            said = f"{name} is on the robot" + ("" if trial.kind != "free" else ", it is no free trial")
            yield _as(trial, other.kind, name, what, said)
    shared = sum(other.load == trial.load for other in study.trials) > 1
    if trial.kind == "free" or shared:
        kind = "mass-spring" if trial.kind == "free" else trial.kind
        kind = next((other.kind for other in loads.values()), kind)
        said = "a load of its own is on the robot"
        yield _as(trial, kind, f"{trial.name} (own load)", what, said, odds=1.0)


def payload(study: Signals, seen: tuple[Factor, ...]) -> Iterator[Hypothesis]:
    """A payload weighed in another unit, or weighed wrongly.

    Args:
        seen: fitted over weighed mass, where they are far apart.
    """
    names = [trial.load for trial in study.trials if trial.kind == "mass-spring" and trial.payload_kg]
    for ratio in seen if names else ():
        factor = nearest(1 / ratio.value)
        if factor is None:
            continue
        yield Hypothesis(
            "trial.load",
            "+".join(dict.fromkeys(names)),
            f"the weighed payload is {factor.words} times too large",
            partial(_reweighed, factor=factor),
            "trial.toml: payload_kg "
            + ", ".join(
                f"{t.payload_kg / factor.value:.4g} in {t.name}" for t in study.trials if t.payload_kg
            ),
            odds=0.3,
        )


def _reweighed(study: Signals, *, factor: Factor) -> Signals:
    return study.with_trials(
        tuple(
            replace(trial, payload_kg=trial.payload_kg / factor.value) if trial.payload_kg else trial
            for trial in study.trials
        )
    )


def _as(trial: TrialSignals, kind: str, load: str, what: str, said: str, odds: float = 0.0) -> Hypothesis:
    payload_kg = None

    def mend(study: Signals) -> Signals:
        weighed = next((t.payload_kg for t in study.trials if t.load == load and t.kind == kind), payload_kg)
        return study.with_trials(
            tuple(
                replace(one, kind=kind, load=load, payload_kg=weighed) if one.name == trial.name else one
                for one in study.trials
            )
        )

    keys = f'kind = "{kind}"' + ("" if kind == "free" else f', load = "{load}"')
    return Hypothesis(
        what,
        trial.name,
        f"trial {trial.name} is not what its trial.toml says: {said}",
        mend,
        f"{trial.name}/trial.toml: {keys}",
        odds=odds,
    )
