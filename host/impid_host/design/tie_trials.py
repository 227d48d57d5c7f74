"""The trial that tells a tie's members apart best, by the information that it would add to the study."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from impid_host.design.divergence import Member, least_added
from impid_host.design.tie_file import OpenQuestions
from impid_host.design.tie_members import Known, design_of, known
from impid_host.design.tie_motions import (
    Candidate,
    Limits,
    Motion,
    Usual,
    free_candidates,
    load_candidates,
    weighing,
)
from impid_host.diagnosis.base import Base
from impid_host.diagnosis.case import Case, Progress, prepare, silent, tabulated
from impid_host.diagnosis.holdout import hold_out
from impid_host.diagnosis.noise import whitened
from impid_host.diagnosis.reference import payload_run, reference_run, weighed
from impid_host.diagnosis.rows import rows_of
from impid_host.diagnosis.search import RULES
from impid_host.effects.view import View, with_motion
from impid_host.signals.arrays import Floats
from impid_host.signals.spline import Spline
from impid_host.study.model import Study

_SURE_SIGMAS = 1.645  # one-sided 95 %
# Where the truth predicts D nats better on the average, by one record it does by D +- sqrt(2 D): enough is
# what lies beyond what a diagnosis calls close in nineteen records of twenty.
ENOUGH_NATS = 2.0 * (RULES.close_sigmas + _SURE_SIGMAS) ** 2


@dataclass(frozen=True, slots=True)
class Planned:
    """A candidate as a trial of the study.

    Attributes:
        name: of its folder; kind, load: of its trial.toml, load None in free motion.
        nats: expected for each of the ties.
    """

    candidate: Candidate
    name: str
    kind: str
    load: str | None
    nats: tuple[float, ...] = ()

    @property
    def resolves(self) -> tuple[bool, ...]:
        """Which of the ties it would most likely tell apart."""
        return tuple(own >= ENOUGH_NATS for own in self.nats)

    @property
    def worth(self) -> tuple[int, float]:
        """Ties that it resolves, then nats of all ties together."""
        return sum(self.resolves), sum(self.nats)


def limits_of(
    case: Case,
    *,
    range_rad: float | None,
    speed: float | None,
    duration_s: float | None,
    payloads_kg: Sequence[float],
    rate_hz: float,
) -> Limits:
    """What the user allows; else twice the study's range and speed, and as long as its longest trial."""
    joints = case.base.model.joints
    moved = np.max([np.abs(view.omega[view.valid]).max(axis=0) for view in case.views], axis=0)
    return Limits(
        2 * _usual(_main(case)).range_rad if range_rad is None else np.full(joints, range_rad),
        2 * moved if speed is None else np.full(joints, speed),
        case.setting.duration_s if duration_s is None else duration_s,
        rate_hz,
        tuple(payloads_kg),
    )


def ranked(
    study: Study, case: Case, questions: OpenQuestions, limits: Limits, progress: Progress = silent
) -> list[Planned]:
    """All candidates with what each would add, the best first.

    Raises:
        InputError: the diagnosis is of another study or version.
        UndeterminedError: the study does not determine the robot or a load.
    """
    taps = tabulated(case, progress=progress).noise.taps
    progress("designing", 0.7)
    plans = list(_planned(study, case, limits))
    at = known(_with_plans(study, case, plans), taps, questions)
    result = []
    for k, plan in enumerate(plans):
        progress(f"weighing {plan.candidate.words}", 0.7 + 0.3 * k / len(plans))
        result.append(replace(plan, nats=_nats(study, at, plan)))
    return sorted(result, key=lambda plan: plan.worth, reverse=True)


def prepared(study: Study, questions: OpenQuestions, progress: Progress = silent) -> Case:
    """The study as the diagnosis saw it."""
    return prepare(study, progress, questions.cutoff_hz)


def _main(case: Case) -> list[View]:
    """The trials that say how the robot usually moves: free ones, where there are some."""
    return [view for view in case.views if view.load is None] or list(case.views)


def _usual(parts: Sequence[View]) -> Usual:
    low = np.min([view.theta[view.valid].min(axis=0) for view in parts], axis=0)
    high = np.max([view.theta[view.valid].max(axis=0) for view in parts], axis=0)
    # The reported band is twice that of the motion.
    return Usual(0.5 * (low + high), np.maximum(high - low, 1e-3), 0.5 * parts[0].report_hz)


