"""A whole study through the identification: align every trial, the robot first, then load by load."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.identify import LoadFit, RobotFit, RobotParameters, identify_load, identify_robot
from impid_host.impedance.loads import load_model
from impid_host.impedance.rows import Split
from impid_host.robot.model import RobotModel, robot_model
from impid_host.robot.terms import RobotStructure, robot_structure
from impid_host.signals.align import AccelerationSource, AlignedTrial, align
from impid_host.signals.chain import DEFAULT, Chain
from impid_host.study.model import Setup, Study, Trial


@dataclass(frozen=True, slots=True)
class Options:
    """How a study is to be fitted.

    Attributes:
        chain: the signal chain.
        acceleration: where accelerations come from; None: the accelerometer where there is one.
        terms: optional terms of the robot model, by name.
        split: what is held out.
    """

    chain: Chain = DEFAULT
    acceleration: AccelerationSource | None = None
    terms: tuple[str, ...] = ()
    split: Split = field(default_factory=Split)


@dataclass(frozen=True, slots=True)
class StudyFit:
    """All that `fit` found out about a study; `robot` is a RobotFit unless the prior had to stand in."""

    study: str
    chain: str
    trials: tuple[AlignedTrial, ...]
    robot: RobotFit | RobotParameters
    loads: tuple[LoadFit, ...]


def _silent(_words: str) -> None:
    return


def fit_study(study: Study, options: Options, progress: Callable[[str], None] = _silent) -> StudyFit:
    """Identify the robot from the free trials (or take the prior), then every load by each method.

    Args:
        progress: told what is being worked on.

    Raises:
        UndeterminedError: neither free trials nor a prior, or the data do not determine what was asked.
    """
    model = robot_model(study.setup.robot)
    structure = robot_structure(model, options.terms)
    trials = []
    for trial in study.of_kind("free", "mass-spring", "arm"):
        progress(f"aligning {trial.name}")
        trials.append(align(trial, study.setup, model, options.chain, options.acceleration))
    progress("identifying the robot")
    free = [trial for trial in trials if trial.kind == "free"]
    robot: RobotFit | RobotParameters
    if free:
        robot = identify_robot(free, structure, options.chain, options.split)
        parameters = robot.parameters
    else:
        robot = parameters = prior_parameters(study, structure)
    loads: list[LoadFit] = []
    for members in _by_load(study.of_kind("mass-spring", "arm"), trials):
        progress(f"identifying {members[0].load}")
        loads += fit_load(members, study.setup, model, parameters, options)
    return StudyFit(study.name, options.chain.name, tuple(trials), robot, tuple(loads))


def fit_load(
    members: list[AlignedTrial], setup: Setup, model: RobotModel, robot: RobotParameters, options: Options
) -> list[LoadFit]:
    """One load by Method 1, and by Method 2 over those of its trials that have forces.

    Raises:
        UndeterminedError: the robot model has no plane for the load to move in.
    """
    kinds = {trial.kind for trial in members}
    if len(kinds) > 1:
        raise UndeterminedError(
            f"load {members[0].load} has trials of kinds {', '.join(sorted(kinds))}; name them apart"
        )
    if len(model.task_axes) != 2:
        raise UndeterminedError(
            f"load {members[0].load}: {model.name} has no plane for a {members[0].kind} load"
        )
    load = load_model(kinds.pop())
    measured = [trial for trial in members if trial.force is not None]
    rounds: list[tuple[list[AlignedTrial], RobotParameters | None]] = [(members, robot)]
    if measured:
        rounds.append((measured, None))
    return [
        identify_load(
            part, load, options.chain, options.split, robot=known, handle_mass_kg=setup.handle_mass_kg
        )
        for part, known in rounds
    ]


def prior_parameters(study: Study, structure: RobotStructure) -> RobotParameters:
    """Robot parameters from setup.toml, where a study has no free trials.

    Raises:
        UndeterminedError: no prior, or one that does not fit the model.
    """
    prior = study.setup.prior_alpha
    if prior is None:
        raise UndeterminedError(
            f"study {study.name}: no free trial and no [prior] alpha in setup.toml, so the robot is unknown; "
            "record a free trial"
        )
    if len(prior) != len(structure.parameter_names):
        raise UndeterminedError(
            f"study {study.name}: [prior] alpha has {len(prior)} values, the model with its terms needs "
            f"{len(structure.parameter_names)}: {', '.join(structure.parameter_names)}"
        )
    size = len(prior)
    return RobotParameters(structure, np.array(prior), np.zeros((size, size)), "prior")


def _by_load(trials: tuple[Trial, ...], aligned: list[AlignedTrial]) -> list[list[AlignedTrial]]:
    groups: dict[str, list[AlignedTrial]] = {}
    wanted = {trial.name for trial in trials}
    for trial in aligned:
        if trial.name in wanted:
            groups.setdefault(trial.load, []).append(trial)
    return list(groups.values())
