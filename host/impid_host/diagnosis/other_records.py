"""A saved model's error on other records, whole.

Each stage of the model and the textbook's model beside it predict the logged torques (free trials) and forces
(trials under load) of records that took no part in finding them. Nothing is fitted there but, where asked,
what is the record's own. Errors are given in several bands: a model that holds in slow motion may fail in
quick motion.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impid_host.diagnosis.base import Base, base_of
from impid_host.diagnosis.correct import corrected, with_true_model
from impid_host.diagnosis.own_record import own_of_record, refitted
from impid_host.diagnosis.prepare import views
from impid_host.diagnosis.proof import aligned, chain_of, channel
from impid_host.diagnosis.result import Chosen
from impid_host.diagnosis.reuse import carried, require_same_robot
from impid_host.diagnosis.saved import SavedModel, same_files
from impid_host.diagnosis.saved_parts import SavedStage
from impid_host.effects.effect import Ranges
from impid_host.effects.view import View
from impid_host.errors import InputError, UndeterminedError
from impid_host.impedance.identify import RobotParameters, physical_equation, robot_equation, virtual_equation
from impid_host.impedance.rows import finish
from impid_host.robot.model import robot_model
from impid_host.signals.arrays import Floats
from impid_host.signals.band import HIGHEST_OF_RATE
from impid_host.study.model import Study

BANDS_HZ = (4.5, 20.0, 50.0)
_ROUNDS = 2


@dataclass(frozen=True, slots=True)
class Error:
    """What a model leaves of a channel, and the logged signal itself, rms, N m (N)."""

    rms: float
    logged: float

    @property
    def relative_percent(self) -> float | None:
        """100 |y - y^| / |y|; None where nothing was logged but zeros."""
        return 100.0 * self.rms / self.logged if self.logged > 0.0 else None


@dataclass(frozen=True, slots=True)
class StageError:
    """The error of a stage of the model; `added`: what it has beyond the stage before, None for the first."""

    added: str | None
    error: Error


@dataclass(frozen=True, slots=True)
class ChannelErrors:
    """One channel in one band; `textbook` is None where the model holds none."""

    textbook: Error | None
    stages: tuple[StageError, ...]


@dataclass(frozen=True, slots=True)
class Band:
    """All channels below one cut-off."""

    cutoff_hz: float
    channels: Mapping[str, ChannelErrors]


@dataclass(frozen=True, slots=True)
class Judgement:
    """What `impid-host judge` says.

    Attributes:
        model: the file; fitted_on, studies: names.
        skipped_hz: bands above what the logs' rate shows.
        left_out: effects that did not go along, and why; refitted: the record's own, with their values.
        notes: trials that could not be judged; same_data: files on which the model was found.
        prismatic: torques are forces.
        effects: of the last stage, as they went along, or were fitted anew, in each study.
    """

    model: str
    fitted_on: str
    studies: tuple[str, ...]
    bands: tuple[Band, ...]
    skipped_hz: tuple[float, ...]
    left_out: tuple[str, ...]
    refitted: tuple[str, ...]
    notes: tuple[str, ...]
    same_data: tuple[str, ...]
    prismatic: bool
    effects: tuple[Chosen, ...] = ()


@dataclass(frozen=True, slots=True)
class _Sums:
    """Sums of squares of residual and log over `count` instants."""

    residual: float
    logged: float
    count: int

    def __add__(self, other: "_Sums") -> "_Sums":
        return _Sums(self.residual + other.residual, self.logged + other.logged, self.count + other.count)

    @property
    def error(self) -> Error:
        return Error(
            float(np.sqrt(self.residual / self.count)), float(np.sqrt(max(self.logged, 0.0) / self.count))
        )


@dataclass(frozen=True, slots=True)
class _Predicted:
    """A model on a study: views with its effects taken out, views as they were logged, and what it is."""

    clean: tuple[View, ...]
    logged: tuple[View, ...]
    chosen: tuple[Chosen, ...]
    base: Base
    alpha: Floats
    loads: Mapping[str, Floats]


def judge(
    saved: SavedModel,
    studies: Sequence[Study],
    cutoffs_hz: Sequence[float] = BANDS_HZ,
    *,
    refit_record: bool = False,
) -> Judgement:
    """The errors of every stage and of the textbook's model on whole studies, several taken together.

    Args:
        refit_record: fit what is the record's own (offsets, zeros, what differs by trial) anew in each.

    Raises:
        InputError: the model is of another robot, or holds no stages.
        UndeterminedError: a study has nothing to judge, or is too slow for any band.
    """
    if not saved.stages:
        remedy = "write it again with `impid-host diagnose STUDY --save-model` or `fit STUDY --save-model`"
        raise InputError(saved.path, "holds no stages to judge", remedy)
    sums: dict[tuple[float, str, int], _Sums] = {}
    left_out, again, notes = _Lines(), _Lines(), _Lines()
    effects: list[Chosen] = []
    aligned_studies = []
    for study in studies:
        require_same_robot(saved, study)
        aligned_studies.append((study, views(study, robot_model(study.setup.robot))[0]))
    fastest = HIGHEST_OF_RATE * min(view.meeting_hz for _, parts in aligned_studies for view in parts)
    usable = [cutoff for cutoff in cutoffs_hz if cutoff <= fastest]
    if not usable:
        raise UndeterminedError(f"the logs show nothing above {fastest:.3g} Hz; judge in a lower band")
    models = [*([saved.textbook] if saved.textbook is not None else []), *saved.stages]
    first = len(models) - len(saved.stages)
    for study, parts in aligned_studies:
        for number, stage in enumerate(models):
            predicted, lines, own = predict(stage, parts, saved.ranges, refit_record=refit_record)
            left_out.add(study, lines, several=len(studies) > 1)
            again.add(study, own if number == len(models) - 1 else [], several=len(studies) > 1)
            effects += predicted.chosen if number == len(models) - 1 else ()
            for cutoff in usable:
                for key, part in _channels(predicted, cutoff):
                    place = (cutoff, key, number)
                    sums[place] = sums[place] + part if place in sums else part
        unknown = sorted(
            {str(v.load) for v in parts if v.load is not None} - set(saved.stages[-1].load_values)
        )
        notes.add(study, [f"{name} is no load of this model" for name in unknown], several=len(studies) > 1)
    keys = list(dict.fromkeys(key for _, key, _ in sums))
    if not keys:
        raise UndeterminedError(
            "no free trial, no load of this model, no force sensor: nothing can be judged"
        )

    def errors(cutoff: float, key: str) -> ChannelErrors:
        found = [sums[cutoff, key, number].error for number in range(len(models))]
        own = [
            StageError(stage.added, error) for stage, error in zip(saved.stages, found[first:], strict=True)
        ]
        return ChannelErrors(found[0] if first else None, tuple(own))

    return Judgement(
        saved.path.name,
        saved.study,
        tuple(study.name for study in studies),
        tuple(Band(cutoff, {key: errors(cutoff, key) for key in keys}) for cutoff in usable),
        tuple(cutoff for cutoff in cutoffs_hz if cutoff > fastest),
        left_out.all,
        again.all,
        notes.all,
        tuple(name for study in studies for name in same_files(saved, study)),
        all(robot_model(studies[0].setup.robot).prismatic),
        tuple(effects),
    )


class _Lines:
    """What is said, each line once."""

    def __init__(self) -> None:
        self._seen: dict[str, None] = {}

    def add(self, study: Study, lines: Sequence[str], *, several: bool) -> None:
        for line in lines:
            self._seen.setdefault(f"{study.name}: {line}" if several else line)

    @property
    def all(self) -> tuple[str, ...]:
        return tuple(self._seen)


def predict(
    stage: SavedStage, parts: Sequence[View], ranges: Ranges | None, *, refit_record: bool
) -> tuple[_Predicted, list[str], list[str]]:
    """A stage on a study's views, with what was left out and what was fitted anew, in words."""
    structure = stage.structure.of(parts[0].model)
    base = base_of(parts, structure, prior=bool(np.any(stage.alpha)))
    loads = {name: own for name, own in stage.load_values.items() if _is_load(base, name, own)}
    value = np.concatenate(
        [stage.alpha, *(loads.get(name, np.zeros(len(load.columns))) for name, load in base.loads)]
    )
    chosen, left_out = carried(stage.effects, loads, parts, base, ranges)
    words: list[str] = []
    if refit_record:
        own = own_of_record(stage.effects, parts, base, ranges)
        known = [view for view in parts if view.load is None or view.load in loads]
        value, more, words = refitted(known, base, value, chosen, own)
        names = {part.term.label for part in more}
        left_out = [line for line in left_out if line.partition(":")[0] not in names]
        chosen = [*chosen, *more]
    clean = without(parts, base, value, chosen)
    p = base.robot
    own_loads = {name: value[base.slot(name)] for name in loads}
    return _Predicted(tuple(clean), tuple(parts), tuple(chosen), base, value[:p], own_loads), left_out, words


