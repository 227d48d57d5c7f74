"""Each kind of study that the contract allows, from trials in closed form: joint, slide, stochastic arm."""

from dataclasses import replace

import numpy as np
import pytest
from impid_host.errors import UndeterminedError
from impid_host.impedance.campaign import Options, fit_study
from impid_host.impedance.constrained import constrain
from impid_host.impedance.identify import LoadFit, RobotFit
from impid_host.impedance.joint_space import Limb, joint_impedance
from impid_host.study.model import RobotLog, RobotSetup, Setup, Study, Trial

from .plant import ALPHA, L1, L2, SETUP, Load, measure, simulate

RATE = 500.0


def sines(seed: int, duration: float, highest: float, size: float) -> tuple[np.ndarray, ...]:
    """Time and a motion of ten sinusoids with its derivatives, (N, 1) each."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, duration, 1 / RATE)
    w, p = 2 * np.pi * rng.uniform(0.1, highest, 10), rng.uniform(0, 2 * np.pi, 10)
    angle = t[:, None] * w + p
    x, v = size * np.sin(angle).sum(axis=1), size * (w * np.cos(angle)).sum(axis=1)
    a = -size * (w**2 * np.sin(angle)).sum(axis=1)
    return t, x[:, None], v[:, None], a[:, None]


def single(name: str, kind: str, t: np.ndarray, x: np.ndarray, tau: np.ndarray) -> Trial:
    return Trial(name, kind, name.rsplit("_", 1)[0], RobotLog(t, x, tau))  # type: ignore[arg-type]


def test_ankle_like_joint_gives_its_impedance_without_any_robot() -> None:
    t, x, v, a = sines(1, 20, 2.0, 0.01)
    noise = np.random.default_rng(0).normal(0, 0.02, x.shape)
    tau = 0.012 * a + 0.9 * v + 60.0 * (x - 0.05) + noise
    study = Study("ankle", Setup(RobotSetup("joint-1d")), (single("ankle_01", "arm", t, x, tau),))
    result = fit_study(study, Options())
    (fit,) = result.loads
    assert fit.method == "physical sensor"  # the torque is measured at the load
    assert fit.M.unit == "kg*m^2"
    for quantity, true in ((fit.M, 0.012), (fit.B, 0.9), (fit.K, 60.0)):
        assert quantity is not None
        assert abs(quantity.value[0, 0] - true) < 3.5 * quantity.sd[0, 0]
    assert fit.x0.value[0] == pytest.approx(0.05, abs=1e-3)
    assert fit.K.value[0, 0] == pytest.approx(60.0, rel=0.01)


def test_a_footplate_found_from_a_free_trial_is_taken_off() -> None:
    t, x, v, a = sines(1, 20, 2.0, 0.03)
    free = single("free_01", "free", t, x, 0.004 * a + 0.1 * v)
    arm = single("ankle_01", "arm", t, x, (0.012 + 0.004) * a + (0.9 + 0.1) * v + 60.0 * (x - 0.05))
    result = fit_study(Study("ankle", Setup(RobotSetup("joint-1d")), (arm, free)), Options())
    assert isinstance(result.robot, RobotFit)
    assert result.robot.estimate.value == pytest.approx([0.004, 0.1], rel=1e-3)
    assert result.loads[0].M.value[0, 0] == pytest.approx(0.012, rel=1e-3)


def test_a_slide_against_a_spring() -> None:
    t, x, v, a = sines(3, 20, 2.0, 0.004)
    free = single("free_01", "free", t, x, 90.0 * a + 200.0 * v)
    spring = single("spring_01", "mass-spring", t, x, (90.0 + 2.0) * a + 200.0 * v + 5000.0 * (x - 0.01))
    (fit,) = fit_study(Study("slide", Setup(RobotSetup("slide-1d")), (free, spring)), Options()).loads
    assert fit.method == "virtual sensor"
    assert fit.M.value[0, 0] == pytest.approx(2.0, rel=0.02)
    assert fit.K.value[0, 0] == pytest.approx(5000.0, rel=1e-3)
    assert fit.x0.value[0] == pytest.approx(0.01, rel=1e-3)


@pytest.mark.parametrize(
    ("duration", "words"), [(1.0, "at least 2 s"), (2.5, "longer trials"), (0.1, "at least 100")]
)
def test_tiny_trials_are_refused_by_name(duration: float, words: str) -> None:
    t, x, v, a = sines(1, duration, 2.0, 0.01)
    study = Study("tiny", Setup(RobotSetup("joint-1d")), (single("ankle_01", "arm", t, x, a + v + x),))
    with pytest.raises(UndeterminedError, match=words) as caught:
        fit_study(study, Options(), lambda _: None)
    assert "ankle_01" in str(caught.value)


ARM_M = np.array([[1.45, 0.66], [0.66, 1.06]])
ARM_B = np.array([[10.9, 2.9], [2.9, 6.0]])
ARM_K = np.array([[172.0, 31.0], [31.0, 112.0]])
HAND = np.array([0.37, 0.01])


def shaken_trial(number: int, *, sensor: bool) -> Trial:
    """50 s of a hand shaken about HAND by noise below 10 Hz; torque by inverse dynamics of [D] eqs. 1, 11-13.

    The motion is drawn band-limited and periodic, so that its derivatives are exact; the arm's force follows
    from it, and the perturbation is what a robot of 60 N/m and 4 N s/m would have needed.
    """
    rng = np.random.default_rng(100 + number)
    count = int(50 * RATE)
    frequency = np.fft.rfftfreq(count, 1 / RATE)
    jw = 2j * np.pi * frequency[:, None]
    gain = np.where((frequency > 0) & (frequency < 10), 1 / (1 + (frequency / 3) ** 2), 0)[:, None]
    spectrum = gain * (rng.normal(size=(len(frequency), 2)) + 1j * rng.normal(size=(len(frequency), 2)))

    def back(values: np.ndarray) -> np.ndarray:
        return np.fft.irfft(values, count, axis=0)

    scale = 0.008 / back(spectrum).std()
    d, v, a = (scale * back(spectrum * jw**k) for k in range(3))
    F = a @ (ARM_M + 0.135 * np.eye(2)).T + v @ ARM_B.T + d @ ARM_K.T
    x = HAND + d
    reach = np.hypot(*x.T)
    # x = l1 cos t1 + l2 cos(t2 - pi/2), y alike: the elbow-down solution of the two circles.
    bend = np.arccos((reach**2 - L1**2 - L2**2) / (2 * L1 * L2))
    t1 = np.arctan2(x[:, 1], x[:, 0]) + np.arctan2(L2 * np.sin(bend), L1 + L2 * np.cos(bend))
    theta = np.stack([t1, t1 - bend + np.pi / 2], axis=1)
    s, c = np.sin(theta), np.cos(theta)
    J = np.moveaxis(np.array([[-L1 * s[:, 0], L2 * c[:, 1]], [L1 * c[:, 0], L2 * s[:, 1]]]), 2, 0)
    omega = np.linalg.solve(J, v[:, :, None])[:, :, 0]
    w1, w2 = omega.T
    J_rate = np.array([[-L1 * c[:, 0] * w1, -L2 * s[:, 1] * w2], [-L1 * s[:, 0] * w1, L2 * c[:, 1] * w2]])
    theta_dd = np.linalg.solve(J, (a - np.einsum("ijn,nj->ni", J_rate, omega))[:, :, None])[:, :, 0]
    a1, a2, a3, a4, a5 = ALPHA
    h = -0.5 * a2 * np.sin(theta[:, 0] - theta[:, 1])
    k = 0.5 * a2 * np.cos(theta[:, 0] - theta[:, 1])
    own = np.stack(
        [
            a1 * theta_dd[:, 0] + h * theta_dd[:, 1] + k * w2**2 + a4 * w1,
            h * theta_dd[:, 0] + a3 * theta_dd[:, 1] - k * w1**2 + a5 * w2,
        ],
        axis=1,
    )
    tau = own + np.einsum("nji,nj->ni", J, F) + rng.normal(0, 0.01, own.shape)
    perturbation = F + a * 1.0 + 4.0 * v + 60.0 * d
    measured = -F + rng.normal(0, 0.05, F.shape) if sensor else None
    count_rad = 2 * np.pi / 400_000
    log = RobotLog(
        np.arange(count) / RATE, np.round(theta / count_rad) * count_rad, tau, measured, perturbation
    )
    return Trial(f"shaken_{number:02d}", "stochastic", "shaken", log, on="arm")


def prior() -> Setup:
    return replace(SETUP, encoder=None, accelerometer=None, prior_alpha=tuple(ALPHA))


def test_stochastic_arm_by_both_domains_and_both_sensors() -> None:
    trials = tuple(shaken_trial(k, sensor=True) for k in (1, 2))
    result = fit_study(Study("shaken", prior(), trials), Options())
    assert [fit.method for fit in result.spectral] == ["virtual sensor", "physical sensor"]
    for fit in result.spectral:
        assert fit.M.value == pytest.approx(ARM_M, abs=0.03)  # the handle's 0.135 kg taken off
        assert fit.B.value == pytest.approx(ARM_B, abs=0.3)
        assert fit.K.value == pytest.approx(ARM_K, abs=3.0)
        assert fit.estimate.derived is not None
        assert len(fit.against.names) == 12
        assert "standard errors" in fit.against.verdict
    for timed in result.loads:
        assert timed.M.value == pytest.approx(ARM_M, abs=0.05)
        assert timed.K.value == pytest.approx(ARM_K, abs=3.0)


def test_a_stochastic_trial_too_short_says_so() -> None:
    trial = shaken_trial(1, sensor=False)
    log = trial.robot
    assert log.perturbation is not None
    short = RobotLog(log.t[:2000], log.theta[:2000], log.tau[:2000], None, log.perturbation[:2000])
    with pytest.raises(UndeterminedError, match=r"shaken.*longer trials"):
        fit_study(Study("short", prior(), (replace(trial, robot=short),)), Options())


@pytest.fixture(scope="module")
def arm_fit() -> LoadFit:
    arm = Load(m=1.2, K=((90.0, 20.0), (20.0, 45.0)), x0=(0.37, 0.01), B=((14.0, 2.0), (2.0, 7.0)))
    motions = {"arm_01": simulate(32, 26.0, load=arm, span_deg=10.0)}
    trials = tuple(measure(motion, name, "arm", 26.0, seed=5) for name, motion in motions.items())
    setup = replace(SETUP, prior_alpha=tuple(ALPHA), handle_mass_kg=0.0)
    return fit_study(Study("arm", setup, trials), Options()).loads[0]


def test_symmetric_fit_is_the_restricted_least_squares_solution(arm_fit: LoadFit) -> None:
    tight = constrain(arm_fit, 0.0)
    assert tight.matrices.K.value == pytest.approx(tight.matrices.K.value.T)
    assert tight.matrices.M.value == pytest.approx(tight.matrices.M.value.T)
    assert tight.p_value > 1e-3  # the truth is symmetric
    assert tight.on_boundary == ()
    assert tight.matrices.K.sd[0, 1] < arm_fit.K.sd[0, 1]
    # Independent: weighted least squares on the symmetric parameters themselves.
    names = arm_fit.estimate.names
    pairs = {"myx": "mxy", "kyx": "kxy"}
    kept = [name for name in names if name not in pairs]
    G = np.array([[float(pairs.get(name, name) == free) for free in kept] for name in names])
    W = np.linalg.inv(arm_fit.estimate.covariance)
    free = np.linalg.solve(G.T @ W @ G, G.T @ W @ arm_fit.estimate.value)
    assert tight.matrices.K.value[0, 1] == pytest.approx(free[kept.index("kxy")], rel=1e-6)
    assert tight.matrices.M.value[0, 0] == pytest.approx(free[kept.index("mxx")], rel=1e-6)


def test_an_indefinite_stiffness_is_moved_and_said(arm_fit: LoadFit) -> None:
    value = arm_fit.estimate.value.copy()
    value[arm_fit.estimate.names.index("kyy")] = -5.0
    bent = replace(arm_fit, estimate=replace(arm_fit.estimate, value=value))
    tight = constrain(bent, 0.0)
    assert "K" in tight.on_boundary
    assert np.linalg.eigvalsh(tight.matrices.K.value)[0] >= -1e-9
    assert "moved" in tight.verdict


def test_joint_space_impedance_by_virtual_work(arm_fit: LoadFit) -> None:
    limb = Limb(0.30, 0.33, (0.37, -0.45))
    joint = joint_impedance(arm_fit, limb, 0.0)
    shoulder, elbow = joint.posture

    def hand(s: float, e: float) -> np.ndarray:
        upper, fore = 0.30 * np.exp(1j * s), 0.33 * np.exp(1j * (s + e))
        return np.add(limb.shoulder_m, [(upper + fore).real, (upper + fore).imag])

    assert hand(shoulder, elbow) == pytest.approx(arm_fit.x0.value, abs=1e-12)
    assert elbow > 0  # a right arm

    # A small turn of each joint moves the hand; the work of the endpoint spring is that of the joint spring.
    def energy(turn: np.ndarray) -> float:
        away = hand(*(joint.posture + turn)) - arm_fit.x0.value
        return 0.5 * float(away @ arm_fit.K.value @ away)

    for turn in (np.array([1e-4, 0.0]), np.array([0.0, 1e-4]), np.array([1e-4, -2e-4])):
        assert energy(turn) == pytest.approx(0.5 * turn @ joint.stiffness.value @ turn, rel=1e-3)
    with pytest.raises(UndeterminedError, match="do not reach"):
        joint_impedance(arm_fit, Limb(0.2, 0.2, (0.37, -0.45)), 0.0)


def test_what_the_motion_cannot_show_comes_as_the_combination_it_can() -> None:
    t, x, v, a = sines(5, 20, 2.0, 0.05)
    theta = np.pi / 4 + np.hstack([x, 0 * x])  # joint 2 stands still
    a1, a2, _, a4, _ = ALPHA
    half_sin, half_cos = 0.5 * np.sin(theta[:, 0] - theta[:, 1]), 0.5 * np.cos(theta[:, 0] - theta[:, 1])
    tau = np.stack(
        [a1 * a[:, 0] + a4 * v[:, 0], -a2 * (half_sin * a[:, 0] + half_cos * v[:, 0] ** 2)], axis=1
    )
    setup = replace(SETUP, encoder=None, accelerometer=None)
    free = Trial("free_01", "free", "free", RobotLog(t, theta, tau))
    robot = fit_study(Study("still", setup, (free,)), Options()).robot
    assert isinstance(robot, RobotFit)
    assert robot.estimate.names == ("alpha1", "alpha2", "alpha4")  # nothing is said of alpha3 and alpha5
    assert robot.estimate.value == pytest.approx([a1, a2, a4], rel=2e-3)
    assert robot.parameters.unseen is not None
    loaded = Trial("spring_01", "mass-spring", "spring", RobotLog(t, theta + np.hstack([0 * x, x]), tau))
    with pytest.raises(UndeterminedError, match="moves every joint"):
        fit_study(Study("still", setup, (free, loaded)), Options())
