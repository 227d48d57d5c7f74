"""All channels of a study at once: what each leaves unexplained, and which numbers nothing can have.

One least-squares fit holds the torques of all trials, the force sensor's readings, and weighed payloads; so a
channel that contradicts the others shows. Every channel's residual is taken over its own size, so that units
do not matter. The score is the sum of log(r^2): a study in order has a few thousandths to hundredths in each.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from impid_host.checks.equations import Motion, Motions, force_in_base, low, turned
from impid_host.checks.signals import Signals, TrialSignals
from impid_host.impedance.loads import load_model
from impid_host.signals.arrays import Floats

# A channel explained to half a percent is explained; less would be the noise's business.
FLOOR = 0.005
_WEIGHT = 0.03
_PAYLOAD = 0.02
_RIDGE = 1e-9
# What a number costs that no robot or load can have: as much as a channel explained beside one that is not.
IMPOSSIBLE = 8.0
ODD_SIZE = 3.0
MATTERS = 0.05
HEAVIEST_KG = 300.0
LIGHTEST_KG = 0.003
STIFFEST_N_M = 1e6


@dataclass(frozen=True, slots=True)
class Violation:
    """One number that is impossible ("torque.sign") or of a size that no such robot has."""

    what: str
    where: str
    value: float
    words: str
    odd_size: bool = False


@dataclass(frozen=True, slots=True)
class JointFit:
    """The fit of a study's channels.

    Attributes:
        left: rms left over its size, by channel ("tau1 free", "fx", "ax", "theta1", ...).
        alpha: the robot's parameters, (p,); loads: each load's parameters.
        by_trial: rms of the torque left over its size, by trial.
    """

    left: dict[str, float]
    alpha: Floats
    loads: dict[str, Floats]
    violations: tuple[Violation, ...]
    by_trial: dict[str, float] = field(default_factory=dict)

    @property
    def score(self) -> float:
        """Lower is better."""
        fit = sum(np.log(FLOOR**2 + min(r, 3.0) ** 2) for r in self.left.values())
        return float(fit) + sum(ODD_SIZE if one.odd_size else IMPOSSIBLE for one in self.violations)

    @property
    def worst(self) -> float:
        """Largest share left in any channel."""
        return max(self.left.values(), default=0.0)


@dataclass(slots=True)
class _Block:
    """Rows of one trial and channel: which columns of the whole they fill."""

    group: str
    trial: str
    design: Floats
    columns: slice
    more: tuple[Floats, slice] | None
    target: Floats


def fit_jointly(study: Signals, motions: Motions) -> JointFit:
    """Fit every channel of a study.

    Args:
        motions: of the same kinds of load; keeps regressors between calls.
    """
    names = list(dict.fromkeys(trial.load for trial in study.trials if trial.kind != "free"))
    kinds = {trial.load: trial.kind for trial in study.trials if trial.kind != "free"}
    axes = tuple(study.model.task_axes)
    p = len(study.model.parameter_names) + 2 * study.model.joints
    places, start = {}, p
    for name in names:
        q = len(load_model(kinds[name], axes).columns)
        places[name] = slice(start, start + q)
        start += q
    bias = slice(start, start + 2)
    size = start + 2
    blocks = list(_blocks(study, motions, places, slice(0, p), bias))
    scale = _scales(blocks)
    normal, right = np.zeros((size, size)), np.zeros(size)
    for block in blocks:
        w = 1 / (_WEIGHT * scale[block.group]) ** 2
        _add(normal, right, block, w)
    _add_payloads(normal, right, study, places)
    _add_prior(normal, right, study)
    value = _solved(normal, right)
    left, by_trial = _left(blocks, value, scale)
    loads = {name: value[place] for name, place in places.items()}
    left |= _payloads_left(study, loads)
    left |= accelerations_left(study, motions)
    left |= angles_left(study)
    alpha = value[: len(study.model.parameter_names)]
    return JointFit(left, alpha, loads, tuple(_violations(study, motions, value, loads, kinds)), by_trial)


def _blocks(
    study: Signals, motions: Motions, places: dict[str, slice], robot: slice, bias: slice
) -> Iterator[_Block]:
    for trial in study.trials:
        motion = motions.of(trial, study)
        place = places.get(trial.load) if trial.kind != "free" else None
        tau = low(trial.torque)
        for joint in range(tau.shape[1]):
            more = None if place is None else (motion.load[trial.kind][:, joint], place)
            group = f"tau{joint + 1} {'free' if place is None else 'load'}"
            yield _Block(group, trial.name, motion.robot[:, joint], robot, more, tau[:, joint])
        force = force_in_base(trial, study, motion.tip) if study.planar else None
        if force is None:
            continue
        for axis in range(2):
            unit = np.zeros((len(force), 2))
            unit[:, axis] = 1.0
            if place is None:
                continue
            yield _Block(
                f"f{'xy'[axis]}",
                trial.name,
                -motion.task[trial.kind][:, axis],
                place,
                (unit, bias),
                force[:, axis],
            )


def _scales(blocks: list[_Block]) -> dict[str, float]:
    """rms of each channel about its trials' means."""
    square: dict[str, float] = {}
    count: dict[str, int] = {}
    for block in blocks:
        square[block.group] = square.get(block.group, 0.0) + len(block.target) * float(np.var(block.target))
        count[block.group] = count.get(block.group, 0) + len(block.target)
    return {group: max(np.sqrt(square[group] / max(count[group], 1)), 1e-9) for group in square}