def _planned(study: Study, case: Case, limits: Limits) -> Iterator[Planned]:
    """Every candidate with the name of its folder, which sorts before all others: the last may be sealed."""
    model = case.base.model
    found: list[tuple[str, str | None, Candidate]] = []
    free = [view for view in case.views if view.load is None]
    if free or not case.base.bare:
        found += [("free", None, own) for own in free_candidates(model, _usual(_main(case)), limits)]
    heavy = weighed(study)
    hung = [name for name, load in case.base.loads if load.name == "mass-spring" and case.setting.planar]
    for name, load in case.base.loads:
        usual = _usual([view for view in case.views if view.load == name])
        weighable = name in hung[:1]
        found += [
            (load.name, name if own.payload_kg is None else f"weighed_{own.payload_kg:g}kg", own)
            for own in load_candidates(model, name, usual, limits, weighable=weighable)
        ]
    found += [("mass-spring", None, own) for own in weighing([name for name in hung if name not in heavy])]
    taken = {trial.name for trial in study.trials}
    for k, (kind, load_name, candidate) in enumerate(found, start=1):
        name = f"00_tie_{k:02d}"
        while name in taken or any(name >= other for other in taken):
            name = f"0{name}" if not name.startswith("0000") else f"!{name}"
        yield Planned(candidate, name, kind, load_name)


def _with_plans(study: Study, case: Case, plans: Sequence[Planned]) -> Case:
    """The case with the loads and trials that there might be."""
    models = dict(case.base.loads)
    fresh = {
        plan.load: models[plan.candidate.load]
        for plan in plans
        if plan.load is not None and plan.candidate.load is not None and plan.load not in models
    }
    base = replace(case.base, loads=(*case.base.loads, *fresh.items()))
    moving = [plan for plan in plans if plan.candidate.motion is not None]
    setting = replace(
        case.setting,
        trials=(*case.setting.trials, *(plan.name for plan in moving)),
        loaded=(*case.setting.loaded, *(plan.name for plan in moving if plan.load is not None)),
        springs=(*case.setting.springs, *fresh),
    )
    return replace(case, base=base, setting=setting, references=reference_run(base, study))


def _nats(study: Study, at: Known, plan: Planned) -> tuple[float, ...]:
    base, size = at.case.base, at.case.base.size
    runs = []
    masses = {name: float(at.plain.base[base.slot(name).start]) for name in plan.candidate.weighed}
    if plan.load is not None and plan.candidate.payload_kg is not None:
        masses[plan.load] = plan.candidate.payload_kg
    if masses:
        runs.append(payload_run(base, masses, study.setup.tolerance.payload_kg))
    if plan.candidate.motion is not None:
        view = _view(at, plan)
        holdout = hold_out([view, *at.case.views])
        runs += whitened(rows_of(view, base, at.slots, holdout), at.taps)
    fresh = design_of(runs, at.slots)
    assert fresh.shape[1] == at.rows.shape[1] >= size
    result = []
    for tie in at.ties:
        pairs = [(_hung(base, plan, one), _hung(base, plan, other)) for one, other in tie.pairs]
        result.append(least_added(at.rows, fresh, pairs))
    return tuple(result)


def _hung(base: Base, plan: Planned, member: Member) -> Member:
    """The explanation with the new payload's values: the old springs and the mass that was weighed."""
    return replace(member, value=_with_payload(base, plan, member.value))


def _with_payload(base: Base, plan: Planned, value: Floats) -> Floats:
    old, mass = plan.candidate.load, plan.candidate.payload_kg
    if plan.load is None or old is None or mass is None:
        return value
    value = value.copy()
    value[base.slot(plan.load)] = value[base.slot(old)]
    value[base.slot(plan.load).start] = mass  # the first column of a mass-spring load is its mass
    return value


def _view(at: Known, plan: Planned) -> View:
    """The trial as it would be logged if the plain model were the whole truth."""
    motion = plan.candidate.motion
    assert motion is not None
    alike = [view for view in at.case.views if view.load == plan.candidate.load] or list(at.case.views)
    view = _moved(alike[0], motion)
    view = replace(view, name=plan.name, kind=plan.kind, load=plan.load)
    if plan.load is None:
        view = replace(view, force=None)
    value = _with_payload(at.case.base, plan, at.plain.base)
    view = at.case.base.informed(view, value)
    assert view.response is not None
    felt = view.response.get("force")
    return replace(
        view,
        tau=view.response["torque"],
        torque_model=view.response["torque"],
        measured=None if view.measured is None else view.predicted,
        theta_robot=None if view.theta_robot is None else view.theta,
        force=None if felt is None else -felt,
    )


def _moved(template: View, motion: Motion) -> View:
    """A trial of the same apparatus with that motion, whatever the template's was."""
    count = int(motion.t[-1] / template.dt) + 1
    rows = np.arange(count) % len(template.t)
    arrays = {
        field.name: value[rows]
        for field in fields(View)
        if isinstance(value := getattr(template, field.name), np.ndarray)
        and value.shape[:1] == template.t.shape
    }
    t: Floats = (template.dt * np.arange(count)).astype(np.float64)
    view = replace(template, **arrays | {"t": t, "valid": np.ones(count, dtype=bool)}, memo={}, response=None)
    theta, omega, acc = (
        Spline(motion.t, block)(t) for block in (motion.theta, motion.omega, motion.theta_dd)
    )
    return with_motion(view, theta, omega, acc)
