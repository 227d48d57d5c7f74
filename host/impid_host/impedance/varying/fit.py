"""A load whose stiffness, damping and equilibrium change: M constant, K, B and x0 curves with 95 % bands.

-F_ext = M a + B(s) v + K(s) (x - x0(s)), s time or another scheduling variable. Noise is coloured as in
`fit`. Hyper-parameters (an amplitude and a length for each matrix) are integrated over, not fixed at their
best: a band holds the whole curve with 95 %, what the data do not say about its smoothness included.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.colour import Colour, colour_of
from impid_host.impedance.identify import Method, RobotParameters, method_of
from impid_host.impedance.linear import ROWS_PER_PARAMETER, Stretch
from impid_host.impedance.loads import LoadModel
from impid_host.impedance.varying.asked import Asked, asked
from impid_host.impedance.varying.bands import Band, constants, drawn_bands
from impid_host.impedance.varying.curves import Knots
from impid_host.impedance.varying.expand import (
    Scheduled,
    blocks_of,
    equilibrium_offset,
    expanded,
    of_blocks,
    recentred,
    thin,
)
from impid_host.impedance.varying.posterior import Evidence, Group, Layout, Normal, Posterior
from impid_host.signals.arrays import Floats
from impid_host.signals.chain import Chain

CLAIMED_BELOW = 0.005
_ROUNDS = 3
_KNOTS = 20
_POINTS = 101
_DRAWS = 4000
_FOLDS, _BLOCKS = 5, 20
_NAMES = {"x": "K", "v": "B", "1": "x0"}


@dataclass(frozen=True, slots=True)
class VaryingFit:
    """One load by one method, its impedance as curves.

    Attributes:
        by: the scheduling variable ("time", ...); unit: its unit; places: (k,) of it.
        M: constant, entries by name; curves: K, B and x0, one band for each entry, by the load's own names.
        asked: for each of K, B, x0 whether the data ask for a curve.
        lengths: for each of them the curve's length in units of s: median and 95 % range.
        vaf_constant, vaf_varying: per axis, %, on blocks that are left out in turn.
        trials: their names.
    """

    load: str
    model: LoadModel
    method: Method
    by: str
    unit: str
    places: Floats
    M: dict[str, Band]
    curves: dict[str, Band]
    asked: tuple[Asked, ...]
    lengths: dict[str, tuple[float, float, float]]
    vaf_constant: Floats
    vaf_varying: Floats
    trials: tuple[str, ...]

    @property
    def claimed(self) -> tuple[str, ...]:
        """Which of K, B, x0 change with s."""
        return tuple(one.group for one in self.asked if one.p_value < CLAIMED_BELOW)


def fit_varying(
    parts: Sequence[Scheduled],
    load: LoadModel,
    chain: Chain,
    *,
    robot: RobotParameters | None,
    by: str = "time",
    unit: str = "s",
    handle_mass_kg: float = 0.0,
    seed: int = 0,
) -> VaryingFit:
    """K, B and x0 of one load as curves over s, the same in all parts.

    Args:
        parts: trials with their scheduling variable.
        robot: for the virtual sensor; None: the logs' forces.

    Raises:
        UndeterminedError: too few rows, or s stands still.
    """
    s = np.concatenate([part.s[part.trial.valid & np.isfinite(part.s)] for part in parts])
    if len(s) == 0 or not np.ptp(s) > 0:
        raise UndeterminedError(f"load {parts[0].trial.load}: {by} stands still, so nothing can vary with it")
    knots = Knots(float(s.min()), float(s.max()), _KNOTS)
    slow = [thin(part, chain) for part in parts]
    place, size = _constant(slow, load, robot, chain)
    layout = Layout(len(load.columns), _groups(load, size, slow), knots)
    rows = [row for part in slow for row in expanded(part, load, place, layout, robot, chain)]
    count = sum(row.target.size for row in rows)
    if count < 5 * ROWS_PER_PARAMETER * len(load.columns):
        raise UndeterminedError(f"load {parts[0].trial.load}: {count} usable rows are too few for curves")
    covariance = None if robot is None or not robot.covariance.any() else robot.covariance
    evidence, hyper, work = _coloured(rows, layout, chain.ar_order)
    # Where K changes, an equilibrium that stands still is a constant K x0 only as seen from itself.
    offset = equilibrium_offset(evidence.posterior(hyper).mean, load, layout)
    place = place + offset
    rows, work = (recentred(part, load, layout, offset) for part in (rows, work))
    evidence = Evidence(Normal.of(work), layout)
    hyper = evidence.mode(near=hyper)
    rng = np.random.default_rng(seed)
    verdicts = tuple(
        asked(_where_constant(rows, evidence, hyper, k, chain.ar_order), k, hyper, rng, covariance)
        for k in range(len(layout.groups))
    )
    sampled = evidence.sample(hyper, rng)
    draws = _draws(evidence, sampled, rng, covariance)
    moves = _moved_by_colour(rows, evidence, hyper, chain.ar_order)
    draws += rng.normal(size=(len(draws), len(moves))) @ (np.sqrt(2.0) * moves)
    places = knots.grid(_POINTS)
    before, after = _left_out(rows, work, evidence, hyper)
    return VaryingFit(
        load=parts[0].trial.load,
        model=load,
        method=method_of(load, robot),
        by=by,
        unit=unit,
        places=places,
        M=constants(draws, load, "a", handle_mass_kg),
        curves=drawn_bands(draws, layout, load, places, place),
        asked=verdicts,
        lengths={
            group.name: _range(np.exp(sampled[:, 2 * k + 1]) * (knots.high - knots.low))
            for k, group in enumerate(layout.groups)
        },
        vaf_constant=before,
        vaf_varying=after,
        trials=tuple(part.trial.name for part in parts),
    )


def _range(values: Floats) -> tuple[float, float, float]:
    low, middle, high = np.percentile(values, [2.5, 50, 97.5])
    return float(middle), float(low), float(high)


def _constant(
    parts: Sequence[Scheduled], load: LoadModel, robot: RobotParameters | None, chain: Chain
) -> tuple[Floats, Floats]:
    """Equilibrium (d,) and parameters of the constant load by plain least squares: a start and a scale."""
    none = Layout(len(load.columns), (), Knots(0.0, 1.0, 4))
    middle = np.mean(np.concatenate([p.trial.x[p.trial.valid] for p in parts]), axis=0)
    rows = [row for part in parts for row in expanded(part, load, middle, none, robot, chain)]
    if not rows:
        raise UndeterminedError(f"load {parts[0].trial.load}: nothing is left between gaps and filter edges")
    q = len(load.columns)
    X = np.concatenate([row.design.reshape(-1, q) for row in rows])
    y = np.concatenate([row.target.ravel() for row in rows])
    size = np.linalg.norm(X, axis=0)
    if not np.all(size > 0):
        raise UndeterminedError(f"load {parts[0].trial.load}: its trials do not move it along every axis")
    value = np.linalg.lstsq(X / size, y, rcond=1e-9)[0] / size
    d = len(load.axes)
    K = (load.matrix_map("x") @ value).reshape(d, d)
    offset = np.linalg.lstsq(K, value[load.place], rcond=1e-3)[0]
    reach = np.std(np.concatenate([p.trial.x[p.trial.valid] for p in parts]), axis=0)
    return middle + np.clip(offset, -3 * reach, 3 * reach), value


def _groups(load: LoadModel, value: Floats, parts: Sequence[Scheduled]) -> tuple[Group, ...]:
    """K, B and K x0, each with the size of the constant one."""
    reach = float(np.sqrt(np.mean(np.concatenate([np.var(p.trial.x[p.trial.valid], axis=0) for p in parts]))))
    speed = float(np.sqrt(np.mean(np.concatenate([np.var(p.trial.v[p.trial.valid], axis=0) for p in parts]))))
    groups = []
    own = {signal: tuple(q for q, c in enumerate(load.columns) if c.signal == signal) for signal in _NAMES}
    stiffness = float(np.max(np.abs(value[list(own["x"])])))
    for signal, name in _NAMES.items():
        columns = own[signal]
        if not columns:
            continue
        size = float(np.max(np.abs(value[list(columns)])))
        if signal == "v":
            # Damping that is small beside the spring says little of how much it may change.
            size = max(size, 0.1 * stiffness * reach / speed)
        if signal == "1":
            size = stiffness * reach
        groups.append(Group(name, columns, size))
    return tuple(groups)


def _coloured(
    rows: Sequence[Stretch], layout: Layout, ar_order: int
) -> tuple[Evidence, Floats, list[Stretch]]:
    """Evidence of rows whitened by the colour of what the curves leave, its mode, and those rows.

    Slow noise and an equilibrium that wanders look alike, and the colour's iteration may settle on either: it
    starts once from white noise and once from all that a constant load leaves, and the likelier one is kept.
    """
    p = layout.size
    blocks = _scaled(rows)
    found = []
    for start in (_white(blocks, layout), _constant_alone(blocks, layout)):
        mean, root = start
        hyper: Floats | None = None
        for _ in range(_ROUNDS):
            colour = _colour(blocks, p, mean, root, ar_order)
            work = of_blocks(colour.whitened(blocks), p)
            evidence = Evidence(Normal.of(work), layout)
            hyper = evidence.mode(near=hyper)
            posterior = evidence.posterior(hyper)
            mean, root = posterior.mean, posterior.root * np.sqrt(posterior.variance)
        assert hyper is not None
        likelihood = evidence.log_likelihood(hyper) + evidence.of_constants() + colour.log_weight(blocks)
        found.append((likelihood, evidence, hyper, work))
    _, evidence, hyper, work = max(found, key=lambda one: one[0])
    return evidence, hyper, work


def _scaled(rows: Sequence[Stretch]) -> list[Floats]:
    """Rows as blocks, their target of unit power."""
    power = float(np.mean(np.concatenate([row.target.ravel() for row in rows]) ** 2))
    return [block / np.sqrt(max(power, 1e-300)) for block in blocks_of(rows)]


def _where_constant(
    rows: Sequence[Stretch], evidence: Evidence, hyper: Floats, group: int, ar_order: int
) -> Evidence:
    """The evidence with rows whitened by the colour that is left where one group is held constant.

    A curve takes some noise with it, and the colour of the rest would make the test too sure.
    """
    blocks, p = _scaled(rows), evidence.layout.size
    found = evidence.posterior(evidence.mode(absent=(group,), near=hyper))
    colour = _colour(blocks, p, found.mean, found.root * np.sqrt(found.variance), ar_order)
    return Evidence(Normal.of(of_blocks(colour.whitened(blocks), p)), evidence.layout)


def _moved_by_colour(rows: Sequence[Stretch], evidence: Evidence, hyper: Floats, ar_order: int) -> Floats:
    """By how much the parameters move with the colour's own uncertainty, along k directions of it, (k, p).

    Twice their squares belong to the covariance (Kenward and Roger, Biometrics 53, 1997), as in `fit_linear`.
    """
    if ar_order == 0:
        return np.zeros((0, evidence.layout.size))
    blocks, p = _scaled(rows), evidence.layout.size
    found = evidence.posterior(hyper)
    colour = _colour(blocks, p, found.mean, found.root * np.sqrt(found.variance), ar_order)

    def mean(white: list[Floats]) -> Floats:
        return Evidence(Normal.of(of_blocks(white, p)), evidence.layout).mean(hyper)

    pairs = colour.neighbours([block[:, :, : p + 1] for block in blocks])
    return np.array([0.5 * (mean(up) - mean(down)) for up, down in pairs])


def _white(blocks: Sequence[Floats], layout: Layout) -> tuple[Floats, Floats]:
    """Mean and root of the parameters where noise is white and curves may be there."""
    evidence = Evidence(Normal.of(of_blocks(blocks, layout.size)), layout)
    found = evidence.posterior(evidence.mode())
    return found.mean, found.root * np.sqrt(found.variance)


def _constant_alone(blocks: Sequence[Floats], layout: Layout) -> tuple[Floats, Floats]:
    """The same where nothing varies."""
    p, q = layout.size, layout.constants
    plain = Normal.of([Stretch(b[:, :, :q], b[:, :, p]) for b in blocks])
    inverse = np.linalg.inv(plain.G)
    mean, root = np.zeros(p), np.zeros((p, q))
    mean[:q] = inverse @ plain.g
    left = float(plain.yy - plain.g @ mean[:q]) / max(plain.rows - q, 1)
    root[:q] = np.linalg.cholesky(0.5 * (inverse + inverse.T) * max(left, 1e-24))
    return mean, root


def _colour(blocks: Sequence[Floats], p: int, mean: Floats, root: Floats, ar_order: int) -> Colour:
    parts = [
        np.concatenate([(b[:, :, p] - b[:, :, :p] @ mean)[:, :, None], b[:, :, :p] @ root], axis=2)
        for b in blocks
    ]
    return colour_of(parts, ar_order)


def _draws(
    evidence: Evidence, sampled: Floats, rng: np.random.Generator, nuisance_covariance: Floats | None
) -> Floats:
    """Parameters from their posterior, hyper-parameters integrated over, (draws, p)."""
    each = -(-_DRAWS // len(sampled))
    known: Posterior | None = None
    last: Floats | None = None
    out = []
    for hyper in sampled:
        if known is None or last is None or not np.array_equal(hyper, last):
            known, last = evidence.posterior(hyper), hyper
        width = np.sqrt(known.variance * known.dof / rng.chisquare(known.dof, each))
        draw = known.mean + width[:, None] * (rng.normal(size=(each, len(known.mean))) @ known.root.T)
        if nuisance_covariance is not None and evidence.normal.N is not None:
            gain = known.root @ (known.root.T @ evidence.normal.N)
            known_by = rng.multivariate_normal(np.zeros(gain.shape[1]), nuisance_covariance, each)
            draw = draw + known_by @ gain.T
        out.append(draw)
    return np.concatenate(out)


def _left_out(
    rows: Sequence[Stretch], work: Sequence[Stretch], evidence: Evidence, hyper: Floats
) -> tuple[Floats, Floats]:
    """VAF, %, per axis, of a constant load and of curves, on blocks that are left out in turn.

    The constant load is fitted by plain least squares: the colour of what curves leave would give its misfit
    a weight that it has nowhere else.
    """
    layout = evidence.layout
    q = layout.constants
    length = max(1, sum(len(row.target) for row in rows) // _BLOCKS)
    pieces = [
        (k, slice(begin, begin + length))
        for k, row in enumerate(rows)
        for begin in range(0, len(row.target), length)
    ]
    plain = Normal.of([Stretch(row.design[:, :, :q], row.target) for row in rows])
    target, constant, varying = [], [], []
    for fold in range(_FOLDS):
        out = pieces[fold::_FOLDS]
        if not out:
            continue
        own = Normal.of([Stretch(work[k].design[part], work[k].target[part]) for k, part in out])
        raw = Normal.of([Stretch(rows[k].design[part, :, :q], rows[k].target[part]) for k, part in out])
        mean = Evidence(evidence.normal.without(own), layout).posterior(hyper).mean
        rest = plain.without(raw)
        flat = np.linalg.lstsq(rest.G, rest.g, rcond=1e-12)[0]
        for k, part in out:
            target.append(rows[k].target[part])
            constant.append(rows[k].target[part] - rows[k].design[part, :, :q] @ flat)
            varying.append(rows[k].target[part] - rows[k].design[part] @ mean)
    spread = np.var(np.concatenate(target), axis=0)
    before, after = (
        100 * (1 - np.var(np.concatenate(left), axis=0) / np.maximum(spread, 1e-300))
        for left in (constant, varying)
    )
    return before, after
