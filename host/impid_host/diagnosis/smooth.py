"""Smooth curves without a cause: what an unknown effect could look like, to be tried beside the catalogue."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from scipy.interpolate import BSpline

from impid_host.diagnosis.dynamic import response_candidates
from impid_host.diagnosis.result import UNATTRIBUTED
from impid_host.effects.effect import Candidate, Setting, sign_mean
from impid_host.effects.view import Columns, View
from impid_host.signals.arrays import Floats

Variable = Callable[[View], Floats]
_COARSE, _FINE = 7, 18
EACH = "torque times time in each trial"


def variables(setting: Setting) -> dict[str, Variable]:
    """What the residual may depend on, by its name in diagnosis-format."""
    result: dict[str, Variable] = {}
    for joint in range(setting.joints):
        result[f"theta{joint + 1}"] = lambda view, joint=joint: view.theta[:, joint]  # type: ignore[misc]
        result[f"omega{joint + 1}"] = lambda view, joint=joint: view.omega[:, joint]  # type: ignore[misc]
    if setting.planar:
        result["x"] = lambda view: view.x[:, 0]
        result["y"] = lambda view: view.x[:, 1]
        result["speed"] = lambda view: np.linalg.norm(view.v, axis=1)
    result["time"] = lambda view: view.t
    return result


def pull(view: View, joint: int, of: str) -> Floats:
    """Size of what presses on a joint's bearings, (N,): its own torque, or the force of the load."""
    if of == "torque":
        return np.asarray(np.abs(view.torque_model[:, joint]))
    if view.load is None:
        return np.zeros_like(view.t)
    force = np.linalg.solve(np.swapaxes(view.J, 1, 2), view.torque_model[:, :, None])[:, :, 0]
    return np.asarray(np.linalg.norm(force, axis=1))


def curve_basis(values: Floats, low: float, high: float, count: int) -> Floats:
    """`count` cubic B-splines over low..high at (N,) values, held at the ends: (N, count)."""
    knots = np.concatenate([[low] * 3, np.linspace(low, high, count - 2), [high] * 3])
    inside = np.clip(values, low, high)
    result: Floats = BSpline.design_matrix(inside, knots, 3).toarray()
    return result


def smooth_candidates(parts: Sequence[View], setting: Setting) -> list[Candidate]:
    """A curve in every variable on every torque channel, and a few products with the direction or speed."""
    result = []
    kinds = ("torque", "force of the load") if setting.planar else ("torque",)
    result += [_friction_by_pull(joint, of) for joint in range(setting.joints) for of in kinds]
    result += [_one_trial(view) for view in parts]
    result += response_candidates(setting)
    result += [_wandering_gain(parts, joint) for joint in range(setting.joints)]
    for name, variable in variables(setting).items():
        values = np.concatenate([variable(view)[view.valid] for view in parts])
        low, high = np.percentile(values, [0.2, 99.8])
        for joint in range(setting.joints):
            own = name in (f"theta{joint + 1}", f"omega{joint + 1}", "time")
            result += list(_curves(name, variable, float(low), float(high), joint, fine=own))
            if name in (f"theta{joint + 1}", "time"):
                result += list(_products(name, variable, float(low), float(high), joint))
    return result


def _curves(
    name: str, variable: Variable, low: float, high: float, joint: int, *, fine: bool
) -> Iterator[Candidate]:
    for count in (_COARSE, _FINE) if fine else (_COARSE,):

        def columns(view: View, _shape: float, count: int = count) -> Columns:
            return _on(view, joint, curve_basis(variable(view), low, high, count))

        yield _candidate(name, joint, columns, count, f"{name} by {count}")


def _one_trial(odd: View) -> Candidate:
    """One trial apart: its own robot parameters, dry friction, springs, offset and slow change."""
    model = odd.model
    size = len(model.parameter_names) + 7 * odd.joints

    def columns(view: View, _shape: float) -> Columns:
        if view.name != odd.name:
            return {}
        Y = model.regressor(view.theta, view.omega, view.acc)
        direction = sign_mean(view.omega, view.acc, view.dt)
        slow = curve_basis(view.t, 0.0, float(view.t[-1]), 5)
        own = [
            _on(view, joint, np.column_stack([direction[:, joint], view.theta[:, joint], slow]))["torque"]
            for joint in range(view.joints)
        ]
        return {"torque": np.concatenate([Y, *own], axis=2)}

    return Candidate(
        UNATTRIBUTED,
        ("tau1", "one_trial"),
        columns,
        lambda _beta, _shape: {},
        size=size,
        variant=odd.name,
    )


def _wandering_gain(parts: Sequence[View], joint: int) -> Candidate:
    """A drive whose gain changes in the course of each trial, in each otherwise."""
    places = {view.name: place for place, view in enumerate(parts)}
    size = _COARSE * len(parts)

    def columns(view: View, _shape: float) -> Columns:
        block = np.zeros((len(view.t), size))
        own = slice(_COARSE * places[view.name], _COARSE * (places[view.name] + 1))
        basis = curve_basis(view.t, 0.0, float(view.t[-1]), _COARSE)
        block[:, own] = basis * view.torque_model[:, [joint]]
        return _on(view, joint, block)

    return _candidate("time", joint, columns, size, EACH)


def _friction_by_pull(joint: int, of: str) -> Candidate:
    def columns(view: View, _shape: float) -> Columns:
        direction = sign_mean(view.omega[:, joint], view.acc[:, joint], view.dt)
        return _on(view, joint, (pull(view, joint, of) * direction)[:, None])

    return _candidate("direction", joint, columns, 1, of)


def _products(name: str, variable: Variable, low: float, high: float, joint: int) -> Iterator[Candidate]:
    factors: dict[str, Variable] = {
        "direction": lambda view: sign_mean(view.omega[:, joint], view.acc[:, joint], view.dt),
        "speed": lambda view: view.omega[:, joint],
    }
    if name == "time":
        # A drive whose gain wanders.
        factors["torque"] = lambda view: view.torque_model[:, joint]
    for word, factor in factors.items():

        def columns(view: View, _shape: float, factor: Variable = factor) -> Columns:
            basis = curve_basis(variable(view), low, high, _COARSE)
            return _on(view, joint, basis * factor(view)[:, None])

        yield _candidate(name, joint, columns, _COARSE, f"{word} times {name}")


def _on(view: View, joint: int, basis: Floats) -> Columns:
    block = np.zeros((len(view.t), view.joints, basis.shape[1]))
    block[:, joint] = basis
    return {"torque": block}


def _candidate(
    name: str, joint: int, columns: Callable[[View, float], Columns], size: int, variant: str
) -> Candidate:
    return Candidate(
        UNATTRIBUTED,
        (f"tau{joint + 1}", name),
        columns,
        lambda _beta, _shape: {},
        size=size,
        variant=variant,
    )
