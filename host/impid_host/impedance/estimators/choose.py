"""Robot and loads by the estimator that was asked for, or by evidence.

The evidence is what least squares and instruments make of the same rows: noise in the rows' own signals bends
the one and not the other. `auto` keeps least squares where they are shown to agree, and not merely where no
difference is shown: the bias of every parameter must lie, with 95 % confidence, below a third of its standard
deviation, by which a 95 % interval loses one per cent of its coverage. Output error is not among its
choices: nothing in a record tells noise in the torque that drives the model from noise in what it moves.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from impid_host.errors import UndeterminedError
from impid_host.impedance.estimators.estimated import Estimated, Estimator, EstimatorWish
from impid_host.impedance.estimators.instruments import (
    Model,
    Source,
    by_accelerometer,
    commanded,
    twins_by_angles,
    twins_by_simulation,
)
from impid_host.impedance.estimators.output_error import load_by_output_error, robot_by_output_error
from impid_host.impedance.identify import LoadFit, RobotFit, RobotParameters, identify_load, identify_robot
from impid_host.impedance.linear import Estimate
from impid_host.impedance.loads import LoadModel
from impid_host.impedance.rows import Split, finish
from impid_host.robot.terms import RobotStructure
from impid_host.signals.align import AlignedTrial
from impid_host.signals.chain import Chain

HARMLESS = 1 / 3  # of a standard deviation: a 95 % interval then covers 93.7 %
_SURE = 1.645
_FOLLOWS = 0.5  # of the power of every joint's speed, which the simulated model must share
_ROUNDS = 4
_SETTLED = 0.1  # of a standard deviation, from one simulation to the next
_NONE = (
    "there are no instruments: accelerations come from the angles alone, and the logs do not say what the "
    "controller was told (theta1_ref, ... or fdx, fdy in robot.csv)"
)

Fit = TypeVar("Fit", RobotFit, LoadFit)


@dataclass(frozen=True, slots=True)
class Regression:
    """How every robot and load of a study is estimated."""

    wish: EstimatorWish
    chain: Chain
    split: Split

    def robot(self, trials: Sequence[AlignedTrial], structure: RobotStructure) -> RobotFit:
        """The robot from its free trials.

        Raises:
            UndeterminedError: the trials do not determine it, or the estimator cannot be had.
        """
        plain = identify_robot(trials, structure, self.chain, self.split)
        if self.wish == "least-squares":
            return plain
        if self.wish == "output-error":
            return self._robot_by_output_error(plain, trials, structure)

        def again(twins: Sequence[AlignedTrial]) -> RobotFit:
            return identify_robot(trials, structure, self.chain, self.split, twins)

        def model(fit: RobotFit) -> Model:
            if fit.parameters.unseen is not None:
                raise UndeterminedError("the trials leave parameters open that a simulation needs")
            return Model(structure, fit.parameters.value)

        return self._by_instruments(plain, trials, again, model)

    def load(
        self,
        trials: Sequence[AlignedTrial],
        load: LoadModel,
        structure: RobotStructure,
        robot: RobotParameters | None,
        parameters: RobotParameters,
        handle_mass_kg: float,
    ) -> LoadFit:
        """A load over all its trials, arguments and errors as `identify_load`.

        Args:
            parameters: the robot's, which a simulation needs for Method 2 as well.
        """

        def again(
            instruments: Sequence[AlignedTrial] | None = None, known: Estimate | None = None
        ) -> LoadFit:
            return identify_load(
                trials, load, self.chain, self.split, robot=robot, handle_mass_kg=handle_mass_kg,
                instruments=instruments, known=known,
            )  # fmt: skip

        plain = again()
        if self.wish == "least-squares":
            return plain
        if self.wish == "output-error":
            alpha = None if robot is None else (robot.value, robot.covariance)
            found = load_by_output_error(
                trials, load, structure, plain.estimate, self.chain, self.split, alpha=alpha
            )
            return replace(again(known=found), estimated=Estimated("output-error", "as asked for"))

        def model(fit: LoadFit) -> Model:
            if not np.all(np.isfinite(parameters.value)) or parameters.unseen is not None:
                raise UndeterminedError("the robot is not known well enough to be simulated")
            return Model(structure, parameters.value, load, fit.estimate.value)

        return self._by_instruments(plain, trials, again, model)

    def _robot_by_output_error(
        self, plain: RobotFit, trials: Sequence[AlignedTrial], structure: RobotStructure
    ) -> RobotFit:
        if all(trial.reference is not None for trial in trials):
            found = robot_by_output_error(trials, structure, plain.estimate, self.chain, self.split)
            fit = identify_robot(trials, structure, self.chain, self.split, known=found)
            return replace(fit, estimated=Estimated("output-error", "as asked for"))
        other: Estimator = "instruments" if by_accelerometer(trials) else "least-squares"
        fit = replace(self, wish=other).robot(trials, structure)
        return replace(
            fit,
            estimated=Estimated(
                other,
                "a free robot that only its measured torque drives drifts away, so output error would need "
                "what its controller was told (theta1_ref, ... in robot.csv)",
                None if fit.estimated is None else fit.estimated.instruments,
            ),
        )

    def _by_instruments(
        self,
        plain: Fit,
        trials: Sequence[AlignedTrial],
        again: Callable[[Sequence[AlignedTrial]], Fit],
        model: Callable[[Fit], Model],
    ) -> Fit:
        """By instruments, where they are asked for or least squares are not shown to be safe."""
        try:
            fit, source = self._instrumented(plain, trials, again, model)
        except UndeterminedError as error:
            if self.wish == "auto":
                reason = f"it cannot be compared with anything; {error}"
                return replace(plain, estimated=Estimated("least-squares", reason))
            raise
        name, bias = _worst(plain.estimate, fit.estimate)
        if self.wish == "instruments":
            return replace(fit, estimated=Estimated("instruments", "as asked for", source, bias))
        words = (
            f"against instruments by the {source}, least squares move {name} by {bias[0]:.2g} of its "
            f"standard deviation, at most {bias[1]:.2g}"
        )
        if bias[1] < HARMLESS:
            return replace(plain, estimated=Estimated("least-squares", f"{words}: harmless", source, bias))
        return replace(fit, estimated=Estimated("instruments", f"{words}: not shown harmless", source, bias))

    def _instrumented(
        self,
        plain: Fit,
        trials: Sequence[AlignedTrial],
        again: Callable[[Sequence[AlignedTrial]], Fit],
        model: Callable[[Fit], Model],
    ) -> tuple[Fit, Source]:
        """By the simulated model where commands were logged and it follows the motion, else by the angles."""
        reason = _NONE
        if commanded(trials):
            try:
                return self._simulated(plain, trials, again, model), "simulated model"
            except UndeterminedError as error:
                reason = str(error)
        if not by_accelerometer(trials):
            raise UndeterminedError(reason)
        return again(twins_by_angles(trials)), "angles"

    def _simulated(
        self,
        plain: Fit,
        trials: Sequence[AlignedTrial],
        again: Callable[[Sequence[AlignedTrial]], Fit],
        model: Callable[[Fit], Model],
    ) -> Fit:
        """Simulated and estimated in turns, until the parameters stand still."""
        fit = plain
        for _ in range(_ROUNDS):
            twins = twins_by_simulation(trials, model(fit), self.chain)
            self._require_followed(trials, twins)
            before, fit = fit, again(twins)
            if np.all(np.abs(fit.estimate.value - before.estimate.value) < _SETTLED * fit.estimate.sd):
                break
        return fit

    def _require_followed(self, trials: Sequence[AlignedTrial], twins: Sequence[AlignedTrial]) -> None:
        for trial, twin in zip(trials, twins, strict=True):
            both = finish(self.chain, np.stack([trial.omega, twin.omega], axis=2), trial.rate_hz)[trial.valid]
            power = np.mean(both[:, :, 0] ** 2, axis=0)
            left = np.mean((both[:, :, 0] - both[:, :, 1]) ** 2, axis=0)
            if np.any(left > (1 - _FOLLOWS) * power):
                raise UndeterminedError(
                    f"trial {trial.name}: the model simulated from what its controller was told does not "
                    "follow the motion; are the reference and the torque those of this robot?"
                )


def _worst(plain: Estimate, other: Estimate) -> tuple[str, tuple[float, float]]:
    """The parameter that may be off most: its name, its shift and the most of it, in standard deviations."""
    if other.least_squares is None or plain.names != other.names:
        raise UndeterminedError("instruments and least squares determine different combinations")
    sd = np.minimum(plain.sd, other.sd)
    moved = np.maximum(np.abs(plain.value - other.value), np.abs(other.least_squares[0])) / sd
    most = moved + _SURE * other.least_squares[1] / sd
    k = int(np.argmax(most))
    return plain.names[k], (float(moved[k]), float(most[k]))
