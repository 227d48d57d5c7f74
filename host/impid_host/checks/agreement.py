"""What was measured twice, side by side: each pair with the standard errors that it is apart."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from impid_host.checks.check import Check, Checks
from impid_host.checks.equations import Motions, low
from impid_host.checks.joint_fit import fit_jointly, payloads
from impid_host.checks.mistakes import accelerometer, angle
from impid_host.checks.signals import Signals, TrialSignals, signals_of
from impid_host.impedance.identify import LoadFit
from impid_host.impedance.matrices import Quantity
from impid_host.signals.arrays import Floats
from impid_host.study.model import Study

# Apart by this many standard errors, and by this share of its size: worth a word.
SIGMAS = 6.0
SHARE = 0.05
_TRIALS_SHARE = 0.15
_TRIALS_SIGMAS = 10.0
_CORRELATED = 10.0  # filtered rows hang together
_DIAGNOSE = "run `impid-host diagnose`: an effect that the model lacks may be behind it"


@dataclass(frozen=True, slots=True)
class Pair:
    """One quantity measured in two ways.

    Attributes:
        what: "Method 1 / Method 2", say; where: a load, a joint, the sensor; quantity: "Kxx", say.
        first, second: the two values; unit; apart: their difference in standard errors.
        name: of the check where they disagree.
    """

    what: str
    where: str
    quantity: str
    first: float
    second: float
    unit: str
    apart: float
    name: str

    @property
    def share(self) -> float:
        """Difference over the larger of the two."""
        return abs(self.first - self.second) / max(abs(self.first), abs(self.second), 1e-300)

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return {**asdict(self), "share": self.share}


@dataclass(frozen=True, slots=True)
class Agreement:
    """All pairs of a study, and what they say."""

    pairs: tuple[Pair, ...]

    @property
    def checks(self) -> Checks:
        """The pairs that disagree: one entry for each name and place, its worst quantity."""
        worst: dict[tuple[str, str], Pair] = {}
        for pair in self.pairs:
            key = (pair.name, pair.where)
            if _disagree(pair) and (key not in worst or pair.apart > worst[key].apart):
                worst[key] = pair
        return Checks.of(_said(pair) for pair in worst.values())


def agreement(study: Study, loads: Sequence[LoadFit] = ()) -> Agreement:
    """Pair everything that a study holds twice.

    Args:
        loads: of a fit, for Method 1 against Method 2; without them only what the logs themselves hold.
    """
    signals = signals_of(study)
    motions = Motions()
    if not signals.trials:
        return Agreement(tuple(_methods(loads)))
    pairs = [
        *_methods(loads),
        *_trials(signals, motions),
        *_accelerations(signals, motions),
        *_angles(signals),
        *_payloads(signals, motions, loads),
    ]
    return Agreement(tuple(pairs))


def _methods(loads: Sequence[LoadFit]) -> Iterator[Pair]:
    """Per load and matrix the entry that is farthest apart."""
    by_load: dict[str, dict[str, LoadFit]] = {}
    for fit in loads:
        by_load.setdefault(fit.load, {})[fit.method] = fit
    for load, fits in by_load.items():
        if len(fits) < 2:
            continue
        one, two = fits["virtual sensor"], fits["physical sensor"]
        for letter in ("M", "B", "K"):
            first, second = getattr(one, letter), getattr(two, letter)
            if first is not None and second is not None:
                yield _matrices("Method 1 / Method 2", load, letter, first, second, one.model.axes)


def _matrices(
    what: str, where: str, letter: str, first: Quantity, second: Quantity, axes: Sequence[str]
) -> Pair:
    """The entry that differs most, in standard errors; apart is 0 where all differ by little of the whole."""
    difference = np.abs(first.value - second.value)
    sd = np.sqrt(first.sd**2 + second.sd**2)
    z = np.where(sd > 0, difference / np.maximum(sd, 1e-300), 0.0)
    whole = max(float(np.abs(first.value).max()), float(np.abs(second.value).max()), 1e-300)
    i, j = (int(k) for k in np.unravel_index(int(np.argmax(difference)), difference.shape))
    small = float(difference[i, j]) < SHARE * whole
    name = f"{letter}{axes[i]}{axes[j]}" if len(axes) > 1 else letter
    apart = float(z[i, j])
    check = "" if small else "methods.disagree"
    return Pair(
        what, where, name, float(first.value[i, j]), float(second.value[i, j]), first.unit, apart, check
    )


def _trials(signals: Signals, motions: Motions) -> Iterator[Pair]:
    """Each trial of a load by itself, the robot known: the two that are farthest apart."""
    if not any(trial.kind == "free" for trial in signals.trials) and signals.prior is None:
        return
    fit = fit_jointly(signals, motions)
    by_load: dict[str, list[tuple[str, Floats, Floats]]] = {}
    for trial in signals.trials:
        if trial.kind == "mass-spring":
            own = _alone(signals, motions, trial, fit.alpha)
            if own is not None:
                by_load.setdefault(trial.load, []).append((trial.name, *own))
    for load, owns in by_load.items():
        worst: Pair | None = None
        for k, (name, q, sd) in enumerate(owns):
            for other, q2, sd2 in owns[:k]:
                for index, quantity, unit in ((0, "M", "kg"), (1, "Kxx", "N/m"), (2, "Kyy", "N/m")):
                    if index >= len(q) - 1:
                        continue
                    apart = abs(q[index] - q2[index]) / max(float(np.hypot(sd[index], sd2[index])), 1e-300)
                    pair = Pair(
                        f"{other} / {name}",
                        load,
                        quantity,
                        float(q2[index]),
                        float(q[index]),
                        unit,
                        apart,
                        "trials.disagree",
                    )
                    if worst is None or pair.apart > worst.apart:
                        worst = pair
        if worst is not None:
            yield worst


def _alone(
    signals: Signals, motions: Motions, trial: TrialSignals, alpha: Floats
) -> tuple[Floats, Floats] | None:
    """One trial's load parameters and their standard deviations, with a dry friction of each joint."""
    motion = motions.of(trial, signals)
    p, n = len(alpha), signals.model.joints
    target = low(trial.torque) - motion.robot[:, :, :p] @ alpha
    A = np.concatenate([motion.load[trial.kind], motion.robot[:, :, p + n : p + 2 * n]], axis=2)
    q = motion.load[trial.kind].shape[2]
    scale = np.maximum(np.std(target, axis=0), 1e-9)
    W = (A / scale[:, None]).reshape(-1, A.shape[2])
    y = (target / scale).ravel()
    if len(y) < 4 * W.shape[1]:
        return None
    size = np.maximum(np.linalg.norm(W, axis=0), 1e-12)
    normal = (W / size).T @ (W / size) + 1e-11 * np.eye(W.shape[1])
    value = np.linalg.solve(normal, (W / size).T @ y) / size
    noise = float(np.sum((y - W @ value) ** 2)) / len(y) * _CORRELATED
    sd = np.sqrt(noise * np.diag(np.linalg.inv(normal))) / size
    return value[:q], sd[:q]