def _add(normal: Floats, right: Floats, block: _Block, w: float) -> None:
    D, at = block.design, block.columns
    normal[at, at] += w * (D.T @ D)
    right[at] += w * (D.T @ block.target)
    if block.more is not None:
        E, there = block.more
        cross = w * (D.T @ E)
        normal[at, there] += cross
        normal[there, at] += cross.T
        normal[there, there] += w * (E.T @ E)
        right[there] += w * (E.T @ block.target)


def payloads(study: Signals) -> dict[str, float]:
    """Weighed payload of each mass on springs, kg."""
    return {
        trial.load: trial.payload_kg
        for trial in study.trials
        if trial.kind == "mass-spring" and trial.payload_kg
    }


def _add_payloads(normal: Floats, right: Floats, study: Signals, places: dict[str, slice]) -> None:
    for name, kg in payloads(study).items():
        w = 1e3 / (_PAYLOAD * kg) ** 2
        first = places[name].start
        normal[first, first] += w
        right[first] += w * kg


def _add_prior(normal: Floats, right: Floats, study: Signals) -> None:
    if any(trial.kind == "free" for trial in study.trials):
        return
    size = len(study.model.parameter_names)
    known = study.prior if study.prior is not None and len(study.prior) == size else None
    if known is None and study.model.torque_at_load:
        known = (0.0,) * size
    if known is None:
        return
    for k, value in enumerate(known):
        w = 1e6 * max(normal[k, k], 1.0)
        normal[k, k] += w
        right[k] += w * value


def _solved(normal: Floats, right: Floats) -> Floats:
    size = np.sqrt(np.maximum(np.diag(normal), 1e-30))
    scaled = normal / np.outer(size, size) + _RIDGE * np.eye(len(size))
    return np.asarray(np.linalg.solve(scaled, right / size) / size)


def _left(
    blocks: list[_Block], value: Floats, scale: dict[str, float]
) -> tuple[dict[str, float], dict[str, float]]:
    square: dict[str, list[float]] = {}
    trials: dict[str, list[float]] = {}
    for block in blocks:
        rest = block.target - block.design @ value[block.columns]
        if block.more is not None:
            rest = rest - block.more[0] @ value[block.more[1]]
        share = rest / scale[block.group]
        for store, key in ((square, block.group), (trials, block.trial)):
            entry = store.setdefault(key, [0.0, 0.0])
            entry[0] += float(share @ share)
            entry[1] += len(share)
    by_group, by_trial = (
        {key: float(np.sqrt(total / max(count, 1.0))) for key, (total, count) in store.items()}
        for store in (square, trials)
    )
    return by_group, by_trial


def _payloads_left(study: Signals, loads: dict[str, Floats]) -> dict[str, float]:
    weighed = payloads(study)
    if not weighed:
        return {}
    off = [abs(loads[name][0] / kg - 1) for name, kg in weighed.items()]
    return {"payload": float(np.sqrt(np.mean(np.square(off))))}


def accelerations_left(study: Signals, motions: Motions) -> dict[str, float]:
    """The accelerometer against the encoders, per axis: a bias is left to the sensor."""
    measured, predicted = [], []
    for trial in study.trials:
        motion = motions.of(trial, study)
        if trial.acceleration is None or motion.felt is None:
            continue
        measured.append(low(trial.acceleration))
        predicted.append(turned(motion.felt[study.mount], -study.mount_angle))
    if not measured:
        return {}
    m, f = np.concatenate(measured), np.concatenate(predicted)
    rest = np.std(m - f, axis=0)
    size = np.maximum(np.minimum(np.std(m, axis=0), np.std(f, axis=0)), 0.2 * np.max(np.std(f, axis=0)))
    return {f"a{'xy'[axis]}": float(rest[axis] / max(size[axis], 1e-9)) for axis in range(2)}


