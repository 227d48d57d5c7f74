"""Structures without a cause: what an unknown effect could look like, beside the catalogue from the start.

Curves of place, speed and time, products with the direction or the speed, a response in frequency, a gain
that wanders, an odd trial: a discrepancy in the sense of Kennedy and O'Hagan (J. R. Stat. Soc. B 63, 2001),
in every channel that is measured.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from scipy.interpolate import BSpline

from impid_host.effects.effect import UNATTRIBUTED, Each, Setting, Term
from impid_host.effects.encoder import without_error
from impid_host.effects.response import response_terms
from impid_host.effects.sensitivity import sensitivity
from impid_host.effects.view import FORCE, SPECIFIC_FORCE, TORQUE, Columns, View, rate_of
from impid_host.impedance.virtual_sensor import through_jacobian
from impid_host.signals.arrays import Floats
from impid_host.signals.direction import sign_mean

Variable = Callable[[View], Floats]
COARSE, FINE = 7, 18
EACH = "torque times time in each trial"
BY_PULL = "force of the load"
ENCODER = "encoder"
ENCODER_ERRORS = ("s ahead", "rad/(N m) of give", "rad/(N m rad) of slip")
_STEP = 1e-4  # of the finite differences, in those units


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


def pull(view: View) -> Floats:
    """Size of the force that presses on the bearings of a robot under load, (N,); zero in free motion."""
    if view.load is None:
        return np.zeros_like(view.t)
    force = through_jacobian(view.model, view.theta, view.torque_model)
    return np.asarray(np.linalg.norm(force, axis=1))


def curve_basis(values: Floats, low: float, high: float, count: int) -> Floats:
    """`count` cubic B-splines over low..high at (N,) values, held at the ends: (N, count)."""
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
    if setting.planar and setting.loads:
        result += [_friction_by_pull(joint) for joint in range(setting.joints)]
    if len(parts) > 1:
        result += [_one_trial(view) for view in parts]
    result += response_terms(setting)
    result += _encoder_errors(setting)
    if not setting.bare:
        result += [_wandering_gain(parts, joint) for joint in range(setting.joints)]
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


def channel_name(family: str, channel: int) -> str:
    """`tau1`, `fsx`, `acc_x`: how a measured channel is spoken of."""
    start = {TORQUE: "tau", FORCE: "fs", SPECIFIC_FORCE: "acc_"}[family]
    return f"{start}{channel + 1}" if family == TORQUE else f"{start}{'xy'[channel]}"


def on_channel(view: View, family: str, channel: int, basis: Floats) -> Columns:
    """Columns (N, k) on one channel of one family; nothing where the trial does not measure it."""
    if family == FORCE and (view.force is None or view.load is None):
        return {}
    if family == SPECIFIC_FORCE and view.predicted is None:
        return {}
    width = view.joints if family == TORQUE else 2
    block = np.zeros((len(view.t), width, basis.shape[1]))
    block[:, channel] = basis
    return {family: block}


def unnamed(
    on: str, variable: str, columns: Callable[[View, float], Columns], size: int, variant: str
) -> Term:
    """A term without a name: on which channel, of which variable."""
    return Term(UNATTRIBUTED, (on, variable), columns, lambda _beta, _shape: {}, size=size, variant=variant)


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


def _encoder_errors(setting: Setting) -> Iterator[Term]:
    """Encoders that are not where their joints are: each by itself, and all of them."""
    every = tuple(range(setting.joints))
    for joints in [*((joint,) for joint in every), *([every] if len(every) > 1 else [])]:

        def columns(view: View, _shape: float, joints: tuple[int, ...] = joints) -> Columns:
            blocks = [_by_encoder(view, joint) for joint in joints]
            return {family: np.concatenate([own[family] for own in blocks], axis=2) for family in blocks[0]}

        on = "+".join(f"theta{joint + 1}" for joint in joints)
        yield unnamed(on, f"omega{joints[0] + 1}", columns, len(ENCODER_ERRORS) * len(joints), ENCODER)


def _by_encoder(view: View, joint: int) -> Columns:
    """An encoder that runs ahead in time, by the torque that passes, or by torque and way (a slip)."""
    speed, torque = view.omega[:, joint], view.torque_model[:, joint]
    slips = torque * np.abs(speed)
    errors = [
        (speed, rate_of(speed, view.dt)),
        (torque, rate_of(torque, view.dt)),
        (np.cumsum(slips) * view.dt, slips),
    ]
    moved = [
        without_error(view, joint, *(_STEP * own for own in (error, rate, rate_of(rate, view.dt))))
        for error, rate in errors
    ]
    return sensitivity(view, _STEP, *moved)


def _wandering_gain(parts: Sequence[View], joint: int) -> Term:
    """A drive whose gain changes in the course of each trial, in each otherwise."""

    def columns(view: View, _shape: float) -> Columns:
        basis = curve_basis(view.t, 0.0, float(view.t[-1]), COARSE)
        return on_channel(view, TORQUE, joint, basis * view.torque_model[:, [joint]])

    each = Each(columns, COARSE, tuple(view.name for view in parts), lambda view: view.name)
    return unnamed(f"tau{joint + 1}", "time", each, COARSE * len(parts), EACH)


def _friction_by_pull(joint: int) -> Term:
    def columns(view: View, _shape: float) -> Columns:
        direction = sign_mean(view.omega[:, joint], view.acc[:, joint], view.dt)
        return on_channel(view, TORQUE, joint, (pull(view) * direction)[:, None])

    return unnamed(f"tau{joint + 1}", "direction", columns, 1, BY_PULL)


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
