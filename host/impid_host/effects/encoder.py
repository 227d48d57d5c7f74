"""How the angles and the clocks err. They enter every equation, so their columns are sensitivities."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from impid_host.effects.effect import (
    Effect,
    Parameter,
    Setting,
    Term,
    Value,
    amplitude_phase,
    each_and_all,
    each_trial,
    joint_name,
)
from impid_host.effects.sensitivity import sensitivity
from impid_host.effects.view import Columns, View, advanced, rate_of, with_motion
from impid_host.signals.arrays import Floats

_STEP_RAD = 1e-4
_PATH_S = 3.0  # of the clocks' path between two knots


def shifted(view: View, joint: int, error: Floats, slope: Floats, bend: Floats) -> View:
    """The trial with an angle error taken off: error(theta), its first and second derivative in theta."""
    rate = slope * view.omega[:, joint]
    return without_error(
        view, joint, error, rate, slope * view.acc[:, joint] + bend * view.omega[:, joint] ** 2
    )


def without_error(view: View, joint: int, error: Floats, rate: Floats, rise: Floats) -> View:
    """The trial with an angle error, given with its first and second derivative in time, (N,), taken off."""
    theta, omega, acc = view.theta.copy(), view.omega.copy(), view.acc.copy()
    theta[:, joint] -= error
    omega[:, joint] -= rate
    acc[:, joint] -= rise
    return with_motion(view, theta, omega, acc)


def turning(setting: Setting) -> list[int]:
    """The joints that turn; a linear encoder has no circle to be off centre on."""
    return [joint for joint in range(setting.joints) if not setting.slides[joint]]


def _zero(setting: Setting) -> Iterator[Term]:
    for joint in turning(setting):

        def columns(view: View, _shape: float, joint: int = joint) -> Columns:
            flat = np.zeros_like(view.t)
            return sensitivity(view, _STEP_RAD, shifted(view, joint, flat + _STEP_RAD, flat, flat))

        # What the encoder says at the true zero is `zero_rad` too much.
        yield Term(
            "encoder.zero",
            (joint_name(joint),),
            columns,
            lambda beta, _shape: {"zero_rad": float(beta[0])},
            undo=lambda view, beta, _shape, joint=joint: _unzeroed(view, joint, float(beta[0])),  # type: ignore[misc]
            by_model=True,
            moves=True,
        )


def _eccentricity(setting: Setting) -> Iterator[Term]:
    for joint in turning(setting):

        def columns(view: View, _shape: float, joint: int = joint) -> Columns:
            c = _STEP_RAD * np.cos(view.theta[:, joint])
            s = _STEP_RAD * np.sin(view.theta[:, joint])
            return sensitivity(
                view, _STEP_RAD, shifted(view, joint, c, -s, -c), shifted(view, joint, s, c, -s)
            )

        yield Term(
            "encoder.eccentricity",
            (joint_name(joint),),
            columns,
            _read_eccentricity,
            size=2,
            gate=lambda beta, _shape: bool(np.hypot(*beta) < 0.2),
            undo=lambda view, beta, _shape, joint=joint: _centred(view, joint, beta),  # type: ignore[misc]
            by_model=True,
            moves=True,
        )


def _scale(setting: Setting) -> Iterator[Term]:
    """Counts per turn other than declared: in the module's setup alone, or in the controller's as well."""
    for joints in each_and_all(turning(setting)):
        for variant in ("module and controller", "module"):

            def columns(
                view: View,
                _shape: float,
                joints: tuple[int, ...] = joints,
                *,
                alone: bool = variant == "module",
            ) -> Columns:
                moved = [_stretched(view, joint, _STEP_RAD) for joint in joints]
                result = sensitivity(view, _STEP_RAD, *moved)
                if alone and view.theta_robot is not None and result:
                    gone = np.zeros((len(view.t), view.joints, len(joints)))
                    for q, joint in enumerate(joints):
                        gone[:, joint, q] = view.theta[:, joint] - view.zero_rad[joint]
                    result["angle"] = gone
                return result

            def undo(
                view: View,
                beta: Floats,
                _shape: float,
                joints: tuple[int, ...] = joints,
                *,
                alone: bool = variant == "module",
            ) -> View:
                true = view
                for joint, more in zip(joints, beta, strict=True):
                    true = _stretched(true, joint, float(more))
                return true if alone else _by_both(view, true)

            yield Term(
                "encoder.scale",
                tuple(joint_name(joint) for joint in joints),
                columns,
                _read_scale,
                size=len(joints),
                undo=undo,
                by_model=True,
                moves=True,
                variant=variant,
            )


def _read_scale(beta: Floats, _shape: float) -> dict[str, Value]:
    factors = [1.0 + float(b) for b in beta]
    return {"factor": factors if len(factors) > 1 else factors[0]}


def _stretched(view: View, joint: int, more: float) -> View:
    """The trial had the joint turned by 1 + more of what the encoder says."""
    flat = np.zeros_like(view.t)
    gone = view.theta[:, joint] - view.zero_rad[joint]
    return shifted(view, joint, -more * gone, flat - more, flat)


def _by_both(view: View, true: View) -> View:
    """The controller reads the same encoders: what is wrong with them is wrong in its reading."""
    if view.theta_robot is None:
        return true
    return replace(true, theta_robot=view.theta_robot + true.theta - view.theta)


def _unzeroed(view: View, joint: int, zero: float) -> View:
    flat = np.zeros_like(view.t)
    return _by_both(view, shifted(view, joint, flat + zero, flat, flat))


def _centred(view: View, joint: int, beta: Floats) -> View:
    c, s = np.cos(view.theta[:, joint]), np.sin(view.theta[:, joint])
    error = beta[0] * c + beta[1] * s
    return _by_both(view, shifted(view, joint, error, beta[1] * c - beta[0] * s, -error))


def _read_eccentricity(beta: Floats, _shape: float) -> dict[str, float]:
    amplitude, phase = amplitude_phase(beta[0], beta[1])
    return {"amplitude_rad": amplitude, "phase_rad": phase}


def lateness(view: View, degree: int) -> Floats:
    """A time error of the given Legendre degree over the trial, 1 s at its end, (N,).

    The linear part is taken out as the match of the clocks has taken it out: weighted by the squared speed.
    """
    u = 2 * view.t / view.t[-1] - 1
    shape = np.polynomial.legendre.Legendre.basis(degree)(u)
    weight = np.sum(view.omega**2, axis=1)
    design = np.stack([np.ones_like(u), u], axis=1)
    normal = design.T @ (weight[:, None] * design)
    line: Floats = np.linalg.solve(normal, design.T @ (weight * shape))
    result: Floats = shape - design @ line
    return result


def _drift(setting: Setting) -> Iterator[Term]:
    """The robot's clock wanders, in each trial by itself: it starts anew, and its temperature is another."""
    if not setting.second_clock:
        return
    for degrees in ((2,), (2, 3, 4, 5)):

        def columns(view: View, _shape: float, degrees: tuple[int, ...] = degrees) -> Columns:
            if view.theta_robot is None:
                return {}
            slope = rate_of(view.torque_model, view.dt)
            late = [lateness(view, degree)[:, None] for degree in degrees]
            result = {
                "angle": np.stack([-view.omega * e for e in late], axis=2),
                "torque": np.stack([-slope * e for e in late], axis=2),
            }
            if view.load is not None and view.force is not None and view.response is not None:
                pull = rate_of(view.response["force"], view.dt)
                result["force"] = np.stack([-pull * e for e in late], axis=2)
            return result

        def undo(view: View, beta: Floats, _shape: float, degrees: tuple[int, ...] = degrees) -> View:
            return _retimed(view, degrees, beta)

        wander = Term(
            "clock.drift",
            ("sensor",),
            columns,
            _read_drift,
            size=len(degrees),
            gate=lambda beta, _shape: bool(np.max(np.abs(beta)) < 0.2),
            variant=f"degree {degrees[-1]}",
            undo=undo,
            by_model=True,
        )
        yield each_trial(wander, setting)


