"""The textbook's model by the estimators of `fit`, on the data of a fit that has been made."""

from dataclasses import replace

from impid_host.diagnosis.base import textbook_structure
from impid_host.errors import UndeterminedError
from impid_host.impedance.campaign import Options, StudyFit, fit_aligned
from impid_host.impedance.identify import RobotFit, identify_robot
from impid_host.robot.model import robot_model
from impid_host.study.model import Study


def textbook_fit(study: Study, fit: StudyFit, options: Options) -> StudyFit | None:
    """The study with the textbook's robot; `fit` itself where the robot was given, None where it fails."""
    if not isinstance(fit.robot, RobotFit):
        return fit
    structure = textbook_structure(robot_model(study.setup.robot))
    free = [trial for trial in fit.trials if trial.kind == "free"]
    try:
        robot = identify_robot(free, structure, options.chain, options.split)
        return fit_aligned(study, fit.trials, replace(options, physical=False), robot=robot)
    except UndeterminedError:
        return None
