"""What laboratories get wrong: each row a map from a study in order to the study as it was recorded.

`names` are those that say it. `needs` says in which laboratories anything contradicts it at all.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from impid_host.samples import DeviceSamples
from impid_host.study.model import Study

from mistakes_campaign.changes import (
    Change,
    angles,
    another_load,
    at,
    both,
    clipped_accelerometer,
    clipped_torque,
    column,
    constant,
    constant_torque,
    device,
    encoder,
    exchanged_modules,
    force,
    force_on_link,
    half_stuck,
    jumps,
    last_of,
    links,
    module_in_ms,
    other_model,
    relabelled,
    relative_counts,
    repeated,
    reweighed,
    robot,
    sampled_late,
    sensor,
    stuck_encoder,
    torque,
    turned_force,
    without_module,
    without_sign,
    wraps16,
)

Needs = Callable[[Study], bool]


@dataclass(frozen=True)
class Mistake:
    """One row."""

    name: str
    change: Change
    names: tuple[str, ...]
    needs: Needs = lambda _study: True


def has_force(study: Study) -> bool:
    """A force sensor under load."""
    return any(trial.robot.force is not None for trial in study.trials)


def reaches_16_bits(study: Study) -> bool:
    """A counter of 16 bits would read something else on the first encoder."""
    counts = [trial.device.enc1 for trial in study.trials if isinstance(trial.device, DeviceSamples)]
    return any(int(own.max()) >= 2**15 or int(own.min()) < -(2**15) for own in counts)


def has_payload(study: Study) -> bool:
    """A weighed payload."""
    return any(trial.payload_kg for trial in study.trials)


def scaled(study: Study) -> bool:
    """Something that knows how large a newton is."""
    return has_force(study) or has_payload(study)


def has_two_loads(study: Study) -> bool:
    """Two loads."""
    return len({trial.load for trial in study.trials if trial.kind != "free"}) > 1


def fast_force(study: Study) -> bool:
    """A force sensor in a log of 1 kHz."""
    return has_force(study) and float(np.median(np.diff(study.trials[0].robot.t))) < 2e-3


_SIGN1, _SIGN2 = [[-1, 0], [0, 1]], [[1, 0], [0, -1]]
_SWAP = [[0, 1], [1, 0]]
_I = np.eye(2)
_LAST_LOAD, _LAST_FREE = last_of("load"), last_of("free")
_ACCEL = ("accel.axes", "accel.mount")
_DEG = 180 / np.pi

MISTAKES: tuple[Mistake, ...] = (
    Mistake("both torques' signs", torque(-_I), ("torque.sign",)),
    Mistake("tau1's sign", torque(_SIGN1), ("torque.sign",)),
    Mistake("tau2's sign", torque(_SIGN2), ("torque.sign",)),
    Mistake("torques in mN m", torque(1000 * _I), ("torque.unit",)),
    Mistake("torques in kN m", torque(0.001 * _I), ("torque.unit",)),
    Mistake("torques in kgf m", torque(_I / 9.80665), ("torque.unit",), scaled),
    Mistake("torques in N cm", torque(100 * _I), ("torque.unit",), scaled),
    Mistake("torques in A, 0.35 N m/A", torque(_I / 0.35), ("torque.unit",), scaled),
    Mistake("torques before a gear of 50", torque(_I / 50), ("torque.unit",), scaled),
    Mistake("tau1 twice too large", torque(np.diag([2.0, 1.0])), ("torque.unit",)),
    Mistake("tau2 in mN m", torque(np.diag([1.0, 1000.0])), ("torque.unit",)),
    Mistake("tau2 half, and of the other sign", torque(np.diag([1.0, -0.5])), ("torque.unit", "torque.sign")),
    Mistake("torques swapped", torque(_SWAP), ("torque.swapped",)),
    Mistake("torques swapped and turned", torque([[0, -1], [-1, 0]]), ("torque.swapped", "torque.sign")),
    Mistake("torques of relative joints", torque([[1, 1], [0, 1]]), ("torque.frame",)),
    Mistake("tau1 clipped at 60 %", clipped_torque(0.6), ("torque.clipped",)),
    Mistake("signs in one loaded trial", torque(-_I, _LAST_LOAD), ("torque.sign",)),
    Mistake("tau1's sign in one free trial", torque(_SIGN1, _LAST_FREE), ("torque.sign",)),
    Mistake("torques swapped in one trial", torque(_SWAP, _LAST_LOAD), ("torque.swapped",)),
    Mistake("torques in mN m in one trial", torque(1000 * _I, _LAST_LOAD), ("torque.unit",)),
    Mistake("counts without x4", encoder(counts_per_rev=lambda c: tuple(x / 4 for x in c)), ("angle.scale",)),
    Mistake(
        "counts of joint 2 doubled",
        encoder(counts_per_rev=lambda c: at(c, 1, lambda x: 2 * x)),
        ("angle.scale",),
    ),
    Mistake(
        "counts of joint 1 10 % off",
        encoder(counts_per_rev=lambda c: at(c, 0, lambda x: 1.1 * x)),
        ("angle.scale",),
    ),
    Mistake("encoder 1 backwards", encoder(direction=lambda d: at(d, 0, lambda x: -x)), ("angle.sign",)),
    Mistake("encoder 2 backwards", encoder(direction=lambda d: at(d, 1, lambda x: -x)), ("angle.sign",)),
    Mistake("both encoders backwards", encoder(direction=lambda d: tuple(-x for x in d)), ("angle.sign",)),
    Mistake(
        "encoders swapped",
        device(lambda s, _study: replace(s, enc1=s.enc2, enc2=s.enc1)),
        ("angle.swapped",),
    ),
    Mistake(
        "zero of joint 1 off by 0.2", encoder(zero_rad=lambda z: at(z, 0, lambda x: x + 0.2)), ("angle.zero",)
    ),
    Mistake(
        "zero of joint 2 off by 0.3", encoder(zero_rad=lambda z: at(z, 1, lambda x: x - 0.3)), ("angle.zero",)
    ),
    Mistake("both zeros off", encoder(zero_rad=lambda z: (z[0] + 0.15, z[1] + 0.25)), ("angle.zero",)),
    Mistake("controller in degrees", angles(lambda a: a * _DEG), ("angle.unit",)),
    Mistake("controller's theta1 in degrees", angles(column(0, lambda a: a * _DEG)), ("angle.unit",)),
    Mistake("controller's theta1 turned", angles(column(0, lambda a: -a)), ("angle.sign",)),
    Mistake("controller's angles swapped", angles(lambda a: a[:, ::-1].copy()), ("angle.swapped",)),
    Mistake(
        "controller logs relative angles",
        angles(lambda a: np.stack([a[:, 0], a[:, 1] - a[:, 0]], axis=1)),
        ("angle.frame",),
    ),
    Mistake("module counts relative angles", device(relative_counts), ("angle.frame",)),
    Mistake(
        "relative angles everywhere",
        both(device(relative_counts), angles(lambda a: np.stack([a[:, 0], a[:, 1] - a[:, 0]], axis=1))),
        ("angle.frame",),
    ),
    Mistake(
        "degrees, no module", both(without_module, angles(lambda a: a * _DEG)), ("angle.unit", "torque.unit")
    ),
    # A counter that passes no edge in any trial has turned by so many counts once: a zero, and nothing else.
    Mistake("encoder 1 wraps at 16 bits", device(wraps16), ("angle.wrap", "angle.zero"), reaches_16_bits),
    Mistake("encoder 2 came off", device(stuck_encoder, _LAST_LOAD), ("angle.resting",)),
    Mistake(
        "accelerometer's axes swapped",
        device(lambda s, _study: replace(s, ax=s.ay, ay=s.ax)),
        _ACCEL,
    ),
    Mistake("first axis mirrored", sensor(sensitivity_V_per_g=lambda s: at(s, 0, lambda x: -x)), _ACCEL),
    Mistake("second axis mirrored", sensor(sensitivity_V_per_g=lambda s: at(s, 1, lambda x: -x)), _ACCEL),
    Mistake("mount off by 90 degrees", sensor(mount_angle_rad=lambda a: a + np.pi / 2), _ACCEL),
    Mistake("mount off by 180 degrees", sensor(mount_angle_rad=lambda a: a + np.pi), _ACCEL),
    Mistake("mount off by -90 degrees", sensor(mount_angle_rad=lambda a: a - np.pi / 2), _ACCEL),
    Mistake("mount off by 0.4 rad", sensor(mount_angle_rad=lambda a: a + 0.4), _ACCEL),
    Mistake("mount in degrees", sensor(mount_angle_rad=lambda a: a * _DEG), _ACCEL),
    Mistake("mounted on link 2, said to be fixed", sensor(mount=lambda _m: "fixed"), _ACCEL),
    Mistake("vref 5 for 3.3", sensor(vref_V=lambda _v: 5.0), ("accel.unit",)),
    Mistake("vref in mV", sensor(vref_V=lambda v: 1000 * v), ("accel.unit",)),
    Mistake("sensitivity 1000 for 620", sensor(sensitivity_V_per_g=lambda _s: (1.0, 1.0)), ("accel.unit",)),
    Mistake(
        "sensitivity in mV", sensor(sensitivity_V_per_g=lambda s: tuple(1000 * x for x in s)), ("accel.unit",)
    ),
    Mistake("12 bits for 16", sensor(full_scale_code=lambda _c: 4096), ("accel.unit",)),
    Mistake(
        "zero_g of another supply", sensor(zero_g_V=lambda z: tuple(x - 0.4 for x in z)), ("accel.unit",)
    ),
    Mistake(
        "sensitivity per m/s^2",
        sensor(sensitivity_V_per_g=lambda s: tuple(x / 9.80665 for x in s)),
        ("accel.unit",),
    ),
    Mistake("accelerometer clipped", clipped_accelerometer(0.1, ("ax", "ay")), ("accel.clipped",)),
    Mistake("first axis clipped on one side", clipped_accelerometer(0.08, ("ax",), True), ("accel.clipped",)),
    Mistake("first axis dead", device(constant("ax")), ("accel.dead",)),
    Mistake("accelerometer dead", device(constant("ax", "ay")), ("accel.dead",)),
    Mistake("links swapped", links(lambda own: own[::-1]), ("links.swapped",)),
    Mistake(
        "links 10 % long", links(lambda own: tuple(1.1 * x for x in own)), ("links.length", "accel.unit")
    ),
    Mistake("links in mm", links(lambda own: tuple(1000 * x for x in own)), ("links.unit",)),
    Mistake("links in cm", links(lambda own: tuple(100 * x for x in own)), ("links.unit", "accel.unit")),
    Mistake(
        "links in inches", links(lambda own: tuple(x / 0.0254 for x in own)), ("links.unit", "accel.unit")
    ),
    Mistake("link 1 20 % long", links(lambda own: (1.2 * own[0], own[1])), ("links.length",)),
    Mistake("link 2 12 % short", links(lambda own: (own[0], 0.88 * own[1])), ("links.length",)),
    Mistake("force of the robot on the load", force(-_I), ("force.sign",), has_force),
    Mistake("fx's sign", force(_SIGN1), ("force.sign",), has_force),
    Mistake("fy's sign", force(_SIGN2), ("force.sign",), has_force),
    Mistake("force in kgf", force(_I / 9.80665), ("force.unit",), has_force),
    Mistake("force in pounds", force(_I / 4.4482216), ("force.unit",), has_force),
    Mistake("force in mN", force(1000 * _I), ("force.unit",), has_force),
    Mistake("fx twice too large", force(np.diag([2.0, 1.0])), ("force.unit",), has_force),
    Mistake("force sensor on the end-effector", robot(force_on_link), ("force.frame",), has_force),
    Mistake("fx and fy swapped", force(_SWAP), ("force.frame",), has_force),
    Mistake("force sensor turned by 90 degrees", turned_force(np.pi / 2), ("force.frame",), has_force),
    Mistake("force sensor turned by 0.5 rad", turned_force(0.5), ("force.frame",), has_force),
    Mistake("force sensor not zeroed", force(_I, 8.0), ("force.bias",), has_force),
    Mistake("force's sign in one trial", force(-_I, only=_LAST_LOAD), ("force.sign",), has_force),
    Mistake("a free trial among the loads", relabelled(True), ("trial.kind",)),
    Mistake("a load among the free trials", relabelled(False), ("trial.kind",)),
    Mistake("another load's name", another_load, ("trial.load",), has_two_loads),
    Mistake("a trial twice", repeated, ("trial.repeated",)),
    Mistake("payload in g", reweighed(1000.0), ("trial.load",), has_payload),
    Mistake("payload without its carrier", reweighed(0.7), ("trial.load",), has_payload),
    Mistake("robot's clock in ms", robot(lambda log: replace(log, t=1000 * log.t)), ("time.unit",)),
    Mistake("robot's rate said to be twice", robot(lambda log: replace(log, t=log.t / 2)), ("time.rate",)),
    Mistake("robot's clock jumps an hour", robot(jumps), ("time.jump",)),
    Mistake("device.csv of another trial", exchanged_modules, ("clocks.disagree",)),
    Mistake(
        "two mistakes: tau1's sign, mount by 90 degrees",
        both(torque(_SIGN1), sensor(mount_angle_rad=lambda a: a + np.pi / 2)),
        ("torque.sign",),
    ),
    Mistake("torques without their sign", robot(without_sign), ("trials.disagree", "methods.disagree")),
    Mistake("forces 20 ms late", robot(sampled_late(20)), ("methods.disagree",), fast_force),
    Mistake(
        "tau2 never logged in one trial",
        robot(constant_torque, _LAST_LOAD),
        ("trials.disagree", "methods.disagree", "trial.kind"),
    ),
    Mistake(
        "encoder 1 came off in the middle",
        device(half_stuck, _LAST_LOAD),
        ("clocks.disagree", "angle.resting"),
    ),
    Mistake("the other robot model", other_model("planar-2r-relative"), ("angle.frame",)),
    Mistake("module's clock in ms", device(module_in_ms), ("time.unit",)),
    Mistake(
        "encoder 1 backwards in one trial",
        device(lambda s, _study: replace(s, enc1=-s.enc1), _LAST_LOAD),
        ("angle.sign", "angle.zero"),
    ),
    Mistake("controller in degrees in one trial", angles(lambda a: a * _DEG, _LAST_LOAD), ("angle.unit",)),
    Mistake("force in kgf in one trial", force(_I / 9.80665, only=_LAST_LOAD), ("force.unit",), has_force),
)
