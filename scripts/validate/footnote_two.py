"""When does Method 1 need the accelerometer? Encoders, clocks, differentiation and an elastic capstan in turn.

The first paper's footnote 2 says that angles differentiated twice gave impedances that did not agree with theory.
Here its protocol in closed form at 1 kHz: the links move by ten sinusoids per joint, torques follow from its model, and
one thing at a time stands between the links and what is recorded. Encoders sit on the motors, as in the paper, so
with an elastic capstan they read theta + tau / k; the accelerometer rides on the end-effector.
"""

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from impid_host.impedance.identify import identify_load, identify_robot
from impid_host.impedance.loads import mass_spring
from impid_host.impedance.rows import Split
from impid_host.robot.planar_2r_absolute import Planar2RAbsolute
from impid_host.robot.terms import RobotStructure
from impid_host.signals.align import AccelerationSource, AlignedTrial, joint_acceleration
from impid_host.signals.chain import DEFAULT, PUBLISHED, PUBLISHED_CUTOFF_HZ, Chain, erode
from impid_host.signals.filters import ZeroPhaseLowPass, central_difference
from matplotlib.figure import Figure

ROBOT = Planar2RAbsolute(0.254, 0.2667)
STRUCTURE = RobotStructure(ROBOT)
ALPHA = np.array([0.06929, 0.04217, 0.04416, 0.06510, 0.07389])  # Table VI
# m, kxx, kyy, ks, x0, y0 of K1 with M1, K3 with M3, K5 with M5: Table I.
LOADS = (
    (0.539, 421.57, 213.35, -18.87, 0.364, -0.009),
    (1.031, 239.54, 421.29, -12.52, 0.394, 0.053),
    (1.527, 373.81, 377.10, 73.16, 0.332, -0.061),
)
RATE_HZ, DURATION_S = 1000.0, 50.0
TORQUE_NM, ACCELERATION_M_S2 = 0.02, 0.015  # rms per sample
_LOW_PASS = ZeroPhaseLowPass(order=5, cutoff_hz=PUBLISHED_CUTOFF_HZ)


def _slope(values: np.ndarray, rate_hz: float) -> np.ndarray:
    return _LOW_PASS.apply(central_difference(values, rate_hz), rate_hz)


def _slope_twice(values: np.ndarray, rate_hz: float) -> np.ndarray:
    return _LOW_PASS.apply(central_difference(central_difference(values, rate_hz), rate_hz), rate_hz)


def _published_twice(values: np.ndarray, rate_hz: float) -> np.ndarray:
    return PUBLISHED.derivative(PUBLISHED.derivative(values, rate_hz), rate_hz)


CHAINS: dict[str, Chain] = {
    "published": PUBLISHED,
    "published, its differentiation filter twice": replace(PUBLISHED, second_derivative=_published_twice),
    "differences and low-pass": replace(
        PUBLISHED,
        value=_LOW_PASS.apply,
        derivative=_slope,
        second_derivative=_slope_twice,
        torque=_LOW_PASS.apply,
    ),
}


@dataclass(frozen=True)
class Condition:
    """What stands between the links and the record.

    Attributes:
        counts_per_rev: of both encoders; 0 reads angles exactly.
        jitter_s: rms by which an encoder is read early or late, unknown to the stamps.
        capstan_Nm_rad: stiffness between motor, where the encoders are, and link; 0 is rigid.
        chain: by its name in `CHAINS`; cutoff_Hz: of the default chain, in its place, where it is not 0.
        band_Hz: highest frequency of the motion.
    """

    name: str
    counts_per_rev: int = 400_000
    jitter_s: float = 0.0
    capstan_Nm_rad: float = 0.0
    chain: str = "published"
    cutoff_Hz: float = 0.0
    rate_Hz: float = RATE_HZ
    band_Hz: float = 2.0

    def signal_chain(self) -> Chain:
        """What signals go through."""
        return DEFAULT.with_cutoff(self.cutoff_Hz) if self.cutoff_Hz else CHAINS[self.chain]


