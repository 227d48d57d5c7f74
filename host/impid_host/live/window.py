"""How stiff the load is just now: the fit of a study, on the last seconds of both streams."""

from dataclasses import dataclass

import numpy as np

from impid_host.clock.robot import RobotClockFit
from impid_host.errors import UndeterminedError
from impid_host.impedance.identify import LoadFit, RobotParameters, identify_load
from impid_host.impedance.loads import ARM, load_model
from impid_host.impedance.rows import Split
from impid_host.live.torques import Rows
from impid_host.samples import DeviceSamples
from impid_host.signals.align import align
from impid_host.signals.band import following, motion_band_hz
from impid_host.signals.chain import DEFAULT
from impid_host.study.model import RobotLog, Setup, Trial


@dataclass(frozen=True, slots=True)
class Windowed:
    """What the last seconds told.

    Attributes:
        t_robot: the newest row, s on the robot's clock.
        clock: of the module against the robot's; None where the motion does not tell it.
        load: None where they do not determine it; reason: why.
    """

    t_robot: float
    clock: RobotClockFit | None
    load: LoadFit | None
    reason: str = ""


def look(device: DeviceSamples, rows: Rows, setup: Setup, robot: RobotParameters) -> Windowed:
    """Clock and load by these samples and rows, as `fit` finds them on a trial of that length.

    The load is an arm (full matrices), whatever it is: of a spring's B nothing but noise is left.
    """
    newest = float(rows.t[-1])
    trial = Trial("the last seconds", "arm", "live", RobotLog(rows.t, rows.theta, rows.tau), device)
    model = robot.structure.model
    chain = following(DEFAULT, [motion_band_hz(rows.t, rows.theta)])
    try:
        aligned = align(trial, setup, model, chain)
    except UndeterminedError as error:
        return Windowed(newest, None, None, _short(error))
    try:
        load = identify_load(
            [aligned],
            load_model(ARM.name, tuple(model.task_axes)),
            chain,
            Split(0.0),
            robot=robot,
            handle_mass_kg=setup.handle_mass_kg,
        )
    except (UndeterminedError, np.linalg.LinAlgError) as error:
        return Windowed(newest, aligned.clock, None, _short(error))
    return Windowed(newest, aligned.clock, load)


def _short(error: Exception) -> str:
    return str(error).removeprefix("trial the last seconds: ").removeprefix("load live: ")
