"""Unnamed structures of the machine: encoders that err, drives that bend, friction by load and at the tip.

What an unknown fault of a part would look like in every channel that the part has a hand in, with as few
parameters as a name, so that a known name stands only where it predicts better.
"""

from collections.abc import Iterator

import numpy as np

from impid_host.effects.effect import Setting, Term, along, at_tip, each_and_all
from impid_host.effects.encoder import without_error
from impid_host.effects.friction import stop
from impid_host.effects.sensitivity import sensitivity
from impid_host.effects.unnamed import on_channel, unnamed
from impid_host.effects.view import TORQUE, Columns, View, rate_of
from impid_host.impedance.virtual_sensor import through_jacobian
from impid_host.signals.arrays import Floats
from impid_host.signals.direction import sign_mean

BY_PULL = "force of the load"
BY_TORQUE = "torque that passes"
AT_TIP = "friction at the end-effector"
ENCODER = "encoder"
ENCODER_ERRORS = ("s ahead", "rad/(N m) of give", "rad/(N m rad) of slip")
_STEP = 1e-4  # of the finite differences, in those units
_WIDTHS = (0.03, 0.15)  # of the reach: friction that is a spring until it slides


def machine_structures(setting: Setting) -> Iterator[Term]:
    """All that make sense in the setting."""
    yield from _encoder_errors(setting)
    if not setting.bare:
        yield from (_bent_drive(joint) for joint in range(setting.joints))
    if setting.planar and setting.loads:
        yield from (_friction_by_pull(joint) for joint in range(setting.joints))
    if setting.planar:
        yield _friction_at_tip(setting)


def _encoder_errors(setting: Setting) -> Iterator[Term]:
    """Encoders that are not where their joints are: each by itself, and all of them."""
    for joints in each_and_all(range(setting.joints)):

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


def _bent_drive(joint: int) -> Term:
    """A drive that gives less, or more, the harder it works."""

    def columns(view: View, _shape: float) -> Columns:
        torque = view.torque_model[:, joint]
        return on_channel(view, TORQUE, joint, np.stack([torque * np.abs(torque), torque**3], axis=1))

    return unnamed(f"tau{joint + 1}", "direction", columns, 2, BY_TORQUE)


def pull(view: View) -> Floats:
    """Size of the force that presses on the bearings of a robot under load, (N,); zero in free motion."""
    if view.load is None:
        return np.zeros_like(view.t)
    force = through_jacobian(view.model, view.theta, view.torque_model)
    return np.asarray(np.linalg.norm(force, axis=1))


def _friction_by_pull(joint: int) -> Term:
    def columns(view: View, _shape: float) -> Columns:
        direction = sign_mean(view.omega[:, joint], view.acc[:, joint], view.dt)
        return on_channel(view, TORQUE, joint, (pull(view) * direction)[:, None])

    return unnamed(f"tau{joint + 1}", "direction", columns, 1, BY_PULL)


def _friction_at_tip(setting: Setting) -> Term:
    """Something at the end-effector that is a spring until it slides: a cable that rubs, a guide."""
    reach = setting.reach or 0.1

    def columns(view: View, _shape: float) -> Columns:
        forces = [
            along(stop(view.x[:, axis], width * reach), axis, setting.axes)
            for axis in range(setting.axes)
            for width in _WIDTHS
        ]
        return at_tip(view, *forces)

    on = "+".join(f"tau{joint + 1}" for joint in range(setting.joints))
    return unnamed(on, "direction", columns, len(_WIDTHS) * setting.axes, AT_TIP)
