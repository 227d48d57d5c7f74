"""An effect: a row of the catalogue, and the terms by which a model may hold it.

A term owns all that anybody asks about it: what it adds to which measurement, in which trials, the bounds of
its parameters, how it is taken out of a signal exactly, what it holds of other effects by its equation. Code
elsewhere asks these properties and never a name.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from impid_host.effects.view import Columns, View
from impid_host.signals.arrays import Floats

Plain = float | list[float] | list[list[float]]
Value = Plain | dict[str, Plain]
"""A reported parameter; where trials or loads have one each, by their name."""
When = Literal["all", "free", "load"]
Carries = Literal["machine", "record", "load"]
Kind = tuple[str, tuple[str, ...], str, When]
Fit = Callable[[View, float], Columns]
Read = Callable[[Floats, float], Mapping[str, Value]]
Gate = Callable[[Floats, float], bool]
Undo = Callable[[View, Floats, float], View]

UNATTRIBUTED = "unattributed"


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter as diagnosis-format names it; SI unit; `low` and `high` bound what is physical.

    Attributes:
        amplitude: an effect is not there where this is zero, so that its interval must exclude zero.
        least: half width of the region of practical equivalence: nobody would care about less.
        none: the value at which the effect is not there.
    """

    name: str
    unit: str
    low: float = -np.inf
    high: float = np.inf
    amplitude: bool = False
    least: float = 0.0
    none: float = 0.0


@dataclass(frozen=True, slots=True)
class Setting:
    """What of the apparatus decides which terms make sense.

    Attributes:
        joints: number of joints; slides: which of them are prismatic, n of them.
        planar: two task axes; axes: how many there are; rotary_load: the load is a torque at the joint;
            bare: that torque is measured, and no drive stands between sensor and load.
        gravity: the robot's model has gravity already.
        links_m: declared link lengths, m.
        span: range of each joint's angle, rad (m), (n,).
        speed: 95th percentile of each joint's speed, rad/s (m/s), (n,).
        reach: range of the end-effector in load trials, m; 0 without load trials.
        springs, arms: names of the loads of either kind; trials: names of all trials; loaded: of those under
            load.
        accelerometer, second_clock, force_sensor: what there is.
        referenced: a weighed payload or an earlier robot is known, so that common factors show.
        duration_s: of the longest trial.
        held: effects that the robot's model has already, on every joint.
    """

    joints: int
    slides: tuple[bool, ...]
    planar: bool
    axes: int
    rotary_load: bool
    bare: bool
    gravity: bool
    links_m: tuple[float, ...]
    span: Floats
    speed: Floats
    reach: float
    springs: tuple[str, ...]
    arms: tuple[str, ...]
    trials: tuple[str, ...]
    loaded: tuple[str, ...]
    accelerometer: bool
    second_clock: bool
    force_sensor: bool
    referenced: bool
    duration_s: float
    held: frozenset[str] = frozenset()

    def at_ranges(self, other: "Ranges") -> "Setting":
        """The same apparatus, moved as in another record: terms that follow the motion are that record's."""
        return replace(
            self,
            span=np.array(other.span),
            speed=np.array(other.speed),
            reach=other.reach,
            duration_s=other.duration_s,
        )

    @property
    def ranges(self) -> "Ranges":
        """How far and fast the motion went."""
        return Ranges(tuple(self.span.tolist()), tuple(self.speed.tolist()), self.reach, self.duration_s)

    @property
    def loads(self) -> tuple[str, ...]:
        """Names of all loads."""
        return (*self.springs, *self.arms)

    @property
    def both(self) -> bool:
        """There are free and loaded trials, so that an effect may be in some of them only."""
        return bool(self.loaded) and len(self.loaded) < len(self.trials)


@dataclass(frozen=True, slots=True)
class Ranges:
    """How far and fast the motion of a record went: what some terms take their forms from; see Setting."""

    span: tuple[float, ...]
    speed: tuple[float, ...]
    reach: float
    duration_s: float


def no_gate(_beta: Floats, _shape: float) -> bool:
    """The gate of a term that any parameters suit."""
    return True


