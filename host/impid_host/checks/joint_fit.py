"""All channels of a study at once: what each leaves unexplained, and which numbers nothing can have.

One least-squares fit holds the torques of all trials, the force sensor's readings, and weighed payloads; so a
channel that contradicts the others shows. Every channel's residual is taken over its own size, so that units
do not matter. The score is the sum of log(r^2): a study in order has a few thousandths to hundredths in each.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from impid_host.checks.equations import Motions, force_in_base, low, turned
from impid_host.checks.physics import Numbers, Violation, violations
from impid_host.checks.signals import Signals
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
    numbers = Numbers(value, _spread(blocks, normal, value, scale), places, kinds)
    alpha = value[: len(study.model.parameter_names)]
    return JointFit(left, alpha, loads, tuple(violations(study, motions, numbers)), by_trial)


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


def _spread(blocks: list[_Block], normal: Floats, value: Floats, scale: dict[str, float]) -> Floats:
    """Covariance of all parameters, (size, size), from what each channel leaves.

    What a model lacks follows the motion, so that neighbouring rows say the same: a channel's variance is
    taken times the number of rows that hang together. A direction that the motion leaves open has a spread as
    large as the ridge allows, and says nothing.
    """
    rests: dict[str, list[Floats]] = {}
    for block in blocks:
        rests.setdefault(block.group, []).append(_rest(block, value))
    rows = sum(len(block.target) for block in blocks)
    few = max(rows / max(rows - len(value), 1), 1.0)
    noise = {
        group: few * together(parts) * float(np.mean(np.concatenate(parts) ** 2))
        for group, parts in rests.items()
    }
    meat, nothing = np.zeros_like(normal), np.zeros(len(value))
    for block in blocks:
        _add(meat, nothing, block, noise[block.group] / (_WEIGHT * scale[block.group]) ** 4)
    size = np.sqrt(np.maximum(np.diag(normal), 1e-30))
    bread = np.linalg.inv(normal / np.outer(size, size) + _RIDGE * np.eye(len(size)))
    usual = max((noise[group] / (_WEIGHT * scale[group]) ** 2 for group in noise), default=1.0)
    whole = meat / np.outer(size, size) + _RIDGE * usual * np.eye(len(size))
    return np.asarray(bread @ whole @ bread / np.outer(size, size))


def together(parts: list[Floats]) -> float:
    """How many neighbouring rows of residuals say the same: 1 and twice the sum of their correlations."""
    longest = max(1, min(len(part) for part in parts) // 4)
    power = sum(float(part @ part) for part in parts)
    total = 1.0
    for lag in range(1, longest):
        rho = sum(float(part[lag:] @ part[:-lag]) for part in parts) / max(power, 1e-300)
        if rho <= 0.05:
            break
        total += 2 * rho
    return total


def _rest(block: _Block, value: Floats) -> Floats:
    rest = block.target - block.design @ value[block.columns]
    return rest if block.more is None else rest - block.more[0] @ value[block.more[1]]


def _left(
    blocks: list[_Block], value: Floats, scale: dict[str, float]
) -> tuple[dict[str, float], dict[str, float]]:
    square: dict[str, list[float]] = {}
    trials: dict[str, list[float]] = {}
    for block in blocks:
        share = _rest(block, value) / scale[block.group]
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
