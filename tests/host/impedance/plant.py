"""A robot that shares nothing with impid: two rigid rods, moved by their kinetic energy.

The motion is prescribed in closed form. Velocities of the centres of mass are complex-step derivatives of
their positions, the mass matrix follows from the kinetic energy, the velocity terms from its finite
differences; the torque is what Lagrange's equations then ask for with the load on the tip.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from impid_host.samples import DeviceSamples
from impid_host.study.model import (
    AccelerometerSetup,
    EncoderSetup,
    RobotLog,
    RobotSetup,
    Setup,
    Study,
    Trial,
)
from scipy.interpolate import CubicSpline

L1, L2 = 0.254, 0.2667
ALPHA = np.array([0.06929, 0.04217, 0.04416, 0.06510, 0.07389])  # [D] Table VI
MASS2 = 0.5
CENTRE2 = ALPHA[1] / (2 * MASS2 * L1)  # alpha2 = 2 m2 l1 c2
INERTIA2 = ALPHA[2] - MASS2 * CENTRE2**2
INERTIA1 = ALPHA[0] - MASS2 * L1**2  # of link 1 about its joint
COUNT = 2 * np.pi / 400_000
RATE_HZ = 1000.0


@dataclass(frozen=True)
class Load:
    """-F_ext = m x'' + B x' + K (x - x0)."""

    m: float = 0.786
    K: tuple[tuple[float, float], tuple[float, float]] = ((421.57, -18.87), (-18.87, 213.35))
    x0: tuple[float, float] = (0.364, -0.009)
    B: tuple[tuple[float, float], tuple[float, float]] = ((0.0, 0.0), (0.0, 0.0))


def centre_of_link2(t1: np.ndarray, t2: np.ndarray) -> np.ndarray:
    return np.array([L1 * np.cos(t1) + CENTRE2 * np.sin(t2), L1 * np.sin(t1) - CENTRE2 * np.cos(t2)])


def tip(t1: np.ndarray, t2: np.ndarray) -> np.ndarray:
    return np.array([L1 * np.cos(t1) + L2 * np.sin(t2), L1 * np.sin(t1) - L2 * np.cos(t2)])


def slope(point: Callable[[np.ndarray, np.ndarray], np.ndarray], theta: np.ndarray) -> np.ndarray:
    """d point / d theta by complex step, exact to rounding: (N, 2) -> (N, 2, 2)."""
    step = 1e-30
    t1, t2 = theta.T
    both = [point(t1 + 1j * step, t2 + 0j).imag, point(t1 + 0j, t2 + 1j * step).imag]
    return np.stack(both).transpose(2, 1, 0) / step


def mass_matrix(theta: np.ndarray, payload: float) -> np.ndarray:
    """(N, 2) -> (N, 2, 2)."""
    centre, end = slope(centre_of_link2, theta), slope(tip, theta)
    moving = MASS2 * centre.swapaxes(1, 2) @ centre + payload * end.swapaxes(1, 2) @ end
    return np.diag([INERTIA1, INERTIA2]) + moving


def velocity_terms(theta: np.ndarray, omega: np.ndarray, payload: float) -> np.ndarray:
    """d/dt (M) omega - 1/2 d/dtheta (omega' M omega), Lagrange's equations without the M theta'' part."""
    step = 1e-5
    slopes = [
        (mass_matrix(theta + shift, payload) - mass_matrix(theta - shift, payload)) / (2 * step)
        for shift in np.eye(2) * step
    ]
    rate = slopes[0] * omega[:, 0, None, None] + slopes[1] * omega[:, 1, None, None]
    energy = np.stack([np.einsum("ni,nij,nj->n", omega, each, omega) for each in slopes], axis=1)
    return np.einsum("nij,nj->ni", rate, omega) - 0.5 * energy


@dataclass(frozen=True)
class Motion:
    """The true motion on the robot's clock, at any instant: (N,) -> (N, 4) or (N, 2)."""

    state: Callable[[np.ndarray], np.ndarray]
    torque: Callable[[np.ndarray], np.ndarray]
    acceleration: Callable[[np.ndarray], np.ndarray]
    force: Callable[[np.ndarray], np.ndarray]
    load: Load | None


Closed = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