@dataclass(frozen=True, slots=True)
class Term:
    """One way in which an effect may be present: linear parameters beta (q,), at most one non-linear `shape`.

    Attributes:
        where: as diagnosis-format says; when: in which trials it acts.
        columns: what one unit of each linear parameter adds to each family's measurement.
        read: beta and shape -> the parameters that are reported.
        size: q.
        shapes: values of the non-linear parameter to try; one meaningless 0 where there is none.
        gate: whether beta and shape are physically possible beyond the catalogue's bounds.
        nuisance: how many of the columns are of the apparatus, not of the effect: it has them anyway.
        variant: what tells terms of one name and place apart.
        units: of the reported parameters, where they differ from the catalogue's.
        undo: takes the effect out of a trial exactly, where subtracting its columns would not.
        stretch: beta -> by family and channel, the factor by which `undo` scales what was measured, noise
        and all.
        forward: what the effect adds to the model's prediction, exactly, where its columns do to first order.
        moves: `undo` changes the motion, not what was measured: the prediction has it already.
        by_model: its columns follow the present model, which follows its parameters in turn.
        fine: the shape is too fine to be reported, but its neglect would bias the others.
        own: trials or loads that have a value each, in the order of the blocks of beta; empty where one is
            for all.
        holds: labels of effects that the term contains by its equation: nobody can say if they are there.
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
    when: When = "all"
    units: Mapping[str, str] = field(default_factory=dict)
    undo: Undo | None = None
    stretch: Callable[[Floats], Mapping[tuple[str, int], float]] | None = None
    forward: Callable[[View, Floats], Columns] | None = None
    moves: bool = False
    by_model: bool = False
    fine: bool = False
    own: tuple[str, ...] = ()
    holds: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """`name@place`, as in `ambiguous`."""
        return f"{self.effect}@{'+'.join(self.where)}"

    @property
    def kind(self) -> Kind:
        """What the term is whatever its shape: effect, place, variant, and the trials in which it acts."""
        return (self.effect, self.where, self.variant, self.when)

    @property
    def named(self) -> bool:
        """A row of the catalogue, not a structure without a cause."""
        return self.effect != UNATTRIBUTED

    @property
    def shaped(self) -> bool:
        """It has a non-linear parameter."""
        return len(self.shapes) > 1

    @property
    def parameters(self) -> int:
        """How many parameters a score must pay for."""
        return self.size - self.nuisance + self.shaped

    def acts_in(self, view: View) -> bool:
        """Whether the effect may act in this trial."""
        return self.when == "all" or (view.load is None) == (self.when == "free")


@dataclass(frozen=True, slots=True)
class Effect:
    """A row of the catalogue.

    Attributes:
        name: as in diagnosis-format.
        equation: what it adds, and to what.
        acts_on: robot, actuator, sensor, clock or load.
        parameters: with units and bounds.
        source: where the equation is from.
        terms: how it may be present in a study of the given setting.
        carries: what it belongs to: the machine, the record or the load.
        tells: what trial or weighing tells it from others, by their name; "" for any.
        adds_to: matrices of a load to which a parameter of the same name adds.
    """

    name: str
    equation: str
    acts_on: Literal["robot", "actuator", "sensor", "clock", "load"]
    parameters: tuple[Parameter, ...]
    source: str
    terms: Callable[[Setting], Iterable[Term]] = field(repr=False)
    carries: Carries = "machine"
    tells: Mapping[str, str] = field(default_factory=dict)
    adds_to: tuple[str, ...] = ()

    def parameter(self, name: str) -> Parameter:
        """The named parameter."""
        return next(row for row in self.parameters if row.name == name)

    def unit(self, parameter: str) -> str:
        """Unit of the named parameter."""
        return self.parameter(parameter).unit


def joint_name(joint: int) -> str:
    """`joint1` for 0."""
    return f"joint{joint + 1}"


def everywhere(setting: Setting) -> tuple[str, ...]:
    """Names of all joints."""
    return tuple(joint_name(joint) for joint in range(setting.joints))


def each_and_all(numbers: Sequence[int]) -> list[tuple[int, ...]]:
    """Each of some joints (or links) by itself, and where there are several all of them."""
    every = tuple(numbers)
    return [*((one,) for one in every), *([every] if len(every) > 1 else [])]


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


def along(column: Floats, axis: int, axes: int = 2) -> Floats:
    """A vector (N, axes) that has `column` (N,) along one axis."""
    force = np.zeros((len(column), axes))
    force[:, axis] = column
    return force


def amplitude_phase(c: float, s: float) -> tuple[float, float]:
    """c cos(u) + s sin(u) = amplitude * sin(u + phase)."""
    return float(np.hypot(c, s)), float(np.arctan2(c, s))


@dataclass(frozen=True, slots=True)
class Each:
    """Columns of a term with `size` parameters of its own for each of the named trials or loads.

    Attributes:
        inner: the columns of one; key: the name to which a trial belongs.
    """

    inner: Fit
    size: int
    names: tuple[str, ...]
    key: Callable[[View], str | None]

    def first(self, view: View) -> int | None:
        """Where the trial's own parameters begin; None where it has none."""
        name = self.key(view)
        return self.size * self.names.index(name) if name in self.names else None

    def __call__(self, view: View, shape: float) -> Columns:
        """All columns of one trial, those of the others zero."""
        first = self.first(view)
        if first is None:
            return {}
        result = {}
        for family, own in self.inner(view, shape).items():
            result[family] = np.zeros((*own.shape[:2], self.size * len(self.names)))
            result[family][:, :, first : first + self.size] = own
        return result


def each_has_its_own(term: Term, names: Sequence[str], key: Callable[[View], str | None]) -> Term:
    """The term with parameters of its own for each of the named trials or loads.

    Args:
        key: the name to which a trial belongs.
    """
    names = tuple(names)
    place = {name: k for k, name in enumerate(names)}
    q = term.size
    columns = Each(term.columns, q, names, key)

    def block(view: View, beta: Floats) -> Floats | None:
        first = columns.first(view)
        return None if first is None else beta[first : first + q]

    def read(beta: Floats, shape: float) -> dict[str, Value]:
        found: dict[str, dict[str, Plain]] = {}
        for name, k in place.items():
            for parameter, value in term.read(beta[q * k : q * (k + 1)], shape).items():
                assert not isinstance(value, dict)
                found.setdefault(parameter, {})[name] = value
        return dict(found)

    def gate(beta: Floats, shape: float) -> bool:
        return all(term.gate(beta[q * k : q * (k + 1)], shape) for k in range(len(names)))

    undo = term.undo

    def undone(view: View, beta: Floats, shape: float) -> View:
        own = block(view, beta)
        return view if own is None or undo is None else undo(view, own, shape)

    return replace(
        term,
        columns=columns,
        read=read,
        size=q * len(names),
        gate=gate,
        undo=None if undo is None else undone,
        own=names,
        variant=f"{term.variant} each".strip(),
    )


def each_trial(term: Term, setting: Setting, *, loaded: bool = False) -> Term:
    """A value for each trial, or for each trial under load."""
    return each_has_its_own(term, setting.loaded if loaded else setting.trials, lambda view: view.name)


def each_load(term: Term, loads: Sequence[str]) -> Term:
    """A value for each of the loads."""
    return each_has_its_own(term, loads, lambda view: view.load)
