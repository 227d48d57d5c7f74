"""Output error: parameters for which the simulated model does what was measured.

Where something is held by a stiffness, its measured torque (or, by Method 2, its measured force) drives the
model, and what is compared is the place of the end-effector: no accelerometer takes part. Where the log says
what the controller was told, the loop is closed and the torque is compared (DIDIM: Gautier, Janot and
Vandanjon, IEEE Trans. Control Syst. Tech. 21, 2013). Gauss and Newton's steps, each of them the regression of
every other fit: the design is the output's slope in the parameters; intervals hold for coloured noise.

It is right where the noise is in what is compared. Noise in the torque that drives the model goes through it
and bends its slopes; a free machine that only a torque drives drifts away, and is refused.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.estimators.instruments import controller
from impid_host.impedance.estimators.plant import Law, Machines, integrate
from impid_host.impedance.linear import Estimate, Stretch, fit_linear
from impid_host.impedance.loads import LoadModel
from impid_host.impedance.rows import Split, finish
from impid_host.robot.terms import RobotStructure
from impid_host.signals.align import AlignedTrial
from impid_host.signals.arrays import Floats
from impid_host.signals.chain import Chain
from impid_host.signals.filters import butterworth

_ROUNDS = 12
_SETTLED = 0.05  # of a standard deviation
_HALVINGS = 4
_SMALL = 1e-4  # of a parameter, the step of its slope
_BEGINNING = 1e-4  # rad (m) and rad/s: the step of the slope in how the motion began
_FORGOTTEN = 1e-4  # m (rad) at the first row, of a rad or rad/s at the beginning
_DRIVE_HZ = 25.0  # above it a limb does nothing of what is compared
_SHORTEST_S = 4.0  # of a run between gaps

MachinesOf = Callable[[Floats], Machines]
"""Parameters and nuisance beside each other, (B, p + k) -> the machines."""


@dataclass(frozen=True, slots=True)
class _Run:
    """A stretch of a trial without gaps: its law, and what was measured there."""

    trial: AlignedTrial
    rows: slice
    law: Law
    output: Floats
    kept: Floats
    start: tuple[Floats, Floats]


def load_by_output_error(
    trials: Sequence[AlignedTrial],
    load: LoadModel,
    structure: RobotStructure,
    start: Estimate,
    chain: Chain,
    split: Split,
    *,
    alpha: tuple[Floats, Floats] | None,
) -> Estimate:
    """One load's parameters.

    Args:
        start: where to begin.
        alpha: the robot's parameters and their covariance, (p,), (p, p); None for Method 2.

    Raises:
        UndeterminedError: it does not settle, or nothing of the trials is left.
    """
    closed = alpha is not None and all(trial.reference is not None for trial in trials)
    runs = []
    for trial in trials:
        if closed:
            law = controller(trial, structure, chain)
        elif alpha is not None:
            law = _driven(trial.tau, trial.rate_hz)
        elif trial.force is not None:
            still = _driven(np.zeros_like(trial.tau), trial.rate_hz)
            law = replace(still, push=_slow(-trial.force, trial.rate_hz), gain=np.ones(trial.tau.shape[1]))
        else:
            raise UndeterminedError(f"trial {trial.name}: no fx, fy in robot.csv, so nothing drives the load")
        runs += _runs(trial, law, trial.tau if closed else trial.x, chain, split)
    known = np.zeros(len(structure.parameter_names)) if alpha is None else alpha[0]
    q = len(load.parameter_names)

    def machines(both: Floats) -> Machines:
        robot = both[:, q:] if alpha is not None else np.broadcast_to(known, (len(both), len(known)))
        return Machines(structure, robot, load, both[:, :q])

    return _settled(
        runs, machines, start, chain, closed=closed, nuisance=None if alpha is None else (alpha[0], alpha[1])
    )


def robot_by_output_error(
    trials: Sequence[AlignedTrial], structure: RobotStructure, start: Estimate, chain: Chain, split: Split
) -> Estimate:
    """The robot's parameters from free trials whose logs say what the controller was told.

    Raises:
        UndeterminedError: a log does not say it, or it does not settle.
    """
    if any(trial.reference is None for trial in trials):
        raise UndeterminedError(
            "output error of a free robot needs what its controller was told (theta1_ref, ... in robot.csv): "
            "driven by its measured torque alone, the simulated robot drifts away"
        )
    if start.names != structure.parameter_names:
        raise UndeterminedError("output error needs trials that determine every parameter of the robot")
    runs = [
        run
        for trial in trials
        for run in _runs(trial, controller(trial, structure, chain), trial.tau, chain, split)
    ]
    return _settled(runs, lambda both: Machines(structure, both), start, chain, closed=True, nuisance=None)


def _driven(tau: Floats, rate_hz: float) -> Law:
    n = tau.shape[1]
    return Law(1 / rate_hz, _slow(tau, rate_hz), np.zeros((n, n)), np.zeros((n, n)))


def _slow(values: Floats, rate_hz: float) -> Floats:
    """Without what the integration's steps would fold back into the band."""
    return values if rate_hz < 4 * _DRIVE_HZ else butterworth(4, _DRIVE_HZ, rate_hz).forth_and_back(values)


