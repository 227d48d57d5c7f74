"""The papers' model as one linear regression over all trials: the robot's alpha shared, each load its own."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impid_host.effects.effect import Term
from impid_host.effects.view import Columns, View
from impid_host.impedance.loads import LoadModel, load_model
from impid_host.robot.model import RobotModel, torque_at_load
from impid_host.robot.terms import RobotStructure, robot_structure
from impid_host.signals.arrays import Floats
from impid_host.study.model import Setup


@dataclass(frozen=True, slots=True)
class Base:
    """Columns: alpha (p), then the parameters of each load in order.

    Attributes:
        structure: the robot model, with what the textbook's model holds beside it.
        bare: nothing of the robot stands between torque sensor and load, and alpha's columns are zero.
    """

    structure: RobotStructure
    loads: tuple[tuple[str, LoadModel], ...]
    bare: bool = False

    @property
    def model(self) -> RobotModel:
        """The robot."""
        return self.structure.model

    @property
    def robot(self) -> int:
        """How many parameters the robot has."""
        return len(self.structure.parameter_names)

    @property
    def size(self) -> int:
        """How many columns."""
        return self.robot + sum(len(load.columns) for _, load in self.loads)

    def slot(self, name: str) -> slice:
        """Columns of the named load."""
        begin = self.robot
        for other, load in self.loads:
            if other == name:
                return slice(begin, begin + len(load.columns))
            begin += len(load.columns)
        raise KeyError(name)

    def columns(self, view: View) -> Columns:
        """tau = Y alpha + J^T A lambda, and -F of a force sensor = A lambda: family -> (N, c, size)."""
        Y = replace(self.structure, model=view.model).regressor(view.theta, view.omega, view.acc, view.dt)
        torque = np.zeros((*Y.shape[:2], self.size))
        if not self.bare:
            torque[:, :, : Y.shape[2]] = Y
        result = {"torque": torque}
        if view.load is not None:
            A = dict(self.loads)[view.load].regressor(view.x, view.v, view.a)
            torque[:, :, self.slot(view.load)] = np.einsum("kij,kiq->kjq", view.J, A)
            if view.force is not None:
                force = np.zeros((len(view.t), A.shape[1], self.size))
                force[:, :, self.slot(view.load)] = A
                result["force"] = force
        return result

    def predicted(self, view: View, value: Floats) -> Columns:
        """`columns` times `value`, without forming them: family -> (N, c)."""
        Y = replace(self.structure, model=view.model).regressor(view.theta, view.omega, view.acc, view.dt)
        torque = np.zeros(Y.shape[:2]) if self.bare else Y @ value[: Y.shape[2]]
        result = {"torque": torque}
        if view.load is not None:
            A = dict(self.loads)[view.load].regressor(view.x, view.v, view.a)
            force = A @ value[self.slot(view.load)]
            result["torque"] = torque + np.einsum("kij,ki->kj", view.J, force)
            if view.force is not None:
                result["force"] = force
        return result

    def informed(self, view: View, value: Floats) -> View:
        """The view with the model's torque, equilibrium and response at `value` in it."""

        def respond(other: View) -> Columns:
            answer = self.predicted(other, value)
            if other.predicted is not None:
                answer["specific_force"] = other.predicted
            return answer

        x0, K = view.x0, view.K
        if view.load is not None:
            load = dict(self.loads)[view.load]
            x0, K = equilibrium(load, value[self.slot(view.load)])
        response = respond(view)
        torque = response["torque"]
        alpha = value[: self.robot]
        return replace(view, torque_model=torque, x0=x0, K=K, respond=respond, response=response, alpha=alpha)


def equilibrium(load: LoadModel, value: Floats) -> tuple[Floats, Floats]:
    """x0 (d,) and K (d, d) of a load's parameters; where nothing pulls back, x0 is the nearest place."""
    d = len(load.axes)
    K = (load.matrix_map("x") @ value).reshape(d, d)
    return np.asarray(np.linalg.lstsq(K, value[load.place], rcond=1e-10)[0], dtype=np.float64), K


def base_of(parts: Sequence[View], structure: RobotStructure, *, prior: bool = False) -> Base:
    """The model of all trials of a study.

    Args:
        prior: the robot is known from earlier.
    """
    model = structure.model
    kinds = {view.load: view.kind for view in parts if view.load is not None}
    # Where the torque is measured at the joint itself, only free trials or a prior say what else it moves.
    bare = not prior and torque_at_load(model, {view.kind for view in parts})
    loads = tuple((name, load_model(kind, tuple(model.task_axes))) for name, kind in sorted(kinds.items()))
    return Base(structure, loads, bare)


def baseline(setup: Setup, model: RobotModel, *, given: bool = False) -> str:
    """What a diagnosis starts from, "papers" or "textbook": as setup.toml says, else by the robot.

    Args:
        given: no trial shows the robot, so that it is what [prior] says of it: no dry friction where that has
            none.
    """
    prior = setup.prior_alpha
    bare = given and prior is not None and len(prior) == len(model.parameter_names)
    return setup.robot.baseline or ("papers" if bare else model.baseline)


TEXTBOOK = ("friction.coulomb", "actuator.offset")
"""What a textbook's model holds beside inertia, gravity and viscous friction, per joint."""


def textbook_structure(model: RobotModel) -> RobotStructure:
    """Inertia, gravity, viscous and dry friction, offset, per joint.

    An arm's setup says which way it is pulled; a single joint's does not, so its weight stands there always.
    """
    return replace(robot_structure(model, TEXTBOOK), gravity=model.task_is_rotary)


def structure_of(setup: Setup, model: RobotModel, *, given: bool = False) -> RobotStructure:
    """The robot's model that a diagnosis starts from; see `baseline`."""
    return structure_named(baseline(setup, model, given=given), model)


def structure_named(name: str, model: RobotModel) -> RobotStructure:
    """The model of "papers" or "textbook"."""
    return textbook_structure(model) if name == "textbook" else robot_structure(model)


def lacking(base: Base, tried: Iterable[Term]) -> list[Term]:
    """The terms that the robot's model has not got already: what it holds is no discovery."""
    held = {term.name for term in base.structure.terms}
    return [term for term in tried if term.effect not in held or term.when != "all"]


def targets(view: View) -> Mapping[str, Floats]:
    """What was measured, by family, (N, c): torque, specific force, robot's angle minus module's, -force."""
    result = {"torque": view.tau}
    if view.measured is not None and view.predicted is not None:
        result["specific_force"] = view.measured - view.predicted
    if view.theta_robot is not None:
        result["angle"] = view.theta_robot - view.theta
    if view.force is not None and view.load is not None:
        result["force"] = -view.force
    return result
