"""Springs, dampers, masses and gravity that the robot model lacks."""

from collections.abc import Iterator

import numpy as np

from impid_host.effects.effect import (
    Candidate,
    Effect,
    Parameter,
    Setting,
    Value,
    at_tip,
    joint_name,
    on_joint,
)
from impid_host.effects.view import Columns, View, rate_of
from impid_host.robot.planar_2r_absolute import Planar2RAbsolute
from impid_host.signals.arrays import Floats


def _axis(view: View, axis: int, column: Floats) -> Floats:
    force = np.zeros_like(view.x)
    force[:, axis] = column
    return force


def _elastic_cartesian(setting: Setting) -> Iterator[Candidate]:
    if not setting.planar:
        return

    def columns(view: View, _shape: float) -> Columns:
        one = np.ones_like(view.t)
        x, y = view.x.T
        return at_tip(view, *(_axis(view, k, c) for k, c in ((0, x), (1, y), (0, one), (1, one))))

    def read(beta: Floats, _shape: float) -> dict[str, Value]:
        kx, ky, cx, cy = map(float, beta)
        return {"kx": kx, "ky": ky, "x0": -cx / kx if kx else 0.0, "y0": -cy / ky if ky else 0.0}

    yield Candidate(
        "elastic.cartesian",
        ("tip",),
        columns,
        read,
        size=4,
        gate=lambda beta, _shape: bool(max(beta[:2]) > 0 and min(beta[:2]) > -0.35 * max(beta[:2])),
    )


def _elastic_joint(setting: Setting) -> Iterator[Candidate]:
    for joint in range(setting.joints):

        def columns(view: View, _shape: float, joint: int = joint) -> Columns:
            return on_joint(view, joint, view.theta[:, joint], np.ones_like(view.t))

        yield Candidate(
            "elastic.joint",
            (joint_name(joint),),
            columns,
            lambda beta, _shape: {"stiffness": float(beta[0]), "rest_rad": float(-beta[1] / beta[0])},
            size=2,
            gate=lambda beta, _shape: bool(beta[0] > 0),
        )


def _transmission(setting: Setting) -> Iterator[Candidate]:
    if setting.bare:
        return
    for joint in range(setting.joints):

        def columns(view: View, _shape: float, joint: int = joint) -> Columns:
            # Joint-side encoder: the rotor runs ahead by the torque of the spring over k, so that
            # tau += (J_m / k) d2/dt2 (tau - J_m theta''); the second term tells J_m from k.
            torque, acc = view.torque_model[:, joint], view.acc[:, joint]
            bend = [rate_of(rate_of(signal, view.dt), view.dt) for signal in (torque, acc)]
            return on_joint(view, joint, *bend)

        def damped(view: View, _shape: float, joint: int = joint) -> Columns:
            # With a damper d beside the spring the rotor runs ahead by tau / k - d tau' / k^2 (first order).
            torque, acc = view.torque_model[:, joint], view.acc[:, joint]
            bend = [rate_of(rate_of(signal, view.dt), view.dt) for signal in (torque, acc)]
            return on_joint(view, joint, *bend, -rate_of(bend[0], view.dt))

        for variant, form, size in (("spring", columns, 2), ("spring and damper", damped, 3)):
            yield Candidate(
                "elastic.transmission",
                (joint_name(joint),),
                form,
                _read_transmission,
                size=size,
                gate=lambda beta, _shape: bool(beta[0] > 0 and min(beta[2:], default=0.0) >= 0),
                variant=variant,
            )


def _read_transmission(beta: Floats, _shape: float) -> dict[str, float]:
    """beta = (J_m / k, -J_m^2 / k)."""
    inertia = float(-beta[1] / beta[0])
    return {"stiffness": inertia / float(beta[0]), "motor_inertia": inertia}


def _damping_cartesian(setting: Setting) -> Iterator[Candidate]:
    if not setting.planar:
        return

    def columns(view: View, _shape: float) -> Columns:
        return at_tip(view, _axis(view, 0, view.v[:, 0]), _axis(view, 1, view.v[:, 1]))

    yield Candidate(
        "damping.cartesian",
        ("tip",),
        columns,
        lambda beta, _shape: {"bx": float(beta[0]), "by": float(beta[1])},
        size=2,
        gate=lambda beta, _shape: bool(max(beta) > 0 and min(beta) > -0.35 * max(beta)),
    )


_LARGEST_MOMENT = 3.0  # kg m of a link: 10 kg at 0.3 m


