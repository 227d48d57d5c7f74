"""Springs, dampers, masses and gravity that the robot model lacks."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from impid_host.effects.effect import (
    Effect,
    Parameter,
    Setting,
    Term,
    Value,
    along,
    at_tip,
    everywhere,
    joint_name,
    on_joint,
)
from impid_host.effects.view import Columns, View, rate_of
from impid_host.signals.arrays import Floats

_PULLS = 0.35  # noise may make the weaker direction of a cable push by so much of the stronger one's pull


def _elastic_cartesian(setting: Setting) -> Iterator[Term]:
    if not setting.planar:
        return

    def columns(view: View, _shape: float) -> Columns:
        one = np.ones_like(view.t)
        x, y = view.x.T
        return at_tip(view, along(x, 0), along(y, 1), along(one, 0), along(one, 1))

    def skewed(view: View, _shape: float) -> Columns:
        one = np.ones_like(view.t)
        x, y = view.x.T
        return at_tip(view, along(x, 0), along(y, 1), along(one, 0), along(one, 1), view.x[:, ::-1])

    def read(beta: Floats, _shape: float) -> dict[str, Value]:
        K = _symmetric(beta)
        x0, y0 = (-np.linalg.pinv(K, rcond=1e-3) @ beta[2:4]).tolist()
        found: dict[str, Value] = {"kx": float(beta[0]), "ky": float(beta[1]), "x0": x0, "y0": y0}
        return found if len(beta) == 4 else found | {"kxy": float(beta[4])}

    plain = Term(
        "elastic.cartesian",
        ("tip",),
        columns,
        read,
        size=4,
        gate=_pulls_back,
        # A spring's rest position is a constant torque, at the end-effector nearly.
        holds=tuple(f"actuator.offset@{place}" for place in everywhere(setting)),
    )
    yield plain
    yield replace(plain, columns=skewed, size=5, variant="xy")


def _symmetric(beta: Floats) -> Floats:
    """[[kx, kxy], [kxy, ky]] of (kx, ky) or (kx, ky, ., ., kxy)."""
    cross = beta[4] if len(beta) > 4 else 0.0
    return np.array([[beta[0], cross], [cross, beta[1]]])


def _pulls_back(beta: Floats, _shape: float) -> bool:
    low, high = np.linalg.eigvalsh(_symmetric(beta))
    return bool(high > 0 and low > -_PULLS * high)


def _elastic_joint(setting: Setting) -> Iterator[Term]:
    for joint in range(setting.joints):

        def columns(view: View, _shape: float, joint: int = joint) -> Columns:
            return on_joint(view, joint, view.theta[:, joint], np.ones_like(view.t))

        place = joint_name(joint)
        spring = Term(
            "elastic.joint",
            (place,),
            columns,
            lambda beta, _shape: {"stiffness": float(beta[0]), "rest_rad": float(-beta[1] / beta[0])},
            size=2,
            gate=lambda beta, _shape: bool(beta[0] > 0),
            holds=(f"actuator.offset@{place}",),
        )
        yield spring
    if setting.joints == 2 and setting.planar:

        def between(view: View, _shape: float) -> Columns:
            apart = view.theta[:, 0] - view.theta[:, 1]
            both = np.stack([apart, np.ones_like(apart)], axis=1)
            return {"torque": np.stack([both, -both], axis=1)}

        # A loom from link to link: both angles are the links' own, and it resists their difference.
        yield replace(
            spring, where=everywhere(setting), columns=between, holds=(), variant="between the links"
        )


def _transmission(setting: Setting) -> Iterator[Term]:
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
            yield Term(
                "elastic.transmission",
                (joint_name(joint),),
                form,
                _read_transmission,
                size=size,
                gate=lambda beta, _shape: bool(beta[0] > 0 and min(beta[2:], default=0.0) >= 0),
                variant=variant,
                by_model=True,
            )


def _read_transmission(beta: Floats, _shape: float) -> dict[str, float]:
    """beta = (J_m / k, -J_m^2 / k)."""
    inertia = float(-beta[1] / beta[0])
    return {"stiffness": inertia / float(beta[0]), "motor_inertia": inertia}


def _damping_cartesian(setting: Setting) -> Iterator[Term]:
    if not setting.planar:
        return

    def columns(view: View, _shape: float) -> Columns:
        return at_tip(view, along(view.v[:, 0], 0), along(view.v[:, 1], 1))

    damper = Term(
        "damping.cartesian",
        ("tip",),
        columns,
        lambda beta, _shape: {"bx": float(beta[0]), "by": float(beta[1])},
        size=2,
        gate=lambda beta, _shape: bool(max(beta) > 0 and min(beta) > -_PULLS * max(beta)),
    )
    yield damper


_LARGEST_MOMENT = 3.0  # kg m of a link: 10 kg at 0.3 m


def _tilt(setting: Setting) -> Iterator[Term]:
    if not setting.planar or not setting.accelerometer or setting.gravity:
        return

    def columns(view: View, _shape: float) -> Columns:
        # Columns: gx, gy as the accelerometer feels them (specific force = acceleration - gravity), and the
        # links' gravity torques, whose first moments are unknown: one cosine and sine for each joint.
        c, s = np.cos(view.theta), np.sin(view.theta)
        torque = np.zeros((len(view.t), view.joints, 2 + 2 * view.joints))
        for joint in range(view.joints):
            torque[:, joint, 2 + 2 * joint] = s[:, joint]
            torque[:, joint, 3 + 2 * joint] = c[:, joint]
        return {"torque": torque} | _felt_tilt(view, torque.shape[2])

    def links_by_model(view: View, _shape: float) -> Columns:
        # The first moments by the robot's inertias: a slight tilt pulls at the links by little.
        if view.alpha is None:
            return {}
        moments = view.model.first_moments(view.theta, view.alpha)
        return {} if moments is None else {"torque": moments} | _felt_tilt(view, 2)

    def read(beta: Floats, _shape: float) -> dict[str, float]:
        return {"gx": float(beta[0]), "gy": float(beta[1])}

    def gate(beta: Floats, _shape: float) -> bool:
        # Constant torques pull at links without any tilt that the accelerometer feels: no tilt.
        felt = float(np.hypot(beta[0], beta[1]))
        pulls = [float(np.hypot(*pair)) for pair in np.reshape(beta[2:], (-1, 2))]
        return felt < 5.0 and max(pulls, default=0.0) < _LARGEST_MOMENT * felt

    free = Term(
        "gravity.tilt", ("tip",), columns, read, size=2 + 2 * setting.joints, gate=gate, variant="links too"
    )
    yield replace(free, nuisance=2 * setting.joints)
    yield replace(free, columns=links_by_model, size=2, variant="links by alpha", by_model=True)


def _felt_tilt(view: View, width: int) -> Columns:
    """What an accelerometer feels of gx, gy, in the first two of `width` columns."""
    if view.predicted is None:
        return {}
    felt = np.zeros((len(view.t), 2, width))
    one, zero = np.ones_like(view.t), np.zeros_like(view.t)
    felt[:, :, 0] = -view.along_axes(np.stack([one, zero], axis=1))
    felt[:, :, 1] = -view.along_axes(np.stack([zero, one], axis=1))
    return {"specific_force": felt}


def _link_weight(setting: Setting) -> Iterator[Term]:
    """The weight of a link in a plane that is not level, of a model that has no gravity."""
    if setting.gravity:
        return
    for joint in range(setting.joints):
        if setting.slides[joint]:
            continue

        def columns(view: View, _shape: float, joint: int = joint) -> Columns:
            return on_joint(view, joint, np.sin(view.theta[:, joint]), np.cos(view.theta[:, joint]))

        place = joint_name(joint)
        yield Term(
            "gravity.link",
            (place,),
            columns,
            lambda beta, _shape: {"torque_sin": float(beta[0]), "torque_cos": float(beta[1])},
            size=2,
            # Over a small range a sine and a cosine are a spring and a constant torque.
            holds=(f"actuator.offset@{place}",),
        )


def _inertia(setting: Setting) -> Iterator[Term]:
    # What is always there on one joint hides in alpha, unless the robot is known from earlier. What couples
    # the joints, or is there in load trials alone, shows: a rotor by itself, a mass at the tip (which is part
    # of m otherwise) ahead of a force sensor or against a weighed payload.
    loaded = bool(setting.loads) and not setting.bare
    for joint in range(setting.joints):

        def rotor(view: View, _shape: float, joint: int = joint) -> Columns:
            return on_joint(view, joint, view.acc[:, joint])

        own = Term(
            "inertia.extra",
            (joint_name(joint),),
            rotor,
            lambda beta, _shape: {"inertia": float(beta[0])},
        )
        if loaded and setting.both and setting.planar:
            yield replace(own, when="load")
        if setting.referenced and not setting.bare:
            yield own
    if setting.joints == 2 and setting.planar:

        def coupled(view: View, _shape: float) -> Columns:
            return {"torque": view.acc[:, ::-1, None].copy()}

        # A rotor that turns with the difference (or the sum) of the angles couples the joints by -J (or J).
        yield Term(
            "inertia.extra",
            everywhere(setting),
            coupled,
            lambda beta, _shape: {"inertia": float(abs(beta[0]))},
            variant="coupling both joints",
        )
    if not (setting.planar and loaded and (setting.force_sensor or setting.referenced)):
        return

    def columns(view: View, _shape: float) -> Columns:
        return at_tip(view, view.a) if view.load is not None else {}

    yield Term("inertia.extra", ("tip",), columns, lambda beta, _shape: {"mass": float(beta[0])}, when="load")


_TEXTBOOK = "Siciliano et al., Robotics: Modelling, Planning and Control (2009), ch. 7"
EFFECTS = (
    Effect(
        "elastic.cartesian",
        "tau += J^T [[kx, kxy], [kxy, ky]] [x - x0, y - y0]",
        "robot",
        (
            Parameter("kx", "N/m"),
            Parameter("ky", "N/m"),
            Parameter("kxy", "N/m"),
            Parameter("x0", "m"),
            Parameter("y0", "m"),
        ),
        "cables, [D] Sec. IV",
        _elastic_cartesian,
        tells={
            "actuator.offset": "a trial at rest at several places, with the drives off and on",
            "elastic.joint": "a free trial over a larger range of both joints",
        },
    ),
    Effect(
        "elastic.joint",
        "tau += stiffness (theta - rest_rad)",
        "robot",
        (Parameter("stiffness", "N*m/rad", 0, amplitude=True), Parameter("rest_rad", "rad")),
        _TEXTBOOK,
        _elastic_joint,
        tells={
            "actuator.offset": "the torque at rest with the spring taken off, or its rest position measured",
            "elastic.cartesian": "a free trial over a larger range of both joints",
        },
    ),
    Effect(
        "elastic.transmission",
        "tau += (motor_inertia / stiffness) (tau - motor_inertia theta'')'' behind a joint-side encoder",
        "robot",
        (
            Parameter("stiffness", "N*m/rad", 0, amplitude=True),
            Parameter("motor_inertia", "kg*m^2", 0, amplitude=True),
        ),
        "Spong, Modeling and control of elastic joint robots, J. Dyn. Sys. 109 (1987)",
        _transmission,
    ),
    Effect(
        "damping.cartesian",
        "tau += J^T [bx x', by y']",
        "robot",
        (Parameter("bx", "N*s/m"), Parameter("by", "N*s/m")),
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
        tells={"accel.bias": "a free trial in which link 2 turns by 90 degrees or more"},
    ),
    Effect(
        "gravity.link",
        "tau += torque_sin sin(theta) + torque_cos cos(theta)",
        "robot",
        (Parameter("torque_sin", "N*m"), Parameter("torque_cos", "N*m")),
        _TEXTBOOK,
        _link_weight,
        tells={"elastic.joint": "a free trial over a larger range of the joint"},
    ),
    Effect(
        "inertia.extra",
        "tau += J^T mass x'' in load trials, ahead of the force sensor; tau += inertia theta'' on a joint, or"
        " across both",
        "robot",
        (Parameter("mass", "kg", -5, 20), Parameter("inertia", "kg*m^2", 0, amplitude=True)),
        _TEXTBOOK,
        _inertia,
        tells={"": "a load trial with a weighed payload (payload_kg)"},
    ),
)
