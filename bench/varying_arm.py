"""One simulated arm in closed form whose stiffness, damping and equilibrium follow known courses.

Nothing of the estimator is used to make it: motion is a sum of sinusoids with exact derivatives, and the force
is M a + B(t) v + K(t) (x - x0(t)) with noise whose spectrum has a pole. A course is a ramp, a soft step, a sine,
a bump or nothing.
"""

from dataclasses import dataclass

import numpy as np
from impid_host.signals.align import AlignedTrial
from scipy import signal

RATE, SECONDS = 100.0, 60.0
COURSES = ("constant", "ramp", "step", "sine", "bump")
POLES_HZ = (None, 1.5, 0.3)
MATRICES = {
    1: {"M": np.array([[1.2]]), "B": np.array([[14.0]]), "K": np.array([[220.0]])},
    2: {
        "M": np.array([[1.42, 0.1], [0.1, 0.99]]),
        "B": np.array([[14.3, 1.6], [1.1, 8.8]]),
        "K": np.array([[210.0, 30.0], [25.0, 120.0]]),
    },
}


@dataclass(frozen=True)
class Arm:
    """A trial and its truth: M (d, d); K, B (N, d, d) and x0 (N, d) at the trial's instants."""

    trial: AlignedTrial
    M: np.ndarray
    B: np.ndarray
    K: np.ndarray
    x0: np.ndarray
    courses: dict[str, str]


def course(rng: np.random.Generator, kind: str, s: np.ndarray) -> np.ndarray:
    """A shape over s in 0 to 1 with about -1/2 to 1/2 of range, its mean taken off."""
    if kind == "ramp":
        shape = s * rng.choice([-1, 1])
    elif kind == "step":
        shape = 0.5 * np.tanh((s - rng.uniform(0.25, 0.75)) / rng.uniform(0.04, 0.15)) * rng.choice([-1, 1])
    elif kind == "sine":
        shape = 0.5 * np.sin(2 * np.pi * (s / rng.uniform(0.3, 1.2) + rng.uniform()))
    elif kind == "bump":
        shape = np.exp(-0.5 * ((s - rng.uniform(0.2, 0.8)) / rng.uniform(0.06, 0.2)) ** 2)
    else:
        shape = np.zeros_like(s)
    return np.asarray(shape - np.mean(shape))


def motion(rng: np.random.Generator, t: np.ndarray, d: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Twenty sinusoids from 0.1 to 3.5 Hz along each axis, 1.2 cm rms: position, velocity, acceleration."""
    w = 2 * np.pi * rng.uniform(0.1, 3.5, (d, 20))
    angle = t[:, None, None] * w + rng.uniform(0, 2 * np.pi, w.shape)
    size = 0.012 * np.sqrt(2 / 20)
    parts = np.sin(angle), w * np.cos(angle), -(w**2) * np.sin(angle)
    x, v, a = (size * part.sum(axis=2) for part in parts)
    return x, v, a


def noise(rng: np.random.Generator, shape: tuple[int, int], rms: float, pole_hz: float | None) -> np.ndarray:
    """White or first-order coloured, rms over all frequencies."""
    p = 0.0 if pole_hz is None else np.exp(-2 * np.pi * pole_hz / RATE)
    white = rng.normal(size=(shape[0] + 2000, shape[1]))
    coloured: np.ndarray = signal.lfilter([np.sqrt(1 - p**2)], [1.0, -p], white, axis=0)
    return rms * coloured[2000:]


def arm(seed: int, d: int, *, constant: bool = False, seconds: float = SECONDS) -> Arm:
    """Arm number `seed` along d axes; `constant`: nothing changes."""
    rng = np.random.default_rng([seed, d, constant])
    t = np.arange(int(RATE * seconds)) / RATE
    s = t / t[-1]
    x, v, a = motion(rng, t, d)
    own = MATRICES[d]
    kinds = {name: "constant" if constant else str(rng.choice(COURSES)) for name in ("B", "K", "x0")}
    if not constant and kinds["K"] == "constant" and rng.uniform() < 0.7:
        kinds["K"] = str(rng.choice(COURSES[1:]))
    size = {"B": rng.uniform(0.1, 0.8), "K": rng.uniform(0.1, 0.9), "x0": rng.uniform(0.002, 0.01)}
    K = own["K"] * (1 + size["K"] * course(rng, kinds["K"], s))[:, None, None]
    B = own["B"] * (1 + size["B"] * course(rng, kinds["B"], s))[:, None, None]
    way = rng.normal(size=d)
    x0 = 0.004 * rng.normal(size=d) + size["x0"] * course(rng, kinds["x0"], s)[
        :, None
    ] * way / np.linalg.norm(way)
    load = a @ own["M"].T + np.einsum("nij,nj->ni", B, v) + np.einsum("nij,nj->ni", K, x - x0)
    pole = POLES_HZ[seed % len(POLES_HZ)]
    rms = {None: 0.5, 1.5: 0.35, 0.3: 0.25}[pole]
    load = load + noise(rng, load.shape, rms * np.exp(rng.uniform(np.log(0.4), np.log(4.0))), pole)
    valid = np.ones(len(t), dtype=bool)
    valid[: int(RATE)] = valid[-int(RATE) :] = False
    empty = np.zeros((len(t), d))
    trial = AlignedTrial(
        name=f"arm_{seed}", kind="arm", load="arm", t=t, rate_hz=RATE, theta=empty, omega=empty, theta_dd=empty,
        tau=empty, force=-load, perturbation=None, x=x, v=v, a=a, valid=valid, source="angles", clock=None,
    )  # fmt: skip
    return Arm(trial, own["M"], B, K, x0, kinds)
