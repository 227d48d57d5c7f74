"""An effect: a row of the catalogue, and the candidates by which a diagnosis tries it."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from impid_host.effects.view import Columns, View
from impid_host.signals.arrays import Floats

Value = float | list[float] | list[list[float]]
Fit = Callable[[View, float], Columns]
Read = Callable[[Floats, float], Mapping[str, Value]]
Gate = Callable[[Floats, float], bool]


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter as diagnosis-format names it; SI unit; `low` and `high` bound what is physical."""

    name: str
    unit: str
    low: float = -np.inf
    high: float = np.inf


@dataclass(frozen=True, slots=True)
class Setting:
    """What of the apparatus decides which candidates make sense.

    Attributes:
        joints: number of joints; slides: which of them are prismatic, n of them.
        planar: two task axes; axes: how many there are; rotary_load: the load is a torque at the joint;
            bare: that torque is measured, and no drive stands between sensor and load.
        span: range of each joint's angle, rad (m), (n,).
        speed: 95th percentile of each joint's speed, rad/s (m/s), (n,).
        reach: range of the end-effector in load trials, m; 0 without load trials.
        loads: names of the loads, and which load model each has.
        accelerometer, second_clock, force_sensor, spring: what there is.
        duration_s: of the longest trial.
    """

    joints: int
    slides: tuple[bool, ...]
    planar: bool
    axes: int
    rotary_load: bool
    bare: bool
    span: Floats
    speed: Floats
    reach: float
    springs: tuple[str, ...]
    arms: tuple[str, ...]
    accelerometer: bool
    second_clock: bool
    force_sensor: bool
    duration_s: float


def no_gate(_beta: Floats, _shape: float) -> bool:
    """The gate of an effect that any parameters suit."""
    return True


@dataclass(frozen=True, slots=True)
class Candidate:
    """One way in which an effect may be present: linear parameters beta (q,), at most one non-linear `shape`.

    Attributes:
        where: as diagnosis-format says.
        columns: what one unit of each linear parameter adds to each family's measurement.
        read: beta and shape -> the parameters that are reported.
        size: q.
        shapes: values of the non-linear parameter to try; one meaningless 0 where there is none.
        gate: whether beta and shape are physically possible (a friction does not drive).
        nuisance: how many of the columns are of the apparatus, not of the effect: it has them anyway.
        variant: what tells candidates of one name and place apart.
        units: of the reported parameters, where they differ from the catalogue's.
        undo: takes the effect out of a trial exactly, where subtracting its columns would not.
        finer: the same effect with one positive parameter more, too fine to choose by, but whose neglect
            would bias the others; fines: where to begin looking for it.
    """

    effect: str
    where: tuple[str, ...]
    columns: Fit
    read: Read
    size: int = 1
    shapes: tuple[float, ...] = (0.0,)
    gate: Gate = no_gate
    nuisance: int = 0
    variant: str = ""
    units: Mapping[str, str] = field(default_factory=dict)
    undo: Callable[[View, Floats], View] | None = None
    finer: "Callable[[float], Candidate] | None" = None
    fines: tuple[float, ...] = ()

    @property
    def label(self) -> str:
        """`name@place`, as in `ambiguous`."""
        return f"{self.effect}@{'+'.join(self.where)}"


@dataclass(frozen=True, slots=True)
class Effect:
    """A row of the catalogue.

    Attributes:
        name: as in diagnosis-format.
        equation: what it adds, and to what.
        acts_on: robot, actuator, sensor, clock or load.
        parameters: with units and bounds.
        source: where the equation is from.
        candidates: how it may be present in a study of the given setting.
    """

    name: str
    equation: str
    acts_on: str
    parameters: tuple[Parameter, ...]
    source: str
    candidates: Callable[[Setting], Iterable[Candidate]] = field(repr=False)

    def unit(self, parameter: str) -> str:
        """Unit of the named parameter."""
        return next(row.unit for row in self.parameters if row.name == parameter)


def joint_name(joint: int) -> str:
    """`joint1` for 0."""
    return f"joint{joint + 1}"


def on_joint(view: View, joint: int, *columns: Floats) -> Columns:
    """Torques (N,) on one joint."""
    block = np.zeros((len(view.t), view.joints, len(columns)))
    for q, column in enumerate(columns):
        block[:, joint, q] = column
    return {"torque": block}


def at_tip(view: View, *forces: Floats) -> Columns:
    """Forces of the environment (N, d) that the robot must overcome at its end-effector: J^T f."""
    block = np.stack(forces, axis=2)
    return {"torque": np.einsum("kij,kiq->kjq", view.J, block)}


def by_load(view: View, *forces: Floats) -> Columns:
    """Additions (N, d) to -F_ext of the load, felt by robot and force sensor alike; none in free motion."""
    if view.load is None:
        return {}
    block = np.stack(forces, axis=2)
    columns = {"torque": np.einsum("kij,kiq->kjq", view.J, block)}
    if view.force is not None:
        columns["force"] = block
    return columns


def sign_mean(omega: Floats, acc: Floats, dt: float) -> Floats:
    """sign(omega) averaged over the sample, so that a reversal between two instants keeps its time."""
    reach = np.maximum(0.5 * dt * np.abs(acc), 1e-12)
    return np.clip(omega / reach, -1.0, 1.0)


def amplitude_phase(c: float, s: float) -> tuple[float, float]:
    """c cos(u) + s sin(u) = amplitude * sin(u + phase)."""
    return float(np.hypot(c, s)), float(np.arctan2(c, s))