def reference(seed: int, centre: np.ndarray, span_deg: float) -> Closed:
    """Ten sinusoids in 0 to 2 Hz per joint over `span_deg`, [D] Sec. II-C: angle, velocity, acceleration."""
    rng = np.random.default_rng(seed)
    frequency = 2 * np.pi * (np.arange(1, 11) - rng.uniform(0.0, 0.05, (2, 10))) / 5
    phase = rng.uniform(0, 2 * np.pi, (2, 10))
    t = np.linspace(0, 50, 4000)
    shape = np.sin(frequency[:, :, None] * t + phase[:, :, None]).sum(axis=1)
    gain = np.deg2rad(span_deg) / np.ptp(shape, axis=1)

    def at(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        argument = t[:, None, None] * frequency + phase
        sine, cosine = np.sin(argument), np.cos(argument)
        return (
            centre + gain * sine.sum(axis=2),
            gain * (frequency * cosine).sum(axis=2),
            -gain * (frequency**2 * sine).sum(axis=2),
        )

    return at


def simulate(
    seed: int,
    duration: float,
    *,
    load: Load | None = None,
    span_deg: float = 40.0,
    disturbance: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None,
) -> Motion:
    """The prescribed motion with the torque that it takes; `disturbance` is a torque that the model lacks."""
    follow = reference(seed, np.array([np.pi / 4, np.pi / 4]), span_deg)
    # Nothing here moves faster than some 10 Hz: 250 Hz and a cubic spline lose less than 1e-5 of it.
    knots = np.linspace(0, duration, int(250 * duration))
    theta, omega, theta_dd = follow(knots)
    end = slope(tip, theta)
    acceleration = np.einsum("nij,nj->ni", end, theta_dd) + bend(theta, omega)
    torque = np.einsum("nij,nj->ni", mass_matrix(theta, 0.0), theta_dd)
    torque = torque + velocity_terms(theta, omega, 0.0) + ALPHA[3:] * omega
    if disturbance is not None:
        torque = torque + disturbance(theta, omega)
    force = np.zeros_like(acceleration)
    if load is not None:
        x, v = tip(*theta.T).T, np.einsum("nij,nj->ni", end, omega)
        force = -(load.m * acceleration + v @ np.array(load.B).T + (x - load.x0) @ np.array(load.K).T)
        torque = torque - np.einsum("nji,nj->ni", end, force)

    def state(t: np.ndarray) -> np.ndarray:
        angle, velocity, _ = follow(t)
        return np.concatenate([angle, velocity], axis=1)

    return Motion(
        state=state,
        torque=CubicSpline(knots, torque),
        acceleration=CubicSpline(knots, acceleration),
        force=CubicSpline(knots, force),
        load=load,
    )


@dataclass(frozen=True)
class Noise:
    """Standard deviations per sample; the accelerometer's is the ADXL203's 110 ug/sqrt(Hz) over 785 Hz."""

    acceleration: float = 0.030
    torque: float = 0.01
    force: float = 0.05


SETUP = Setup(
    robot=RobotSetup("planar-2r-absolute", (L1, L2)),
    encoder=EncoderSetup((400_000, 400_000), (0.1, -0.2), (1, -1)),
    accelerometer=AccelerometerSetup("ADXL203", 3.3, 65536, (1.65, 1.64), (0.62, 0.625), "link2", 0.3),
    handle_mass_kg=0.135,
)


def measure(
    motion: Motion,
    name: str,
    kind: str,
    duration: float,
    *,
    seed: int,
    noise: Noise = Noise(),
    offset: float = 17.3,
    drift: float = 60e-6,
) -> Trial:
    """What module and robot would log of a motion; the module starts 0.4 s late, its clock `drift` fast."""
    rng = np.random.default_rng(seed)
    t_robot = np.arange(0.05, duration, 1 / RATE_HZ)
    t_us = np.arange(np.ceil((offset + 0.4) * 1e6), (offset + duration) * 1e6, 1000).astype(np.uint64)
    t_module = (t_us * 1e-6 - offset) / (1 + drift)
    t_us, t_module = t_us[t_module < duration], t_module[t_module < duration]
    states = motion.state(t_module)
    acceleration = motion.acceleration(t_module)
    encoder, sensor = SETUP.encoder, SETUP.accelerometer
    assert encoder is not None and sensor is not None
    counts = np.round((states[:, :2] - encoder.zero_rad) * encoder.direction / COUNT).astype(np.int32)
    angle = states[:, 1] + sensor.mount_angle_rad
    axes = np.stack(
        [
            np.cos(angle) * acceleration[:, 0] + np.sin(angle) * acceleration[:, 1],
            -np.sin(angle) * acceleration[:, 0] + np.cos(angle) * acceleration[:, 1],
        ],
        axis=1,
    )
    axes = axes + rng.normal(0, noise.acceleration, axes.shape)
    volts = np.array(sensor.zero_g_V) + axes / 9.80665 * np.array(sensor.sensitivity_V_per_g)
    codes = np.round(volts / 3.3 * 65536).astype(np.uint16)
    device = DeviceSamples(
        t_us=t_us,
        seq=np.arange(len(t_us), dtype=np.uint32),
        ax=codes[:, 0],
        ay=codes[:, 1],
        enc1=counts[:, 0],
        enc2=counts[:, 1],
        flags=np.zeros(len(t_us), dtype=np.uint8),
    )
    at_robot = motion.state(t_robot)
    tau = motion.torque(t_robot)
    force = None
    if motion.load is not None:
        force = motion.force(t_robot) + rng.normal(0, noise.force, (len(t_robot), 2))
    log = RobotLog(
        t=t_robot,
        theta=np.round(at_robot[:, :2] / COUNT) * COUNT,
        tau=tau + rng.normal(0, noise.torque, tau.shape),
        force=force,
    )
    return Trial(name, kind, name.rsplit("_", 1)[0], log, device)  # type: ignore[arg-type]


def bend(theta: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """J' theta', J' by central difference along the motion, (N, 2)."""
    step = 1e-5
    J_rate = (slope(tip, theta + step * omega) - slope(tip, theta - step * omega)) / (2 * step)
    return np.einsum("nij,nj->ni", J_rate, omega)


def make_study(motions: dict[str, Motion], noise: Noise) -> Study:
    trials = [
        measure(
            motion,
            name,
            "free" if motion.load is None else "mass-spring",
            26.0,
            seed=index,
            noise=noise,
            offset=17.3 + 60 * index,
        )
        for index, (name, motion) in enumerate(motions.items())
    ]
    return Study("synthetic", replace(SETUP), tuple(trials))
