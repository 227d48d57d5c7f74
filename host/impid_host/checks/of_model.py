"""A saved model before the gate: what `judge` is about to predict with is held against physics first."""

from collections.abc import Iterable, Sequence

import numpy as np

from impid_host.checks.check import Checks
from impid_host.checks.gate import RobotNumbers, gate
from impid_host.checks.of_diagnosis import load_numbers
from impid_host.checks.of_effects import bounded
from impid_host.checks.signals import signals_of
from impid_host.diagnosis.result import Chosen
from impid_host.diagnosis.saved import SavedModel
from impid_host.robot.model import robot_model
from impid_host.study.model import Study


def gate_model(saved: SavedModel, studies: Sequence[Study], effects: Iterable[Chosen]) -> Checks:
    """The model's robot where these studies moved it, its loads, and its effects as they went along."""
    signals = [signals_of(study) for study in studies]
    model = robot_model(studies[0].setup.robot)
    theta = [trial.theta for one in signals for trial in one.trials]
    kinds = {trial.load: trial.kind for one in signals for trial in one.trials}
    robot = RobotNumbers(
        saved.structure.of(model),
        saved.names,
        saved.alpha,
        saved.covariance,
        np.concatenate(theta) if theta else np.zeros((0, model.joints)),
    )
    return gate(robot=robot, loads=load_numbers(saved.loads, kinds, model), parameters=bounded(effects))