def _accelerations(signals: Signals, motions: Motions) -> Iterator[Pair]:
    found = accelerometer.acceleration_map(signals, motions, signals.mount) if signals.planar else None
    if found is None:
        return
    for axis in range(2):
        gain = float(found.raw[axis, axis])
        yield Pair(
            "accelerometer / encoders",
            "sensor",
            f"gain {'xy'[axis]}",
            gain,
            1.0,
            "1",
            abs(gain - 1) / max(found.sd, 1e-9),
            "accelerations.disagree",
        )


def _angles(signals: Signals) -> Iterator[Pair]:
    for joint in range(signals.model.joints):
        found = angle.relation(signals, joint, joint)
        if found is not None:
            sd = max(found.left / np.sqrt(max(len(signals.trials[0].theta) / 50, 1)), 1e-6)
            yield Pair(
                "controller's angle / module's",
                f"joint{joint + 1}",
                "slope",
                found.slope,
                1.0,
                "1",
                abs(found.slope - 1) / sd,
                "clocks.disagree",
            )


def _payloads(signals: Signals, motions: Motions, loads: Sequence[LoadFit]) -> Iterator[Pair]:
    for name, kg in payloads(signals).items():
        fit = next((one for one in loads if one.load == name), None)
        if fit is not None:
            mass, sd = float(fit.M.value[0, 0]), float(fit.M.sd[0, 0])
        else:
            mass, sd = float(fit_jointly(signals, motions).loads[name][0]), 0.02 * kg
        apart = abs(mass - kg) / max(float(np.hypot(sd, 0.005 * kg)), 1e-9)
        yield Pair("M / weighed payload", name, "M", mass, kg, "kg", apart, "trial.load")


def _disagree(pair: Pair) -> bool:
    if pair.name == "trials.disagree":
        return pair.apart > _TRIALS_SIGMAS and pair.share > _TRIALS_SHARE
    if pair.name == "trial.load":
        return pair.apart > SIGMAS and pair.share > 2 * SHARE
    # The slope of two readings of one encoder is 1 whatever the noise.
    return bool(pair.name) and pair.apart > SIGMAS and (pair.what.startswith("Method") or pair.share > SHARE)


def _said(pair: Pair) -> Check:
    return Check(
        pair.name,
        pair.where,
        "contradiction",
        f"{pair.what}, {pair.where}: {pair.quantity} is {pair.first:.5g} by the one and {pair.second:.5g} "
        f"{pair.unit} "
        f"by the other, {pair.apart:.0f} standard errors apart",
        {"first": pair.first, "second": pair.second, "standard_errors_apart": pair.apart},
        _DIAGNOSE
        if pair.name != "trial.load"
        else "weigh the payload again, and look at payload_kg in trial.toml",
    )
