"""All that a fit has to show, in one order for the terminal, the page and a notebook."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from rich.console import Console
from rich.table import Table

from impid_host.checks import Agreement
from impid_host.checks.pushes import Pushes
from impid_host.impedance.campaign import StudyFit
from impid_host.impedance.constrained import Constrained
from impid_host.impedance.identify import LoadFit, RobotFit
from impid_host.impedance.joint_space import JointImpedance
from impid_host.impedance.reflex import Band, ReflexFit
from impid_host.impedance.varying.fit import VaryingFit
from impid_host.report.check_tables import agreement_table, with_marks
from impid_host.report.fit_tables import (
    METHODS,
    constrained_table,
    force_table,
    joint_table,
    load_table,
    partial_table,
    robot_table,
    spectral_table,
)
from impid_host.report.physical_table import physical_table
from impid_host.report.push_tables import moved_tables, push_table
from impid_host.report.reflex_report import reflex_table
from impid_host.report.varying_report import varying_table

_ROBOT_WORDS = {
    "prior": "Robot parameters from [prior] in setup.toml; their uncertainty is unknown and not propagated.",
    "saved model": "Robot parameters from the saved model, with their uncertainty.",
    "unknown": "No free trial and no [prior]: the robot is unknown, only Method 2 (force sensor) serves.",
    "none": "No free trial: the measured torque is taken to be the load's alone.",
}


@dataclass(frozen=True, slots=True)
class Besides:
    """What goes with a fit: pushes, what was measured twice, and what was asked for besides."""

    pushes: Pushes = field(default_factory=Pushes)
    agreement: Agreement | None = None
    constrained: Sequence[Constrained] = ()
    joints: Sequence[JointImpedance] = ()
    reflexes: Mapping[str, tuple[ReflexFit, Band]] = field(default_factory=dict)
    curves: Sequence[VaryingFit] = ()


def fit_parts(result: StudyFit, besides: Besides, *, explained: bool = False) -> Iterator[Table | str]:
    """Tables, and sentences where there is no table to show.

    Args:
        explained: say below each load what its intervals hold.
    """
    yield from _of_robot(result)
    for load in dict.fromkeys(fit.load for fit in result.loads):
        yield from _of_load(load, result, besides, explained=explained)
    for fit in result.partial:
        yield partial_table(fit)
    if besides.pushes.found:
        yield push_table(besides.pushes)
        yield from moved_tables(result, besides.pushes)
    for compared in result.forces:
        yield force_table(compared)
    if besides.reflexes:
        yield reflex_table(besides.reflexes)
    for curve in besides.curves:
        yield varying_table(curve)
    if besides.agreement is not None and besides.agreement.pairs:
        yield agreement_table(besides.agreement)


def print_fit(console: Console, result: StudyFit, besides: Besides, *, marked: bool = False) -> None:
    """Print every table of a study with an empty line between them.

    Args:
        marked: mark every number, since something about the study contradicts itself or physics.
    """
    for part in fit_parts(result, besides):
        console.print(with_marks(part) if marked and isinstance(part, Table) else part, markup=False)
        console.print()


def _of_robot(result: StudyFit) -> Iterator[Table | str]:
    if not isinstance(result.robot, RobotFit):
        yield _ROBOT_WORDS[result.robot.origin]
        return
    yield robot_table(result.robot)
    if result.robot.estimated is not None:
        yield str(result.robot.estimated)
    if result.physical is not None:
        yield physical_table(result.robot, result.physical)


def _of_load(load: str, result: StudyFit, besides: Besides, *, explained: bool) -> Iterator[Table | str]:
    fits = [fit for fit in result.loads if fit.load == load]
    yield load_table(fits, explained=explained)
    yield from (f"{METHODS[fit.method]}: {fit.estimated}" for fit in fits if fit.estimated is not None)
    pairs = _pairs(fits, besides.constrained)
    if pairs:
        yield constrained_table(pairs)
    joints = [joint for joint in besides.joints if joint.load == load]
    if joints:
        yield joint_table(joints)
    shaken = [fit for fit in result.spectral if fit.load == load]
    if shaken:
        yield spectral_table(shaken)


def _pairs(fits: Sequence[LoadFit], constrained: Sequence[Constrained]) -> list[tuple[LoadFit, Constrained]]:
    return [
        (fit, tight)
        for fit in fits
        for tight in constrained
        if (tight.load, tight.method) == (fit.load, fit.method)
    ]
