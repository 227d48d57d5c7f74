"""Which numbers of a quick fit nothing can have: the gate of physics inside the search for mistakes.

As in the gate of final results, a number counts only where its whole 95 % interval lies where nothing can be:
what a short record leaves open is no impossible robot.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from impid_host.checks.equations import Motion, Motions, low
from impid_host.checks.signals import Signals, TrialSignals
from impid_host.impedance.loads import load_model
from impid_host.signals.arrays import Floats

MATTERS = 0.05
HEAVIEST_KG = 300.0
LIGHTEST_KG = 0.003
STIFFEST_N_M = 1e6
# A joint whose torque varies by less than this share of the others' has no drive, and its row may be nothing.
UNDRIVEN = 1e-9
_NORMAL = 1.96


@dataclass(frozen=True, slots=True)
class Violation:
    """One number that is impossible ("torque.sign") or of a size that no such robot has."""

    what: str
    where: str
    value: float
    words: str
    odd_size: bool = False


@dataclass(frozen=True, slots=True)
class Numbers:
    """All parameters of a fit (k,), their covariance (k, k), where each load's stand, and its kind."""

    value: Floats
    covariance: Floats
    places: dict[str, slice]
    kinds: dict[str, str]

    def half(self, slope: Floats, first: int = 0) -> Floats:
        """Half the interval of slope @ value[first : first + q], (..., q) -> (...)."""
        own = slice(first, first + slope.shape[-1])
        variance = np.einsum("...p,pq,...q->...", slope, self.covariance[own, own], slope)
        return np.asarray(_NORMAL * np.sqrt(np.maximum(variance, 0.0)))


def violations(study: Signals, motions: Motions, numbers: Numbers) -> Iterator[Violation]:
    """What of a fit nothing can have."""
    if any(trial.kind == "free" for trial in study.trials):
        yield from _robot_violations(study, motions, numbers)
    for name, place in numbers.places.items():
        yield from _load_violations(study, name, numbers, place)


def _robot_violations(study: Signals, motions: Motions, numbers: Numbers) -> Iterator[Violation]:
    model = study.model
    p = len(model.parameter_names)
    alpha = numbers.value[:p]
    free = [trial for trial in study.trials if trial.kind == "free"]
    all_motions = [motions.of(trial, study) for trial in free]
    per_alpha = np.concatenate([motion.inertia_of for motion in all_motions])
    I = per_alpha @ alpha  # noqa: E741  (the papers' letter)
    diagonal = np.einsum("kii->ki", I)
    ok = True
    for joint in range(model.joints):
        worst = int(np.argmin(diagonal[:, joint]))
        lowest = float(diagonal[worst, joint])
        if lowest + numbers.half(per_alpha[worst, joint, joint]) < 0 and _felt(
            free, all_motions, alpha, joint
        ):
            ok = False
            yield Violation(
                "inertia",
                f"joint{joint + 1}",
                lowest,
                f"the robot's inertia about joint {joint + 1} comes out at {lowest:.3g}",
            )
    eigen, vectors = np.linalg.eigh(I)
    worst = int(np.argmin(eigen[:, 0]))
    v = vectors[worst, :, 0]
    half = float(numbers.half(np.einsum("i,ijp,j->p", v, per_alpha[worst], v)))
    if (
        ok
        and model.joints > 1
        and float(eigen[worst, 0]) < -0.02 * float(eigen[:, -1].max())
        and eigen[worst, 0] + half < 0
    ):
        yield Violation(
            "inertia",
            "+".join(f"joint{joint + 1}" for joint in range(model.joints)),
            float(eigen[worst, 0]),
            "the robot's inertia matrix is not positive definite where it moved",
        )
    half_of_each = numbers.half(np.eye(p)[:, None, :])[:, 0] if p else np.zeros(0)
    for k, unit in enumerate(model.parameter_units):
        if ("s/rad" not in unit and unit != "N*s/m") or alpha[k] + half_of_each[k] >= 0:
            continue
        joint = int(np.argmax(np.abs(all_motions[0].robot[:, :, k]).sum(axis=0)))
        torque = np.concatenate([low(trial.torque)[:, joint] for trial in free])
        part = np.concatenate([m.robot[:, joint, k] for m in all_motions]) * alpha[k]
        if np.std(part) > 0.15 * np.std(torque):
            yield Violation(
                "friction",
                f"joint{joint + 1}",
                float(alpha[k]),
                f"joint {joint + 1} has a viscous friction of {alpha[k]:.3g}: it would push itself",
            )
    if model.joints == len(model.task_axes) and ok:
        J = np.concatenate([motion.J_at for motion in all_motions])
        reach2 = np.maximum(np.sum(J**2, axis=1), 1e-12)
        spread = np.max([np.std(low(trial.torque), axis=0) for trial in free], axis=0)
        weights = np.median(diagonal / reach2, axis=0)[spread > UNDRIVEN * spread.max()]
        heavy, light = (float(weights.max()), float(weights.min())) if len(weights) else (0.0, 0.0)
        if heavy > HEAVIEST_KG or 0 < light < LIGHTEST_KG:
            yield Violation(
                "size",
                "",
                heavy if heavy > HEAVIEST_KG else light,
                f"the robot weighs like {heavy if heavy > HEAVIEST_KG else light:.3g} kg at its end",
                odd_size=True,
            )


def _felt(free: list[TrialSignals], motions: list[Motion], alpha: Floats, joint: int) -> bool:
    """Whether inertia is a part of this joint's torque that can be told."""
    p = len(alpha)
    torque = np.concatenate([low(trial.torque)[:, joint] for trial in free])
    part = np.concatenate([motion.robot[:, joint, :p] for motion in motions]) @ alpha
    return bool(np.std(part) > MATTERS * np.std(torque))


def _load_violations(study: Signals, name: str, numbers: Numbers, place: slice) -> Iterator[Violation]:
    kind = numbers.kinds[name]
    load = load_model(kind, tuple(study.model.task_axes))
    d = len(load.axes)
    mass_of, stiffness_of = (load.matrix_map(of).reshape(d, d, -1) for of in ("a", "x"))
    q = numbers.value[place]
    M, K = mass_of @ q, stiffness_of @ q

    def surely_negative(matrix: Floats, per_q: Floats) -> bool:
        values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
        v = vectors[:, 0]
        return bool(values[0] + numbers.half(np.einsum("i,ijq,j->q", v, per_q, v), place.start) < 0)

    mass = float(np.linalg.eigvalsh(0.5 * (M + M.T))[0])
    stiff = float(np.linalg.eigvalsh(0.5 * (K + K.T))[0])
    largest = float(np.abs(np.linalg.eigvalsh(0.5 * (K + K.T))).max())
    if mass < -0.05 * float(np.abs(M).max()) and float(np.trace(M)) < 0 and surely_negative(M, mass_of):
        yield Violation("mass", name, mass, f"{name} has a mass of {mass:.3g}")
    pushes = stiff < -0.05 * largest if kind == "mass-spring" else float(np.trace(K)) < -0.2 * largest
    if pushes and surely_negative(K, stiffness_of):
        words = (
            f"the springs of {name} push" if kind == "mass-spring" else f"the stiffness of {name} is negative"
        )
        yield Violation("spring", name, stiff, f"{words} ({stiff:.3g})")
    if not load.rotary and float(np.trace(M)) / d > HEAVIEST_KG:
        yield Violation("size", name, mass, f"{name} weighs {np.trace(M) / d:.3g} kg", odd_size=True)
