"""A study's loads as curves, after its robot and constant loads have been fitted."""

from impid_host.errors import UndeterminedError
from impid_host.impedance.campaign import Progress, StudyFit, kind_of_load, loads_of, model_and_rounds
from impid_host.impedance.identify import RobotFit, method_of
from impid_host.impedance.varying.fit import VaryingFit, fit_varying
from impid_host.impedance.varying.schedule import Schedule
from impid_host.robot.model import robot_model
from impid_host.signals.chain import Chain
from impid_host.study.model import Study


def _silent(_words: str) -> None:
    return


def vary_study(
    study: Study, fitted: StudyFit, chain: Chain, schedule: Schedule, progress: Progress = _silent
) -> tuple[VaryingFit, ...]:
    """Every load that `fitted` has, by each of its methods, varying with `schedule`.

    By time each trial has curves of its own; by anything else a load's trials share them.

    Raises:
        UndeterminedError: no load, or nothing to vary with; InputError: no such column.
    """
    robot = fitted.robot.parameters if isinstance(fitted.robot, RobotFit) else fitted.robot
    model = robot_model(study.setup.robot)
    raw = {trial.name: trial for trial in study.trials}
    known = {(fit.load, fit.method) for fit in fitted.loads}
    found = []
    for members in loads_of(list(fitted.trials)):
        load, rounds = model_and_rounds(members, model, robot, kind_of_load(study, members))
        for trials, own in rounds:
            if (members[0].load, method_of(load, own)) not in known:
                continue
            parts = schedule.along([(raw[trial.name], trial) for trial in trials])
            for group in [[part] for part in parts] if schedule.each_trial else [parts]:
                progress(
                    f"{group[0].trial.name if schedule.each_trial else members[0].load} by {schedule.by}"
                )
                found.append(
                    fit_varying(
                        group,
                        load,
                        chain,
                        robot=own,
                        by=schedule.by,
                        unit=schedule.unit(load.place_unit),
                        handle_mass_kg=study.setup.handle_mass_kg,
                    )
                )
    if not found:
        raise UndeterminedError(
            f"study {study.name}: no load is determined by its trials, so none can be followed"
        )
    return tuple(found)