def _runs(trial: AlignedTrial, law: Law, output: Floats, chain: Chain, split: Split) -> list[_Run]:
    """The trial's runs without gaps that have rows to be fitted."""
    fitted = split.masks(trial, chain)[0]
    edges = np.flatnonzero(np.diff(np.concatenate([[0], trial.valid.astype(np.int8), [0]])))
    step, edge = chain.decimation(trial.rate_hz), int(chain.edge_s * trial.rate_hz)
    found = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if end - begin < _SHORTEST_S * trial.rate_hz:
            continue
        part = slice(int(begin), int(end))
        inside = np.flatnonzero(fitted[part])
        # The filter sees nothing beyond the run: its edges are left out once more.
        inside = inside[(inside >= edge) & (inside < end - begin - edge)][::step]
        if len(inside):
            own = replace(law, u=law.u[part], push=None if law.push is None else law.push[part])
            start = trial.theta[begin], trial.omega[begin]
            found.append(_Run(trial, part, own, output[part], inside, start))
    return found


def _settled(
    runs: Sequence[_Run],
    machines: MachinesOf,
    start: Estimate,
    chain: Chain,
    *,
    closed: bool,
    nuisance: tuple[Floats, Floats] | None,
) -> Estimate:
    """Gauss and Newton's steps until the parameters stand still."""
    if not runs:
        raise UndeterminedError("output error needs a stretch of 4 s or more without a gap in some trial")
    alpha = np.zeros(0) if nuisance is None else nuisance[0]
    problem = _Problem(runs, machines, np.maximum(np.abs(start.value), start.sd), alpha, chain, closed)
    p, extra = len(start.value), problem.beginnings
    value = np.concatenate([start.value, np.zeros(extra)])
    names = np.array([*start.names, *(f"start{k + 1}" for k in range(extra))])
    units = np.array([*start.units, *("",) * extra])
    rows = problem.linearised(value)
    # A well damped limb has forgotten how it began before the first row.
    felt = np.max([np.max(np.abs(row.design), axis=(0, 1)) for row in rows], axis=0) > _FORGOTTEN
    felt[:p] = True
    for _ in range(_ROUNDS):
        found = fit_linear(
            [replace(row, design=row.design[:, :, felt]) for row in rows],
            tuple(names[felt]),
            tuple(units[felt]),
            ar_order=chain.ar_order,
            nuisance_covariance=None if nuisance is None else nuisance[1],
        )
        step = np.zeros(len(value))
        step[felt] = found.value - value[felt]
        if np.all(np.abs(step[:p]) < _SETTLED * found.sd[:p]):
            return replace(
                found,
                names=start.names,
                units=start.units,
                value=found.value[:p],
                covariance=found.covariance[:p, :p],
                covariance_spread=found.covariance_spread[:, :p, :p],
            )
        for halving in range(_HALVINGS):
            try:
                rows = problem.linearised(value + step / 2**halving)
            except (UndeterminedError, np.linalg.LinAlgError):
                continue
            value = value + step / 2**halving
            break
        else:
            raise UndeterminedError("output error: the simulated model runs away from every step")
    raise UndeterminedError(
        f"output error does not settle in {_ROUNDS} rounds; use --estimator instruments or least-squares"
    )


