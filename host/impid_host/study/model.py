"""A study in memory, as the study folder describes it: apparatus, trials, raw samples and torque logs."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from impid_host.samples import DeviceSamples

Floats = NDArray[np.float64]
RobotModelName = str  # a row of robot.model.ROBOTS
TrialKind = Literal["free", "mass-spring", "arm", "stochastic"]

STANDARD_GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True, slots=True)
class RobotSetup:
    """The robot: which model, and what that model needs to know.

    Attributes:
        link_lengths_m: of a planar arm.
        gravity_m_s2: in its plane; of a URDF along x, y and z, where it is not 9.81 m/s^2 along -z.
        urdf: the file; joints: names of those that the log follows, base to tip, where it does not follow the
            longest chain.
    """

    model: RobotModelName
    link_lengths_m: tuple[float, ...] = ()
    gravity_m_s2: tuple[float, ...] = (0.0, 0.0)
    urdf: Path | None = None
    joints: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class EncoderSetup:
    """angle = zero_rad + direction * count * 2 pi / counts_per_rev, per joint."""

    counts_per_rev: tuple[float, ...]
    zero_rad: tuple[float, ...]
    direction: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class AccelerometerSetup:
    """specific force (g) = (code / full_scale_code * vref_V - zero_g_V) / sensitivity_V_per_g, per axis."""

    part: str
    vref_V: float
    full_scale_code: int
    zero_g_V: tuple[float, float]
    sensitivity_V_per_g: tuple[float, float]
    mount: Literal["link2", "fixed"]
    mount_angle_rad: float


@dataclass(frozen=True, slots=True)
class Setup:
    """`setup.toml`: the apparatus, one for all trials of the study."""

    robot: RobotSetup
    encoder: EncoderSetup | None = None
    accelerometer: AccelerometerSetup | None = None
    handle_mass_kg: float = 0.0
    prior_alpha: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True)
class RobotLog:
    """`robot.csv`: what the robot's controller logged, on the robot's clock.

    Attributes:
        t: seconds on the robot's clock, shape (N,).
        theta: joint angles (rad; m for a prismatic joint), shape (N, n).
        tau: joint torques (N m; N for a prismatic joint), shape (N, n).
        force: force of the load on the robot by a physical sensor (N, base frame), shape (N, 2), or None.
        perturbation: commanded perturbation force (N, base frame), shape (N, 2), or None.
        sync: level of the sync line, shape (N,), or None.
    """

    t: Floats
    theta: Floats
    tau: Floats
    force: Floats | None = None
    perturbation: Floats | None = None
    sync: NDArray[np.uint8] | None = None

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True, slots=True)
class Trial:
    """One trial folder. `load` names what was on the end-effector; trials of one load share it."""

    name: str
    kind: TrialKind
    load: str
    robot: RobotLog
    device: DeviceSamples | None = None
    on: Literal["mass-spring", "arm"] | None = None
    payload_kg: float | None = None
    note: str = ""


@dataclass(frozen=True, slots=True)
class Study:
    """A whole campaign; trials sorted by name."""

    name: str
    setup: Setup
    trials: tuple[Trial, ...]
    source: Path | None = field(default=None, compare=False)

    def of_kind(self, *kinds: TrialKind) -> tuple[Trial, ...]:
        """The trials of the given kinds, in the study's order."""
        return tuple(trial for trial in self.trials if trial.kind in kinds)
