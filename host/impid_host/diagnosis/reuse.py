"""A model found on one study, used on another: its effects taken out of the signals in which they act."""

from collections.abc import Callable, Collection, Container, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from impid_host.diagnosis.base import Base, base_of, structure_of
from impid_host.diagnosis.case import informed
from impid_host.diagnosis.correct import corrected
from impid_host.diagnosis.holdout import Holdout
from impid_host.diagnosis.parameters import count_of
from impid_host.diagnosis.prepare import setting_of, views
from impid_host.diagnosis.proof import aligned
from impid_host.diagnosis.propagate import moved_fits
from impid_host.diagnosis.result import Chosen
from impid_host.diagnosis.saved import SavedModel, same_files
from impid_host.diagnosis.saved_parts import SavedEffect
from impid_host.effects.catalogue import CATALOGUE, terms
from impid_host.effects.effect import Ranges, Term
from impid_host.effects.view import Columns, View
from impid_host.errors import InputError
from impid_host.impedance.campaign import Options, Progress, StudyFit, fit_aligned
from impid_host.impedance.identify import LoadFit, RobotFit, RobotParameters
from impid_host.impedance.linear import Estimate
from impid_host.impedance.matrices import load_matrices
from impid_host.robot.model import robot_model
from impid_host.robot.terms import robot_structure
from impid_host.signals.align import AlignedTrial
from impid_host.signals.arrays import Floats
from impid_host.study.model import Study

_ROUNDS = 2


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where a fit's model came from.

    Attributes:
        applied: effects taken out of the signals; left_out: those that were not, and why.
        robot: where the robot's parameters came from.
        same_data: files of this study on which the model was found.
    """

    file: str
    study: str
    made_by: str
    applied: tuple[str, ...]
    left_out: tuple[str, ...]
    robot: str
    same_data: tuple[str, ...]

    @property
    def lines(self) -> list[str]:
        """For the reader."""
        effects = ", ".join(self.applied) or "no effects"
        told = [f"Model {self.file} (found on {self.study} by {self.made_by}): {effects} taken out."]
        told += [f"Not used, {line}." for line in self.left_out]
        return [*told, f"Robot parameters from {self.robot}."]

    @property
    def warnings(self) -> list[str]:
        """What a reader must not overlook."""
        if not self.same_data:
            return []
        files = ", ".join(self.same_data[:3]) + (", ..." if len(self.same_data) > 3 else "")
        return [f"{self.file} was found on these very data ({files}): errors on them say nothing of new data"]


@dataclass(frozen=True, slots=True)
class Reused:
    """A fit with a saved model's effects taken out: the fit, those effects, where they came from."""

    fit: StudyFit
    effects: tuple[Chosen, ...]
    provenance: Provenance


def fit_with_model(
    study: Study, saved: SavedModel, options: Options, progress: Progress, *, keep_robot: bool = False
) -> Reused:
    """The study's fit with the saved effects taken out; intervals hold the effects' uncertainty.

    Args:
        keep_robot: take the saved alpha even where there are free trials.

    Raises:
        InputError: the model is of another robot.
        UndeterminedError: as `fit`.
    """
    model = robot_model(study.setup.robot)
    require_same_robot(saved, study)
    if not options.terms:
        # The robot as the saved model describes it: dry friction of a textbook's robot is part of it.
        options = replace(options, terms=tuple(term.name for term in saved.structure.of(model).terms))
    progress("aligning")
    parts, _ = views(study, model, options.chain.cutoff_hz)
    if options.acceleration == "angles":
        parts = [replace(view, measured=None, predicted=None) for view in parts]
    base = base_of(parts, structure_of(study.setup, model), prior=True)
    chosen, left_out = carried(saved.effects, saved.loads, parts, base, saved.ranges)
    known = None
    if keep_robot or all(view.load is not None for view in parts):
        structure = robot_structure(model, options.terms)
        known = _saved_robot(saved, structure.parameter_names)
        robot = RobotParameters(structure, known[0], known[1], "saved model")
    origin = "the saved model" if known is not None else "this study's own trials"

    def fitted(present: Sequence[Chosen]) -> StudyFit:
        trials = cleaned_trials(parts, present, base)
        return fit_aligned(study, trials, options, robot=None if known is None else robot)

    progress("fitting without the effects")
    plain = fitted(chosen)
    progress("propagating the effects' uncertainty")
    result = _widened(plain, chosen, fitted)
    labels = tuple(dict.fromkeys(part.term.label for part in chosen))
    same = same_files(saved, study)
    told = Provenance(saved.path.name, saved.study, saved.made_by, labels, tuple(left_out), origin, same)
    return Reused(result, tuple(chosen), told)