def _is_load(base: Base, name: str, values: Floats) -> bool:
    load = dict(base.loads).get(name)
    return load is not None and len(load.columns) == len(values)


def without(parts: Sequence[View], base: Base, value: Floats, chosen: Sequence[Chosen]) -> list[View]:
    """The views with the model at `value` in them and the effects taken out of what was measured."""
    current = [base.informed(view, value) for view in parts]
    for _ in range(_ROUNDS if any(part.term.by_model for part in chosen) else 1):
        current = [with_true_model(view, chosen, base, value) for view in current]
    return [corrected(view, chosen) for view in current]


def _channels(model: _Predicted, cutoff_hz: float) -> Iterator[tuple[str, _Sums]]:
    """Every channel of every trial, in one band."""
    has_torque = any(view.load is None for view in model.logged)
    known = np.zeros((len(model.alpha), len(model.alpha)))
    for clean, logged in zip(model.clean, model.logged, strict=True):
        view = replace(clean, report_hz=cutoff_hz)
        trial, chain = aligned(view), chain_of(view)
        structure = replace(model.base.structure, model=view.model)
        rows = trial.valid
        if view.load is None:
            equation = robot_equation(trial, structure, chain)
            left = (equation.target - equation.design @ model.alpha) * _logged_units(model.chosen, view)
            log = finish(chain, logged.tau, view.rate_hz)
            for joint in range(view.joints):
                yield f"tau{joint + 1}", _sums(left[rows, joint], log[rows, joint])
            continue
        load = dict(model.base.loads)[view.load]
        robot = RobotParameters(structure, model.alpha, known, "saved model")
        virtual = virtual_equation(trial, robot, load, chain)
        if view.load in model.loads:
            left = virtual.target - virtual.design @ model.loads[view.load]
            yield from _by_axis("f", left[rows], virtual.target[rows], load.axes, has_torque=has_torque)
        if trial.force is not None:
            measured = physical_equation(trial, load, chain).target
            left = virtual.target - measured
            yield from _by_axis("fs", left[rows], measured[rows], load.axes, has_torque=has_torque)


def _by_axis(
    start: str, left: Floats, log: Floats, axes: Sequence[str], *, has_torque: bool
) -> Iterator[tuple[str, _Sums]]:
    for axis, letter in enumerate(axes):
        yield channel(start, letter, has_torque=has_torque), _sums(left[:, axis], log[:, axis])


def _sums(left: Floats, log: Floats) -> _Sums:
    return _Sums(float(left @ left), float(log @ log), len(left))


def _logged_units(chosen: Sequence[Chosen], view: View) -> Floats:
    """By joint, what makes a residual of corrected torques one of the logged torques, (n,)."""
    result = np.ones(view.joints)
    for part in chosen:
        if part.term.stretch is not None and part.term.acts_in(view):
            for (family, joint), factor in part.term.stretch(part.beta).items():
                if family == "torque":
                    result[joint] /= factor
    return result
