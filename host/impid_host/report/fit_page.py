"""All that `impid-host fit` prints, table after table."""

from collections.abc import Iterator, Sequence

from rich.console import Console, RenderableType
from rich.table import Table

from impid_host.impedance.campaign import StudyFit
from impid_host.impedance.constrained import Constrained
from impid_host.impedance.identify import LoadFit, RobotFit
from impid_host.impedance.joint_space import JointImpedance
from impid_host.report.check_tables import with_marks
from impid_host.report.fit_tables import (
    constrained_table,
    force_table,
    joint_table,
    load_table,
    partial_table,
    robot_table,
    spectral_table,
)
from impid_host.report.physical_table import physical_table

_ROBOT_WORDS = {
    "prior": "Robot parameters from [prior] in setup.toml; their uncertainty is unknown and not propagated.",
    "saved model": "Robot parameters from the saved model, with their uncertainty.",
    "unknown": "No free trial and no [prior]: the robot is unknown, only Method 2 (force sensor) serves.",
    "none": "No free trial: the measured torque is taken to be the load's alone.",
}


def print_fit(
    console: Console,
    result: StudyFit,
    constrained: Sequence[Constrained] = (),
    joints: Sequence[JointImpedance] = (),
    *,
    marked: bool = False,
) -> None:
    """Print every table of a study with an empty line between them.

    Args:
        marked: mark every number, since something about the study contradicts itself or physics.
    """
    for part in _parts(result, constrained, joints):
        console.print(with_marks(part) if marked and isinstance(part, Table) else part, markup=False)
        console.print()


def _parts(
    result: StudyFit, constrained: Sequence[Constrained], joints: Sequence[JointImpedance]
) -> Iterator[RenderableType]:
    if isinstance(result.robot, RobotFit):
        yield robot_table(result.robot)
        if result.physical is not None:
            yield physical_table(result.robot, result.physical)
    else:
        yield _ROBOT_WORDS[result.robot.origin]
    for load in dict.fromkeys(fit.load for fit in result.loads):
        fits = [fit for fit in result.loads if fit.load == load]
        yield load_table(fits)
        pairs = _pairs(fits, constrained)
        if pairs:
            yield constrained_table(pairs)
        own = [joint for joint in joints if joint.load == load]
        if own:
            yield joint_table(own)
        shaken = [fit for fit in result.spectral if fit.load == load]
        if shaken:
            yield spectral_table(shaken)
    for fit in result.partial:
        yield partial_table(fit)
    for compared in result.forces:
        yield force_table(compared)


def _pairs(fits: Sequence[LoadFit], constrained: Sequence[Constrained]) -> list[tuple[LoadFit, Constrained]]:
    return [
        (fit, tight)
        for fit in fits
        for tight in constrained
        if (tight.load, tight.method) == (fit.load, fit.method)
    ]
