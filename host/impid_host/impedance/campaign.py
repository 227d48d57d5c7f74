"""A whole study through the identification: align every trial, the robot first, then load by load."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.estimators.choose import Regression
from impid_host.impedance.estimators.estimated import EstimatorWish
from impid_host.impedance.force import ForceComparison, compare_forces
from impid_host.impedance.identify import LoadFit, RobotFit, RobotParameters
from impid_host.impedance.loads import LoadKind, LoadModel, load_model
from impid_host.impedance.partial import PartialLoadFit, identify_partially
from impid_host.impedance.physical import PhysicalRobot, physical_robot
from impid_host.impedance.rows import Split
from impid_host.robot.model import RobotModel, robot_model, torque_at_load
from impid_host.robot.terms import RobotStructure, robot_structure
from impid_host.signals.align import AccelerationSource, AlignedTrial, align, robot_rows
from impid_host.signals.band import HIGHEST_OF_RATE, following, motion_band_hz
from impid_host.signals.chain import DEFAULT, Chain
from impid_host.study.model import Setup, Study

if TYPE_CHECKING:
    from impid_host.impedance.stochastic import SpectralFit


@dataclass(frozen=True, slots=True)
class Options:
    """How a study is to be fitted.

    Attributes:
        chain: the signal chain; `default_chain` has the cut-off that a study's motion asks for.
        acceleration: where accelerations come from; None: the accelerometer where there is one.
        terms: optional terms of the robot model, by name.
        split: what is held out.
        physical: also the nearest robot whose links could be built.
        estimator: of the robot from free trials and of every load.
    """

    chain: Chain = DEFAULT
    acceleration: AccelerationSource | None = None
    terms: tuple[str, ...] = ()
    split: Split = field(default_factory=Split)
    physical: bool = False
    estimator: EstimatorWish = "least-squares"

    @property
    def regression(self) -> Regression:
        """What estimates robot and loads."""
        return Regression(self.estimator, self.chain, self.split)


@dataclass(frozen=True, slots=True)
class StudyFit:
    """All that `fit` found out about a study; `robot` is a RobotFit unless the prior had to stand in.

    `partial` holds the loads whose trials do not determine all of them; `cutoff_hz` is the chain's, where its
    last filter has one; `forces` sets the virtual sensor against a physical one, load by load; `physical` is
    there where it was asked for.
    """

    study: str
    chain: str
    trials: tuple[AlignedTrial, ...]
    robot: RobotFit | RobotParameters
    loads: tuple[LoadFit, ...]
    spectral: "tuple[SpectralFit, ...]" = ()
    handle_mass_kg: float = 0.0
    cutoff_hz: float | None = None
    partial: tuple[PartialLoadFit, ...] = ()
    forces: tuple[ForceComparison, ...] = ()
    physical: PhysicalRobot | None = None


def default_chain(study: Study) -> Chain:
    """The default chain, its cut-off following the motion of free trials, or of a limb that is moved."""
    kinds = [trial.kind for trial in study.trials]
    limb = torque_at_load(robot_model(study.setup.robot), kinds)
    trials = study.of_kind("arm") if limb else study.of_kind("free")
    logs = [log for log in (robot_rows(trial.robot) for trial in trials) if len(log) >= _FEWEST_ROWS]
    chain = following(DEFAULT, [motion_band_hz(log.t, log.theta) for log in logs])
    shown = min((HIGHEST_OF_RATE / float(np.median(np.diff(log.t))) for log in logs), default=np.inf)
    return chain if chain.cutoff_hz <= shown else chain.with_cutoff(shown)


_FEWEST_ROWS = 100
Progress = Callable[[str], None]


def _silent(_words: str) -> None:
    return


def fit_study(study: Study, options: Options, progress: Progress = _silent) -> StudyFit:
    """Identify the robot from the free trials (or take the prior), then every load by each method.

    Args:
        progress: told what is being worked on.

    Raises:
        UndeterminedError: neither free trials nor a prior, or the data do not determine what was asked.
    """
    model = robot_model(study.setup.robot)
    trials = []
    for trial in study.trials:
        progress(f"aligning {trial.name}")
        trials.append(align(trial, study.setup, model, options.chain, options.acceleration))
    return fit_aligned(study, trials, options, progress)


def fit_aligned(
    study: Study,
    trials: Sequence[AlignedTrial],
    options: Options,
    progress: Progress = _silent,
    robot: RobotFit | RobotParameters | None = None,
) -> StudyFit:
    """The same from trials that are aligned already.

    Args:
        robot: known from elsewhere; by default identified from the free trials, or the prior.

    Raises:
        UndeterminedError: as `fit_study`.
    """
    model = robot_model(study.setup.robot)
    structure = robot_structure(model, options.terms)
    progress("identifying the robot")
    free = [trial for trial in trials if trial.kind == "free"]
    if robot is None and free:
        robot = options.regression.robot(free, structure)
    elif robot is None:
        robot = prior_parameters(study, structure)
    parameters = robot.parameters if isinstance(robot, RobotFit) else robot
    physical = None
    if options.physical:
        if not free or not isinstance(robot, RobotFit):
            raise UndeterminedError(
                f"study {study.name}: physical inertias are found from free trials, of which it has none"
            )
        progress("links that could be built")
        physical = physical_robot(robot, free, options.chain, options.split)
    loads: list[LoadFit] = []
    spectral: list[SpectralFit] = []
    partial: list[PartialLoadFit] = []
    forces: list[ForceComparison] = []
    for members in loads_of(list(trials)):
        progress(f"identifying {members[0].load}")
        kind = kind_of_load(study, members)
        measured = _measured(members, model)
        if measured:
            forces.append(compare_forces(measured, parameters, options.chain, options.split))
        try:
            loads += fit_load(members, study.setup, model, parameters, options, kind)
        except UndeterminedError as error:
            partial += fit_partially(members, model, parameters, options, error, kind)
            continue
        if members[0].kind == "stochastic":
            progress(f"spectra of {members[0].load}")
            spectral += fit_shaken(study, members, model, parameters, options)
    return StudyFit(
        study.name,
        options.chain.name,
        tuple(trials),
        robot,
        tuple(loads),
        tuple(spectral),
        study.setup.handle_mass_kg,
        None if options.chain.finish is None else options.chain.cutoff_hz,
        tuple(partial),
        tuple(forces),
        physical,
    )


def fit_load(
    members: list[AlignedTrial],
    setup: Setup,
    model: RobotModel,
    robot: RobotParameters,
    options: Options,
    kind: LoadKind | None = None,
) -> list[LoadFit]:
    """One load by Method 1, and by Method 2 over those of its trials that have forces.

    `kind` says what the load is; by default it is what its trials are.

    A torque that is measured at the load itself leaves nothing but Method 2.

    Raises:
        UndeterminedError: the load's trials are of more than one kind.
    """
    load, rounds = model_and_rounds(members, model, robot, kind)
    return [
        options.regression.load(part, load, robot.structure, known, robot, setup.handle_mass_kg)
        for part, known in rounds
    ]


def fit_partially(
    members: list[AlignedTrial],
    model: RobotModel,
    robot: RobotParameters,
    options: Options,
    error: UndeterminedError,
    kind: LoadKind | None = None,
) -> list[PartialLoadFit]:
    """What the trials do determine of a load that `fit_load` refused with `error`.

    Raises:
        UndeterminedError: `error`, where open combinations were not its reason.
    """
    load, rounds = model_and_rounds(members, model, robot, kind)
    return [
        identify_partially(part, load, options.chain, options.split, robot=known, error=error)
        for part, known in rounds
    ]


def model_and_rounds(
    members: list[AlignedTrial], model: RobotModel, robot: RobotParameters, kind: LoadKind | None
) -> tuple[LoadModel, list[tuple[list[AlignedTrial], RobotParameters | None]]]:
    """The load's model, and which trials serve which method."""
    kinds = {trial.kind for trial in members}
    if len(kinds) > 1:
        raise UndeterminedError(
            f"load {members[0].load} has trials of kinds {', '.join(sorted(kinds))}; name them apart"
        )
    load = load_model(kind or kinds.pop(), tuple(model.task_axes))
    return load, _rounds(members, _measured(members, model), robot)