COUNTS = (800_000, 400_000, 40_000, 10_000, 4_000, 2_000, 1_000, 500, 250)
JITTERS_S = (1e-4, 1e-3, 5e-3)
CAPSTANS = (20_000.0, 5_000.0, 2_000.0, 1_000.0, 500.0)
CONDITIONS = (
    *(Condition(f"{count} counts/turn", counts_per_rev=count) for count in COUNTS),
    *(Condition(f"read with {1e3 * jitter:g} ms jitter", jitter_s=jitter) for jitter in JITTERS_S),
    *(Condition(name, chain=name) for name in CHAINS if name != "published"),
    *(Condition(f"capstan of {k:g} N m/rad", capstan_Nm_rad=k) for k in CAPSTANS),
)
SOURCES: tuple[AccelerationSource, ...] = ("accelerometer", "angles")


def resonance_hz(capstan_Nm_rad: float) -> float:
    """Lowest frequency of robot and 1 kg against locked motors."""
    theta = np.full((1, 2), np.pi / 4)
    unit = np.eye(2)
    still = np.zeros((1, 2))
    inertia = np.stack([ROBOT.regressor(theta, still, unit[j : j + 1])[0] @ ALPHA for j in range(2)], axis=1)
    J = ROBOT.jacobian(theta)[0]
    return float(np.sqrt(capstan_Nm_rad / np.linalg.eigvalsh(inertia + J.T @ J)[-1]) / (2 * np.pi))


@dataclass(frozen=True)
class Record:
    """One trial as recorded: angles read, specific force along the sensor's axes, torques, (N, 2) each."""

    t: np.ndarray
    read: np.ndarray
    felt: np.ndarray
    tau: np.ndarray
    free: bool


def trial(
    rng: np.random.Generator, condition: Condition, source: AccelerationSource, load: Sequence[float] | None
) -> AlignedTrial:
    """One recorded trial, 40 deg free or 10 deg loaded, through the condition's chain."""
    return prepared(recorded(rng, condition, load), source, condition)


def recorded(rng: np.random.Generator, condition: Condition, load: Sequence[float] | None) -> Record:
    """What the condition leaves of one trial, 40 deg free or 10 deg loaded."""
    t = np.arange(int(condition.rate_Hz * DURATION_S)) / condition.rate_Hz
    w, phase = 2 * np.pi * rng.uniform(0.05, condition.band_Hz, (2, 10)), rng.uniform(0, 2 * np.pi, (2, 10))
    angle = t[:, None, None] * w + phase
    sine, cosine = np.sin(angle), np.cos(angle)
    gain = np.deg2rad(40.0 if load is None else 10.0) / np.ptp(sine.sum(axis=2), axis=0)
    theta, omega = np.pi / 4 + gain * sine.sum(axis=2), gain * (w * cosine).sum(axis=2)
    theta_dd = -gain * (w**2 * sine).sum(axis=2)
    J, J_rate = ROBOT.jacobian(theta), ROBOT.jacobian_rate(theta, omega)
    a = np.einsum("nij,nj->ni", J, theta_dd) + np.einsum("nij,nj->ni", J_rate, omega)
    tau = ROBOT.regressor(theta, omega, theta_dd) @ ALPHA
    if load is not None:
        m, kxx, kyy, ks, *x0 = load
        push = m * a + (ROBOT.position(theta) - x0) @ np.array([[kxx, ks], [ks, kyy]])
        tau = tau + np.einsum("nji,nj->ni", J, push)
    felt = _turned(a, -theta[:, 1]) + rng.normal(0, ACCELERATION_M_S2, a.shape)
    read = theta + omega * condition.jitter_s * rng.normal(size=theta.shape)
    if condition.capstan_Nm_rad:
        read = read + tau / condition.capstan_Nm_rad
    if condition.counts_per_rev:
        step = 2 * np.pi / condition.counts_per_rev
        read = np.floor(read / step) * step
    return Record(t, read, felt, tau + rng.normal(0, TORQUE_NM, tau.shape), load is None)