def _read_drift(beta: Floats, _shape: float) -> dict[str, Value]:
    """Seconds over the trial: P_2's coefficient, or the whole path from peak to peak."""
    if len(beta) == 1:
        return {"seconds": float(beta[0])}
    u = np.linspace(-1.0, 1.0, 401)
    path = np.polynomial.legendre.legval(u, np.concatenate([np.zeros(2), beta]))
    return {"seconds": float(np.ptp(path)), "legendre": [float(b) for b in beta]}


def _retimed(view: View, degrees: tuple[int, ...], beta: Floats) -> View:
    if view.theta_robot is None:
        return view
    late = sum((b * lateness(view, k) for b, k in zip(beta, degrees, strict=True)), np.zeros_like(view.t))
    u = 2 * view.t / view.t[-1] - 1
    # The match of the clocks, disturbed by the drift, has left an offset and a rate.
    line = np.column_stack([np.ones_like(u), u])
    return _shifted_by(view, late + _lateness_left(view, advanced(view.theta_robot, view.t, late), line))


def resynchronised(view: View) -> View:
    """The robot's signals moved by the smooth path of lateness that its angles show against the module's."""
    if view.theta_robot is None:
        return view
    from scipy.interpolate import BSpline  # noqa: PLC0415  (a fifth of a second, for searches alone)

    knots = max(2, int(view.t[-1] / _PATH_S))
    inside = np.linspace(view.t[0], view.t[-1], knots + 1)
    ends = np.concatenate([np.repeat(inside[0], 3), inside, np.repeat(inside[-1], 3)])
    basis = BSpline.design_matrix(np.clip(view.t, inside[0], inside[-1]), ends, 3).toarray()
    return _shifted_by(view, _lateness_left(view, view.theta_robot, basis))