def _measured(members: Sequence[AlignedTrial], model: RobotModel) -> list[AlignedTrial]:
    """Trials with a force along each task axis; a log's fx, fy are forces in the plane."""
    planar = len(model.task_axes) == 2
    return [trial for trial in members if planar and trial.force is not None]


def fit_shaken(
    study: Study,
    members: list[AlignedTrial],
    model: RobotModel,
    robot: RobotParameters,
    options: Options,
) -> "list[SpectralFit]":
    """One load's stochastic trials by the spectral method, by either sensor where there are two.

    Raises:
        UndeterminedError: the trials are too short or too poor for spectra.
    """
    from impid_host.impedance.stochastic import fit_spectral, shaken  # noqa: PLC0415  (slow to import)

    named = {trial.name: trial for trial in study.trials}
    wide = {one.name: shaken(named[one.name], study.setup, model, options.acceleration) for one in members}
    measured = [trial for trial in members if trial.force is not None]
    return [
        fit_spectral(
            part,
            [wide[one.name] for one in part],
            kind_of_load(study, members),
            options.chain,
            options.split,
            robot=known,
            handle_mass_kg=study.setup.handle_mass_kg,
        )
        for part, known in _rounds(members, measured, robot)
    ]


def _rounds(
    members: list[AlignedTrial], measured: list[AlignedTrial], robot: RobotParameters
) -> list[tuple[list[AlignedTrial], RobotParameters | None]]:
    """Method 1 over all trials where the robot is known, Method 2 over those with forces."""
    rounds: list[tuple[list[AlignedTrial], RobotParameters | None]] = []
    if robot.origin != "unknown":
        rounds.append((members, robot))
    if measured:
        rounds.append((measured, None))
    if not rounds:
        raise UndeterminedError(
            f"load {members[0].load}: no forces in its trials, no free trial and no [prior], so its force is "
            "unknown; record a free trial"
        )
    return rounds