def angles_left(study: Signals) -> dict[str, float]:
    """The module's angles against the controller's, per joint; zeros apart from the rest."""
    result = {}
    for joint in range(study.model.joints):
        rest, spread, apart = [], [], []
        for trial in study.trials:
            if trial.counted is None or joint >= trial.counted.shape[1]:
                continue
            difference = trial.angles[:, joint] - trial.counted[:, joint]
            rest.append(np.var(difference))
            spread.append(np.var(trial.counted[:, joint]))
            apart.append(float(np.mean(difference)))
        if rest:
            result[f"theta{joint + 1}"] = float(np.sqrt(np.mean(rest) / max(np.mean(spread), 1e-12)))
            # Against a radian: a twentieth of one is nothing that a person mistakes.
            result[f"zero{joint + 1}"] = float(np.sqrt(np.mean(np.square(apart))))
    return result


def _violations(
    study: Signals, motions: Motions, value: Floats, loads: dict[str, Floats], kinds: dict[str, str]
) -> Iterator[Violation]:
    if not study.trials:
        return
    if any(trial.kind == "free" for trial in study.trials):
        yield from _robot_violations(study, motions, value)
    for name, q in loads.items():
        yield from _load_violations(study, name, kinds[name], q)


def _robot_violations(study: Signals, motions: Motions, value: Floats) -> Iterator[Violation]:
    model = study.model
    p = len(model.parameter_names)
    alpha = value[:p]
    free = [trial for trial in study.trials if trial.kind == "free"]
    all_motions = [motions.of(trial, study) for trial in free]
    spots = np.concatenate([motion.inertia_at for motion in all_motions])
    I = model.inertia(spots, alpha)  # noqa: E741  (the papers' letter)
    diagonal = np.einsum("kii->ki", I)
    ok = True
    for joint in range(model.joints):
        lowest = float(diagonal[:, joint].min())
        if lowest < 0 and _felt(free, all_motions, alpha, joint):
            ok = False
            yield Violation(
                "inertia",
                f"joint{joint + 1}",
                lowest,
                f"the robot's inertia about joint {joint + 1} comes out at {lowest:.3g}",
            )
    eigen = np.linalg.eigvalsh(I)
    if ok and model.joints > 1 and float(eigen[:, 0].min()) < -0.02 * float(eigen[:, -1].max()):
        yield Violation(
            "inertia",
            "+".join(f"joint{joint + 1}" for joint in range(model.joints)),
            float(eigen[:, 0].min()),
            "the robot's inertia matrix is not positive definite where it moved",
        )
    for k, unit in enumerate(model.parameter_units):
        if "s/rad" not in unit and unit != "N*s/m":
            continue
        joint = int(np.argmax(np.abs(all_motions[0].robot[:, :, k]).sum(axis=0)))
        torque = np.concatenate([low(trial.torque)[:, joint] for trial in free])
        part = np.concatenate([m.robot[:, joint, k] for m in all_motions]) * alpha[k]
        if alpha[k] < 0 and np.std(part) > 0.15 * np.std(torque):
            yield Violation(
                "friction",
                f"joint{joint + 1}",
                float(alpha[k]),
                f"joint {joint + 1} has a viscous friction of {alpha[k]:.3g}: it would push itself",
            )
    if model.joints == len(model.task_axes) and ok:
        J = np.concatenate([motion.J_at for motion in all_motions])
        reach2 = np.maximum(np.sum(J**2, axis=1), 1e-12)
        heavy = float(np.median(diagonal / reach2, axis=0).max())
        light = float(np.median(diagonal / reach2, axis=0).min())
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


def _load_violations(study: Signals, name: str, kind: str, q: Floats) -> Iterator[Violation]:
    load = load_model(kind, tuple(study.model.task_axes))
    d = len(load.axes)
    M = (load.matrix_map("a") @ q).reshape(d, d)
    K = (load.matrix_map("x") @ q).reshape(d, d)
    mass = float(np.linalg.eigvalsh(0.5 * (M + M.T))[0])
    stiff = np.linalg.eigvalsh(0.5 * (K + K.T))
    largest = float(np.abs(stiff).max())
    if mass < -0.05 * float(np.abs(M).max()) and float(np.trace(M)) < 0:
        yield Violation("mass", name, mass, f"{name} has a mass of {mass:.3g}")
    if kind == "mass-spring" and float(stiff[0]) < -0.05 * largest:
        yield Violation("spring", name, float(stiff[0]), f"the springs of {name} push ({stiff[0]:.3g})")
    if kind == "arm" and float(np.trace(K)) < -0.2 * largest:
        yield Violation(
            "spring", name, float(stiff[0]), f"the stiffness of {name} is negative ({stiff[0]:.3g})"
        )
    if not load.rotary and float(np.trace(M)) / d > HEAVIEST_KG:
        yield Violation("size", name, mass, f"{name} weighs {np.trace(M) / d:.3g} kg", odd_size=True)