def require_same_robot(saved: SavedModel, study: Study) -> None:
    """Raises InputError where the model is of another robot than the study."""
    own = study.setup.robot
    remedy = "use a model found on this robot (`impid-host diagnose STUDY --save-model`)"
    if saved.robot != own.model:
        raise InputError(saved.path, f"is of a robot {saved.robot}, the study's is {own.model}", remedy)
    if saved.link_lengths_m and not np.allclose(saved.link_lengths_m, own.link_lengths_m, rtol=1e-6):
        told = f"{list(saved.link_lengths_m)} m, the study's {list(own.link_lengths_m)} m"
        raise InputError(saved.path, f"is of a robot with links of {told}", remedy)
    needed = len(saved.structure.of(robot_model(own)).parameter_names)
    if len(saved.alpha) != needed:
        what = f"has {len(saved.alpha)} robot parameters, this robot needs {needed}"
        raise InputError(saved.path, what, remedy)


def terms_of(parts: Sequence[View], base: Base, ranges: Ranges | None) -> list[Term]:
    """All terms on these views, in the forms that they had where the motion had the given ranges."""
    setting = setting_of(parts, base, referenced=True)
    return terms(
        setting if ranges is None or len(ranges.span) != setting.joints else setting.at_ranges(ranges)
    )


def carried(
    effects: Sequence[SavedEffect],
    loads: Iterable[str],
    parts: Sequence[View],
    base: Base,
    ranges: Ranges | None,
) -> tuple[list[Chosen], list[str]]:
    """The saved effects as parts of a model on these views, and those that are not carried over, with why.

    Args:
        loads: on which they were found; ranges: of the motion there.
    """
    tried = terms_of(parts, base, ranges)
    again = {name for name, _ in base.loads} & set(loads)
    chosen, left_out = [], []
    for row in effects:
        part = _carried(row, tried, again)
        if isinstance(part, str):
            left_out.append(f"{row.label}: {part}")
        else:
            chosen.append(replace(part, term=_among(part.term, again)))
    return chosen, left_out


def belongs_to_record(row: SavedEffect, loads: Container[str]) -> bool:
    """Whether another record has another value of it: an offset, a zero, what differs from trial to trial."""
    return CATALOGUE[row.effect].carries == "record" or any(name not in loads for name in row.own)


def _carried(row: SavedEffect, tried: Sequence[Term], again: Collection[str]) -> Chosen | str:
    """The saved effect in these views, or why it is not there."""
    effect = CATALOGUE.get(row.effect)
    if effect is None:
        return "this version of impid does not know it"
    if effect.carries == "record":
        return "it belongs to the recording in which it was found"
    if effect.acts_on == "load" and not again:
        return "it belongs to a load that is not in this study"
    term = matching(row, tried)
    return "this study's instruments do not show it" if term is None else _with_values(row, term)


def _with_values(row: SavedEffect, term: Term) -> Chosen | str:
    if not row.own:
        fits = term.size == len(row.beta)
        reason = "this version of impid describes it otherwise"
        return Chosen(term, row.shape, row.beta, row.covariance) if fits else reason
    beta = _of_the_same(row, term)
    if beta is None:
        return "each trial has its own value of it"
    return Chosen(term, row.shape, beta, np.zeros((len(beta), len(beta))))