def prior_parameters(study: Study, structure: RobotStructure) -> RobotParameters:
    """Robot parameters from setup.toml, where a study has no free trials.

    Raises:
        UndeterminedError: no prior, or one that does not fit the model.
    """
    prior = study.setup.prior_alpha
    size = len(structure.parameter_names)
    if prior is None and structure.model.torque_at_load:
        return RobotParameters(structure, np.zeros(size), np.zeros((size, size)), "none")
    if prior is None and any(trial.robot.force is not None for trial in study.trials):
        return RobotParameters(structure, np.full(size, np.nan), np.zeros((size, size)), "unknown")
    if prior is None:
        raise UndeterminedError(
            f"study {study.name}: no free trial and no [prior] alpha in setup.toml, so the robot is unknown; "
            "record a free trial"
        )
    if len(prior) != size:
        raise UndeterminedError(
            f"study {study.name}: [prior] alpha has {len(prior)} values, the model with its terms needs "
            f"{size}: {', '.join(structure.parameter_names)}"
        )
    return RobotParameters(structure, np.array(prior), np.zeros((size, size)), "prior")


def kind_of_load(study: Study, members: list[AlignedTrial]) -> LoadKind:
    """What the load is: a stochastic trial says it under `on`."""
    trial = next(trial for trial in study.trials if trial.name == members[0].name)
    kind = trial.on if trial.kind == "stochastic" else trial.kind
    return "mass-spring" if kind == "mass-spring" else "arm"


def loads_of(aligned: list[AlignedTrial]) -> list[list[AlignedTrial]]:
    """Trials with a load, grouped by its name; stochastic trials apart from the others of the same name."""
    groups: dict[tuple[str, bool], list[AlignedTrial]] = {}
    for trial in aligned:
        if trial.kind != "free":
            groups.setdefault((trial.load, trial.kind == "stochastic"), []).append(trial)
    shared = {load for load, stochastic in groups if stochastic and (load, False) in groups}
    return [
        [replace(trial, load=f"{load}_stochastic") for trial in members]
        if stochastic and load in shared
        else members
        for (load, stochastic), members in groups.items()
    ]
