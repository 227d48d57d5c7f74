"""Structures without a cause: what an unknown effect could look like, beside the catalogue from the start.

Curves of place, speed and time, products with the direction or the speed, a response in frequency, a gain
that wanders, an odd trial: a discrepancy in the sense of Kennedy and O'Hagan (J. R. Stat. Soc. B 63, 2001),
in every channel that is measured.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from impid_host.effects.effect import Each, Setting, Term
from impid_host.effects.odd_machine import machine_structures
from impid_host.effects.response import response_terms
from impid_host.effects.unnamed import channel_name, on_channel, unnamed
from impid_host.effects.view import FORCE, SPECIFIC_FORCE, TORQUE, Columns, View
from impid_host.signals.arrays import Floats
from impid_host.signals.direction import sign_mean

Variable = Callable[[View], Floats]
STRAIGHT, COARSE, FINE = 2, 7, 18
EACH = "torque times time in each trial"


def variables(setting: Setting) -> dict[str, Variable]:
    """What the residual may depend on, by its name in diagnosis-format."""
    names = [f"{start}{joint + 1}" for joint in range(setting.joints) for start in ("theta", "omega")]
    names += ["x", "y", "speed"] if setting.planar else []
    return {name: lambda view, name=name: values_of(view, name) for name in (*names, "time")}  # type: ignore[misc]


def values_of(view: View, variable: str) -> Floats:
    """The variable of diagnosis-format at every instant, (N,)."""
    if variable == "time":
        return view.t
    if variable == "speed":
        return np.asarray(np.linalg.norm(view.v, axis=1))
    if variable in ("x", "y"):
        return view.x[:, 0 if variable == "x" else -1]
    signal = view.theta if variable.startswith("theta") else view.omega
    return signal[:, int(variable[-1]) - 1]


def curve_basis(values: Floats, low: float, high: float, count: int) -> Floats:
    """`count` cubic B-splines over low..high at (N,) values, held at the ends: (N, count)."""
    from scipy.interpolate import BSpline  # noqa: PLC0415  (a fifth of a second, for searches alone)

    high = max(high, low + 1e-9)
    knots = np.concatenate([[low] * 3, np.linspace(low, high, count - 2), [high] * 3])
    inside = np.clip(values, low, high)
    result: Floats = BSpline.design_matrix(inside, knots, 3).toarray()
    return result


_CURVE = "curve of "


def _basis(view: View, name: str, variable: Variable, span: tuple[float, float], count: int) -> Floats:
    """`curve_basis` of a variable, remembered until another variable is asked for: many terms share it."""
    key = (f"{_CURVE}{name} to {span[1]!r}", count, span[0])
    found = view.memo.get(key)
    if found is None:
        found = curve_basis(variable(view), *span, count)
        for old in [old for old in list(view.memo) if old[0].startswith(_CURVE) and old[0] != key[0]]:
            view.memo.pop(old, None)
        view.memo[key] = found
    return found


def structures(parts: Sequence[View], setting: Setting) -> list[Term]:
    """A curve in every variable on every channel, and a few products with the direction or speed."""
    result: list[Term] = []
    if len(parts) > 1:
        result += [_one_trial(view) for view in parts]
    result += response_terms(setting)
    result += machine_structures(setting)
    if not setting.bare:
        result += [
            _wandering_gain(parts, joint, count)
            for joint in range(setting.joints)
            for count in (STRAIGHT, COARSE)
        ]
    for name, variable in variables(setting).items():
        values = np.concatenate([variable(view)[view.valid] for view in parts])
        low, high = (float(v) for v in np.percentile(values, [0.2, 99.8]))
        for joint in range(setting.joints):
            own = name in (f"theta{joint + 1}", f"omega{joint + 1}", "time")
            for count in (COARSE, FINE) if own else (COARSE,):
                result.append(_curve(name, variable, (low, high), (TORQUE, joint), count))
            if name in (f"theta{joint + 1}", "time"):
                result += list(_products(name, variable, (low, high), joint))
        for family in (SPECIFIC_FORCE, FORCE):
            there = setting.accelerometer if family == SPECIFIC_FORCE else setting.force_sensor
            if there and name in ("time", "x", "y", "theta2"):
                result += [_curve(name, variable, (low, high), (family, axis), COARSE) for axis in (0, 1)]
    return result


def _curve(
    name: str, variable: Variable, span: tuple[float, float], channel: tuple[str, int], count: int
) -> Term:
    def columns(view: View, _shape: float) -> Columns:
        return on_channel(view, *channel, _basis(view, name, variable, span, count))

    return unnamed(channel_name(*channel), name, columns, count, f"{name} by {count}")


def _one_trial(odd: View) -> Term:
    """One trial apart: its own robot parameters, dry friction, springs, offset and slow change."""
    model = odd.model

    def columns(view: View, _shape: float) -> Columns:
        if view.name != odd.name:
            return {}
        Y = model.regressor(view.theta, view.omega, view.acc)
        direction = sign_mean(view.omega, view.acc, view.dt)
        slow = curve_basis(view.t, 0.0, float(view.t[-1]), 5)
        own = [
            on_channel(
                view, TORQUE, joint, np.column_stack([direction[:, joint], view.theta[:, joint], slow])
            )
            for joint in range(view.joints)
        ]
        return {TORQUE: np.concatenate([Y, *(block[TORQUE] for block in own)], axis=2)}

    size = len(model.parameter_names) + 7 * odd.joints
    return unnamed("tau1", "one_trial", columns, size, odd.name)


def _wandering_gain(parts: Sequence[View], joint: int, count: int) -> Term:
    """A drive whose gain changes in the course of each trial, in each otherwise; or on a straight line."""

    def columns(view: View, _shape: float) -> Columns:
        basis = course_basis(view.t, count)
        return on_channel(view, TORQUE, joint, basis * view.torque_model[:, [joint]])

    each = Each(columns, count, tuple(view.name for view in parts), lambda view: view.name)
    wander = unnamed(f"tau{joint + 1}", "time", each, count * len(parts), f"{EACH} by {count}")
    # More than the whole torque is no gain: a joint without a drive would be given any.
    return replace(wander, gate=lambda beta, _shape: bool(np.max(np.abs(beta)) < 1.0))


def course_basis(t: Floats, count: int) -> Floats:
    """Smooth courses over a trial, (N, count): a straight line by two, splines by more."""
    if count == STRAIGHT:
        u = t / max(float(t[-1]), 1e-9)
        return np.stack([1 - u, u], axis=1)
    return curve_basis(t, 0.0, float(t[-1]), count)


def _products(name: str, variable: Variable, span: tuple[float, float], joint: int) -> Iterator[Term]:
    factors: dict[str, Variable] = {
        "direction": lambda view: sign_mean(view.omega[:, joint], view.acc[:, joint], view.dt),
        "speed": lambda view: view.omega[:, joint],
    }
    if name == "time":
        # A drive whose gain wanders.
        factors["torque"] = lambda view: view.torque_model[:, joint]
    for word, factor in factors.items():

        def columns(view: View, _shape: float, factor: Variable = factor) -> Columns:
            basis = _basis(view, name, variable, span, COARSE)
            return on_channel(view, TORQUE, joint, basis * factor(view)[:, None])

        yield unnamed(f"tau{joint + 1}", name, columns, COARSE, f"{word} times {name}")