def _tilt(setting: Setting) -> Iterator[Candidate]:
    if not setting.planar or not setting.accelerometer:
        return

    def columns(view: View, _shape: float) -> Columns:
        # Columns: gx, gy as the accelerometer feels them (specific force = acceleration - gravity), and the
        # links' gravity torques, whose first moments are unknown: one cosine and sine for each joint.
        c, s = np.cos(view.theta), np.sin(view.theta)
        torque = np.zeros((len(view.t), view.joints, 6))
        for joint in range(2):
            torque[:, joint, 2 + 2 * joint] = s[:, joint]
            torque[:, joint, 3 + 2 * joint] = c[:, joint]
        result = {"torque": torque}
        if view.predicted is not None:
            felt = np.zeros((len(view.t), 2, 6))
            one, zero = np.ones_like(view.t), np.zeros_like(view.t)
            felt[:, :, 0] = -view.along_axes(np.stack([one, zero], axis=1))
            felt[:, :, 1] = -view.along_axes(np.stack([zero, one], axis=1))
            result["specific_force"] = felt
        return result

    def links_by_alpha(view: View, _shape: float) -> Columns:
        # The second link's first moment is alpha2 / (2 l1); the first link's is that of a mass at its end.
        if view.alpha is None or not isinstance(view.model, Planar2RAbsolute):
            return {}
        result = {family: block[..., :2].copy() for family, block in columns(view, _shape).items()}
        l1 = view.model.l1
        moment = (view.alpha[0] / l1, view.alpha[1] / (2.0 * l1))
        c, s = np.cos(view.theta), np.sin(view.theta)
        result["torque"][:, 0] = moment[0] * np.stack([s[:, 0], -c[:, 0]], axis=1)
        result["torque"][:, 1] = -moment[1] * np.stack([c[:, 1], s[:, 1]], axis=1)
        return result

    def read(beta: Floats, _shape: float) -> dict[str, float]:
        return {"gx": float(beta[0]), "gy": float(beta[1])}

    def gate(beta: Floats, _shape: float) -> bool:
        # Constant torques pull at links without any tilt that the accelerometer feels: no tilt.
        felt = float(np.hypot(beta[0], beta[1]))
        pulls = [float(np.hypot(*pair)) for pair in np.reshape(beta[2:], (-1, 2))]
        return felt < 5.0 and max(pulls, default=0.0) < _LARGEST_MOMENT * felt

    yield Candidate(
        "gravity.tilt", ("tip",), columns, read, size=6, gate=gate, variant="links too", nuisance=4
    )
    # A slight tilt pulls at the links by little: four free moments would cost more than they show.
    yield Candidate(
        "gravity.tilt", ("tip",), links_by_alpha, read, size=2, gate=gate, variant="links by alpha"
    )


def _inertia(setting: Setting) -> Iterator[Candidate]:
    # What is always there hides in alpha. What is there in load trials alone shows: a rotor by itself, a mass
    # at the tip (which is part of m otherwise) ahead of a force sensor.
    if not (setting.planar and (setting.springs or setting.arms)):
        return
    for joint in range(setting.joints):

        def rotor(view: View, _shape: float, joint: int = joint) -> Columns:
            return on_joint(view, joint, view.acc[:, joint]) if view.load is not None else {}

        yield Candidate(
            "inertia.extra",
            (joint_name(joint),),
            rotor,
            lambda beta, _shape: {"inertia": float(beta[0])},
            gate=lambda beta, _shape: bool(beta[0] > 0),
        )
    if not setting.force_sensor:
        return

    def columns(view: View, _shape: float) -> Columns:
        return at_tip(view, view.a) if view.load is not None else {}

    yield Candidate(
        "inertia.extra",
        ("tip",),
        columns,
        lambda beta, _shape: {"mass": float(beta[0])},
    )


_TEXTBOOK = "Siciliano et al., Robotics: Modelling, Planning and Control (2009), ch. 7"
EFFECTS = (
    Effect(
        "elastic.cartesian",
        "tau += J^T [kx (x - x0), ky (y - y0)]",
        "robot",
        (
            Parameter("kx", "N/m", 0),
            Parameter("ky", "N/m", 0),
            Parameter("x0", "m"),
            Parameter("y0", "m"),
        ),
        "cables, [D] Sec. IV",
        _elastic_cartesian,
    ),
    Effect(
        "elastic.joint",
        "tau += stiffness (theta - rest_rad)",
        "robot",
        (Parameter("stiffness", "N*m/rad", 0), Parameter("rest_rad", "rad")),
        _TEXTBOOK,
        _elastic_joint,
    ),
    Effect(
        "elastic.transmission",
        "tau += (motor_inertia / stiffness) (tau - motor_inertia theta'')'' behind a joint-side encoder",
        "robot",
        (
            Parameter("stiffness", "N*m/rad", 0),
            Parameter("motor_inertia", "kg*m^2", 0),
        ),
        "Spong, Modeling and control of elastic joint robots, J. Dyn. Sys. 109 (1987)",
        _transmission,
    ),
    Effect(
        "damping.cartesian",
        "tau += J^T [bx x', by y']",
        "robot",
        (Parameter("bx", "N*s/m", 0), Parameter("by", "N*s/m", 0)),
        _TEXTBOOK,
        _damping_cartesian,
    ),
    Effect(
        "gravity.tilt",
        "specific force -= R^T [gx, gy]; tau_j += the links' first moments times gravity",
        "robot",
        (Parameter("gx", "m/s^2"), Parameter("gy", "m/s^2")),
        _TEXTBOOK,
        _tilt,
    ),
    Effect(
        "inertia.extra",
        "tau += J^T mass x'' in load trials, ahead of the force sensor",
        "robot",
        (Parameter("mass", "kg"), Parameter("inertia", "kg*m^2")),
        _TEXTBOOK,
        _inertia,
    ),
)