def _turned(values: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """(N, 2) turned by `angle` (N,), counter-clockwise."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * values[:, 0] - s * values[:, 1], s * values[:, 0] + c * values[:, 1]], axis=1)


def prepared(record: Record, source: AccelerationSource, condition: Condition) -> AlignedTrial:
    """A record through the condition's chain."""
    t, read, felt, tau, free = record.t, record.read, record.felt, record.tau, record.free
    chain = condition.signal_chain()
    rate_hz = condition.rate_Hz
    theta, omega = chain.value(read, rate_hz), chain.derivative(read, rate_hz)
    J, J_rate = ROBOT.jacobian(theta), ROBOT.jacobian_rate(theta, omega)
    if source == "accelerometer":
        a = _turned(chain.value(felt, rate_hz), theta[:, 1])
        theta_dd = joint_acceleration(a, J, J_rate, omega)
    else:
        theta_dd = chain.second_derivative(read, rate_hz)
        a = np.einsum("nij,nj->ni", J, theta_dd) + np.einsum("nij,nj->ni", J_rate, omega)
    return AlignedTrial(
        name="free" if free else "spring",
        kind="free" if free else "mass-spring",
        load="free" if free else "spring",
        t=t,
        rate_hz=rate_hz,
        theta=theta,
        omega=omega,
        theta_dd=theta_dd,
        tau=chain.torque(tau, rate_hz),
        force=None,
        perturbation=None,
        x=ROBOT.position(theta),
        v=np.einsum("nij,nj->ni", J, omega),
        a=a,
        valid=erode(np.ones(len(t), dtype=bool), int(chain.edge_s * rate_hz)),
        source=source,
        clock=None,
    )


def examine(condition: Condition, source: AccelerationSource, seed: int = 2) -> dict[str, float]:
    """Largest errors of Method 1 over the loads, %, and its lowest VAF, %; both sources see the same motions."""
    rng = np.random.default_rng(seed)
    chain, split = condition.signal_chain(), Split()
    free = [trial(rng, condition, source, None) for _ in range(3)]
    robot = identify_robot(free, STRUCTURE, chain, split).parameters
    errors, vaf = [], []
    for load in LOADS:
        loaded = [trial(rng, condition, source, load)]
        fit = identify_load(loaded, mass_spring(), chain, split, robot=robot, handle_mass_kg=0.0)
        found = (fit.M.value[0, 0], fit.K.value[0, 0], fit.K.value[1, 1])
        errors.append([100 * (value / truth - 1) for value, truth in zip(found, load[:3], strict=True)])
        vaf.append(float(fit.vaf.min()))
    m, *K = np.array(errors).T
    return {
        "m_percent": float(m[np.argmax(np.abs(m))]),
        "K_percent": float(np.array(K).ravel()[np.argmax(np.abs(K))]),
        "lowest_vaf": min(vaf),
    }


def sweep(workers: int = 2) -> list[dict[str, Any]]:
    """Every condition with and without the accelerometer."""
    jobs = list(product(CONDITIONS, SOURCES))
    with ProcessPoolExecutor(workers) as pool:
        results = list(pool.map(examine, *zip(*jobs, strict=True)))
    rows: list[dict[str, Any]] = []
    for k, condition in enumerate(CONDITIONS):
        row: dict[str, Any] = asdict(condition)
        if condition.capstan_Nm_rad:
            row["resonance_Hz"] = resonance_hz(condition.capstan_Nm_rad)
        rows.append(row | {source: results[2 * k + j] for j, source in enumerate(SOURCES)})
    return rows


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Error of m against encoder resolution and against the capstan's resonance."""
    figure = Figure(figsize=(7.0, 2.9), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    fine = [row for row in rows if row["name"].endswith("counts/turn")]
    soft = [row for row in rows if row["capstan_Nm_rad"]]
    for source, color, marker in (("accelerometer", "#0072b2", "o"), ("angles", "#d55e00", "s")):
        style = {"color": color, "marker": marker, "ms": 4, "lw": 1.0, "label": source}
        left.loglog(
            [row["counts_per_rev"] for row in fine], [abs(row[source]["m_percent"]) for row in fine], **style
        )
        right.loglog(
            [row["resonance_Hz"] for row in soft], [abs(row[source]["m_percent"]) for row in soft], **style
        )
    left.set(xlabel="encoder (counts per turn)", ylabel="largest error of m (%)", title="rigid")
    right.set(xlabel="resonance on the capstan, 1 kg (Hz)", title="elastic capstan, 400000 counts")
    ticks = (10, 20, 30, 60)
    right.set_xticks(ticks, [str(tick) for tick in ticks])
    right.set_xticks([], minor=True)
    left.legend(frameon=False, title="accelerations from")
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=180)