def _shifted_by(view: View, late: Floats) -> View:
    assert view.theta_robot is not None
    return replace(
        view,
        tau=advanced(view.tau, view.t, late),
        theta_robot=advanced(view.theta_robot, view.t, late),
        force=None if view.force is None else advanced(view.force, view.t, late),
    )


def _lateness_left(view: View, theta_robot: Floats, basis: Floats) -> Floats:
    """Lateness (N,), s, of the robot's angles within the span of `basis` (N, k)."""
    rows = view.valid
    blocks, targets = [], []
    for joint in range(theta_robot.shape[1]):
        level = np.zeros((len(basis), theta_robot.shape[1]))
        level[:, joint] = 1.0
        blocks.append(np.column_stack([-view.omega[:, joint, None] * basis, level])[rows])
        targets.append((theta_robot[:, joint] - view.theta[:, joint])[rows])
    design = np.concatenate(blocks)
    size = np.linalg.norm(design, axis=0) + 1e-300
    value = np.linalg.lstsq(design / size, np.concatenate(targets), rcond=1e-8)[0] / size
    return np.asarray(basis @ value[: basis.shape[1]], dtype=np.float64)


EFFECTS = (
    Effect(
        "encoder.eccentricity",
        "reading = theta + amplitude_rad sin(theta + phase_rad)",
        "sensor",
        (Parameter("amplitude_rad", "rad", 0, 0.2, amplitude=True), Parameter("phase_rad", "rad")),
        "Hagiwara et al., IEEE Trans. Instrum. Meas. 41 (1992)",
        _eccentricity,
    ),
    Effect(
        "encoder.zero",
        "reading = theta + zero_rad",
        "sensor",
        (Parameter("zero_rad", "rad", -0.5, 0.5, least=1e-4),),
        "study format, Conventions",
        _zero,
        carries="record",
        tells={"": "a mechanical stop or a square against which each joint's zero is checked by itself"},
    ),
    Effect(
        "encoder.scale",
        "true angle - zero = factor * (declared angle - zero)",
        "sensor",
        (Parameter("factor", "1", 0.5, 2.0, least=2e-4, none=1.0),),
        "study format, Conventions",
        _scale,
        tells={"": "one whole turn of the joint against a mark, with the counts before and after"},
    ),
    Effect(
        "clock.drift",
        "the robot's rows are late by seconds * P_2(time), a Legendre polynomial over the trial; or by all up"
        " to P_5, and seconds is their sum from peak to peak",
        "clock",
        (Parameter("seconds", "s"), Parameter("legendre", "s")),
        "study format, Conventions",
        _drift,
        carries="record",
    ),
)