@dataclass(frozen=True, slots=True)
class _Problem:
    """What is compared; `size` (p,): of the parameters; alpha (k,): the robot's, known from elsewhere."""

    runs: Sequence[_Run]
    machines: MachinesOf
    size: Floats
    alpha: Floats
    chain: Chain
    closed: bool

    @property
    def beginnings(self) -> int:
        """A controller forgets how the motion began; without one, its beginning is found as well."""
        return 0 if self.closed else 2 * self.runs[0].law.u.shape[1] * len(self.runs)

    def linearised(self, value: Floats) -> list[Stretch]:
        """Rows of each run: what is left over against the slopes of the simulated output, finished alike."""
        p, k, n = len(self.size), len(self.alpha), self.runs[0].law.u.shape[1]
        known = np.concatenate([value[:p], self.alpha])
        steps = np.concatenate([_SMALL * self.size, _SMALL * np.maximum(np.abs(self.alpha), 1e-6)])
        turns = np.zeros((1 + p + k, 0)) if self.closed else np.zeros((1 + p + k, 2 * n))
        many = np.concatenate([known[None], known + np.diag(steps)])
        if not self.closed:
            steps = np.concatenate([steps, np.full(2 * n, _BEGINNING)])
            many = np.concatenate([many, np.tile(known, (2 * n, 1))])
            turns = np.concatenate([turns, _BEGINNING * np.eye(2 * n)])
        starts = []
        for r, run in enumerate(self.runs):
            own = turns if self.closed else turns + value[p + 2 * n * r : p + 2 * n * (r + 1)]
            still = np.zeros((len(many), n))
            starts.append(
                (run.start[0] + (still if self.closed else own[:, :n]),
                 run.start[1] + (still if self.closed else own[:, n:]))
            )  # fmt: skip
        built = self.machines(many)
        moved = integrate(built, [run.law for run in self.runs], starts)
        return [
            self._rows(r, self._output(run, built, motion), steps, value)
            for r, (run, motion) in enumerate(zip(self.runs, moved, strict=True))
        ]

    def _output(self, run: _Run, built: Machines, motion: tuple[Floats, Floats]) -> Floats:
        """What is compared, of every machine: (B, N, c)."""
        model = built.structure.model
        if self.closed:
            return np.stack([run.law.torque(model, *one) for one in zip(*motion, strict=True)])
        return np.stack([model.position(theta) for theta in motion[0]])

    def _rows(self, r: int, output: Floats, steps: Floats, value: Floats) -> Stretch:
        run, p, k = self.runs[r], len(self.size), len(self.alpha)
        slopes = np.moveaxis((output[1:] - output[0]) / steps[:, None, None], 0, 2)
        left = (run.output - output[0])[:, :, None]
        rows = finish(self.chain, np.concatenate([left, slopes], axis=2), run.trial.rate_hz)[run.kept]
        design = np.zeros((len(rows), rows.shape[1], len(value)))
        design[:, :, :p] = rows[:, :, 1 : p + 1]
        if not self.closed:
            width = rows.shape[2] - 1 - p - k
            design[:, :, p + width * r : p + width * (r + 1)] = rows[:, :, p + k + 1 :]
        by_alpha = -rows[:, :, p + 1 : p + k + 1] if k else None
        return Stretch(design, rows[:, :, 0] + design @ value, by_alpha)
