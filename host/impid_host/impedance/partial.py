"""A load whose trials do not determine all of it: reported are the combinations that they do determine."""

from collections.abc import Sequence
from dataclasses import dataclass

from impid_host.errors import UndeterminedError
from impid_host.impedance.combinations import combinations
from impid_host.impedance.identify import Method, RobotParameters, load_rows, load_twins, method_of
from impid_host.impedance.linear import Estimate, enough_rows, fit_linear
from impid_host.impedance.loads import LoadModel
from impid_host.impedance.reliability import what_noise_hides
from impid_host.impedance.rows import Split
from impid_host.signals.align import AlignedTrial
from impid_host.signals.chain import Chain


@dataclass(frozen=True, slots=True)
class PartialLoadFit:
    """What one load's trials show by one method.

    Attributes:
        estimate: the combinations, named by parameters of the load's model, no handle taken off; cx, cy
            are K x0.
        trials: their names.
        reason: one sentence on what stays open.
    """

    load: str
    model: LoadModel
    method: Method
    estimate: Estimate
    trials: tuple[str, ...]
    reason: str


def identify_partially(
    trials: Sequence[AlignedTrial],
    load: LoadModel,
    chain: Chain,
    split: Split,
    *,
    robot: RobotParameters | None,
    error: UndeterminedError,
) -> PartialLoadFit:
    """The combinations of one load's parameters that its trials determine.

    Args:
        error: that of the fit of every parameter.

    Raises:
        UndeterminedError: `error`, where it is not for open combinations that the fit failed.
    """
    _, rows = load_rows(trials, load, chain, split, robot)
    names = load.parameter_names
    if not enough_rows(rows, len(names)):
        raise error
    part = what_noise_hides(rows, load_twins(trials, load, chain, split), names) or combinations(rows, names)
    if part.unseen.shape[1] == 0:
        raise error
    estimate = fit_linear(
        [part.cut(stretch) for stretch in rows],
        part.labels,
        tuple(load.parameter_units[k] for k in part.kept),
        ar_order=chain.ar_order,
        nuisance_covariance=None if robot is None else robot.covariance,
    )
    return PartialLoadFit(
        load=trials[0].load,
        model=load,
        method=method_of(load, robot),
        estimate=estimate,
        trials=tuple(trial.name for trial in trials),
        reason=f"{len(part.labels)} combinations of {len(names)} parameters are determined; "
        "a motion along every axis, at several frequencies, would determine all",
    )