def _among(term: Term, loads: Container[str]) -> Term:
    """An effect of a load acts in trials of the loads on which it was found, and in no other."""
    if CATALOGUE[term.effect].acts_on != "load":
        return term
    inner = term.columns

    def columns(view: View, shape: float) -> Columns:
        return inner(view, shape) if view.load in loads else {}

    return replace(term, columns=columns)


def matching(row: SavedEffect, tried: Sequence[Term]) -> Term | None:
    """The term that the saved effect is, acting in the trials in which it was found to act."""
    for term in tried:
        if (term.effect, term.where, term.variant) == (row.effect, row.where, row.variant):
            return replace(term, when=row.when)  # type: ignore[arg-type]
    return None


def _of_the_same(row: SavedEffect, term: Term) -> Floats | None:
    """The values of those trials or loads that are there again, zeros of the others; None where none is."""
    width = len(row.beta) // len(row.own)
    if not term.own or width * len(term.own) != term.size or not set(term.own) & set(row.own):
        return None
    known = dict(zip(row.own, row.beta.reshape(len(row.own), width), strict=True))
    return np.concatenate([known.get(name, np.zeros(width)) for name in term.own])


def cleaned_trials(parts: Sequence[View], chosen: Sequence[Chosen], base: Base) -> list[AlignedTrial]:
    """The trials as they would have been measured without the chosen effects, at the views' rate."""
    everything = Holdout(tuple(view.name for view in parts), ())
    raw = informed(parts, base, everything)
    cleaned = [corrected(view, chosen) for view in raw]
    for _ in range(_ROUNDS - 1):
        # Effects that lean on the model's torque or equilibrium want those without the effects.
        better = informed(cleaned, base, everything)
        raw = [
            replace(view, torque_model=b.torque_model, x0=b.x0, K=b.K, alpha=b.alpha)
            for view, b in zip(raw, better, strict=True)
        ]
        cleaned = [corrected(view, chosen) for view in raw]
    return [aligned(view) for view in cleaned]


def _saved_robot(saved: SavedModel, names: Sequence[str]) -> tuple[Floats, Floats]:
    if len(names) != len(saved.alpha):
        raise InputError(
            saved.path,
            "holds no parameters for the terms of --with",
            "leave --with out, or record free trials",
        )
    return saved.alpha, saved.covariance


def _widened(
    plain: StudyFit, chosen: Sequence[Chosen], fitted: Callable[[Sequence[Chosen]], StudyFit]
) -> StudyFit:
    """Robot and loads with the effects' covariance, taken through the fit by finite differences."""
    if not chosen:
        return plain
    covariance = block_diag(*[_padded(part) for part in chosen])
    steps, _, others = moved_fits(chosen, covariance, fitted, workers=1)

    robot = plain.robot
    moved = [other.robot.estimate for other in others if isinstance(other.robot, RobotFit)]
    if isinstance(robot, RobotFit) and len(moved) == len(others):
        estimate = steps.wider(robot.estimate, robot.estimate, moved)
        if len(estimate.value) == len(robot.parameters.value):
            robot = replace(
                robot,
                estimate=estimate,
                parameters=replace(robot.parameters, covariance=estimate.covariance),
            )
    loads = tuple(
        _with_estimate(
            fit, steps.wider(fit.estimate, fit.estimate, [o.loads[k].estimate for o in others]), plain
        )
        for k, fit in enumerate(plain.loads)
    )
    return replace(plain, robot=robot, loads=loads)


def _padded(part: Chosen) -> Floats:
    """The covariance of all parameters that are moved, zeros of those that were saved without."""
    count = count_of(part)
    result = np.zeros((count, count))
    known = min(count, len(part.covariance))
    result[:known, :known] = part.covariance[:known, :known]
    return result


def _with_estimate(fit: LoadFit, estimate: Estimate, plain: StudyFit) -> LoadFit:
    matrices = load_matrices(fit.model, estimate, plain.handle_mass_kg)
    return replace(fit, estimate=estimate, M=matrices.M, B=matrices.B, K=matrices.K, x0=matrices.x0)
