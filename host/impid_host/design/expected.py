"""What more trials like those at hand would give, before they are run: intervals, and how many are enough.

A load's own covariance falls with the number of its trials; what comes from the robot's parameters (Method 1)
stays as it is, whatever number of load trials is added: more free trials lower that.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.campaign import StudyFit, kind_of_load, loads_of, model_and_rounds
from impid_host.impedance.identify import (
    Method,
    RobotFit,
    RobotParameters,
    identify_load,
    method_of,
)
from impid_host.impedance.linear import Estimate
from impid_host.impedance.loads import LoadModel
from impid_host.impedance.rows import Split
from impid_host.robot.model import robot_model
from impid_host.signals.align import AlignedTrial
from impid_host.signals.arrays import Floats
from impid_host.signals.chain import Chain
from impid_host.study.model import Study

MOST_TRIALS = 200


@dataclass(frozen=True, slots=True)
class Expected:
    """One load by one method.

    Attributes:
        trials: how many there are; names, units: of the load's p parameters, K x0 left out; value: (p,).
        estimate: of all parameters; alone: their covariance if the robot were known exactly; kept: which of
            them are the p.
    """

    load: str
    method: Method
    trials: int
    estimate: Estimate
    alone: Floats
    kept: tuple[int, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the p parameters."""
        return tuple(self.estimate.names[q] for q in self.kept)

    @property
    def units(self) -> tuple[str, ...]:
        """Of the p parameters."""
        return tuple(self.estimate.units[q] for q in self.kept)

    @property
    def value(self) -> Floats:
        """Of the p parameters, the handle not taken off."""
        return self.estimate.value[list(self.kept)]

    def with_trials(self, count: int) -> Floats:
        """Half of the 95 % intervals with so many trials of this kind in all, (p,)."""
        share = self.trials / count
        covariance = share * self.alone + (self.estimate.covariance - self.alone)
        spread = share**1.5 * self.estimate.covariance_spread
        then = replace(self.estimate, covariance=covariance, covariance_spread=spread)
        return then.half_width(np.eye(len(self.estimate.value))[list(self.kept)])

    def enough(self, percent: float) -> list[int | None]:
        """For each parameter how many trials give it to so many per cent; None: no number of them would."""
        found: list[int | None] = [None] * len(self.value)
        for count in range(MOST_TRIALS, 0, -1):
            good = self.with_trials(count) <= 0.01 * percent * np.abs(self.value)
            found = [count if ok else own for ok, own in zip(good, found, strict=True)]
        return found


def expected_of(
    trials: Sequence[AlignedTrial], load: LoadModel, chain: Chain, split: Split, robot: RobotParameters | None
) -> Expected:
    """From one load's trials by one method; `robot` None: the physical sensor.

    Raises:
        UndeterminedError: the trials do not determine the load.
    """

    def estimate(known: RobotParameters | None) -> Estimate:
        return identify_load(trials, load, chain, split, robot=known, handle_mass_kg=0.0).estimate

    whole = estimate(robot)
    alone = whole.covariance
    if robot is not None and robot.covariance.any():
        alone = estimate(replace(robot, covariance=np.zeros_like(robot.covariance))).covariance
    return Expected(
        load=trials[0].load,
        method=method_of(load, robot),
        trials=len(trials),
        estimate=whole,
        alone=alone,
        kept=tuple(q for q in range(len(whole.value)) if q not in load.place),
    )


def expected_of_study(study: Study, fitted: StudyFit, chain: Chain, split: Split) -> tuple[Expected, ...]:
    """Every load of a study that is fitted, by each of its methods.

    Raises:
        UndeterminedError: no load is determined.
    """
    robot = fitted.robot.parameters if isinstance(fitted.robot, RobotFit) else fitted.robot
    model, known = robot_model(study.setup.robot), {fit.load for fit in fitted.loads}
    found = []
    for members in loads_of(list(fitted.trials)):
        if members[0].load in known:
            load, rounds = model_and_rounds(members, model, robot, kind_of_load(study, members))
            found += [expected_of(trials, load, chain, split, own) for trials, own in rounds]
    if not found:
        raise UndeterminedError(
            f"study {study.name}: no load is determined by its trials; record one trial of it"
        )
    return tuple(found)
