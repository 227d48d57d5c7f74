"""A study in memory, as the study folder describes it: apparatus, trials, raw samples and torque logs."""

import datetime
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from impid_host.samples import ModuleSamples

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
        baseline: what `diagnose` starts from: the papers' robot, or a textbook's (friction and offset in
            every joint); None leaves the choice to it.
    """

    model: RobotModelName
    link_lengths_m: tuple[float, ...] = ()
    gravity_m_s2: tuple[float, ...] = (0.0, 0.0)
    urdf: Path | None = None
    baseline: Literal["papers", "textbook"] | None = None
    joints: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class EncoderSetup:
    """angle = zero_rad + direction * count * 2 pi / counts_per_rev, per joint."""

    counts_per_rev: tuple[float, ...]
    zero_rad: tuple[float, ...]
    direction: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class AccelerometerSetup:
    """specific force (g) = (code / full_scale_code * vref_V - zero_g_V) / sensitivity_V_per_g, per axis.

    Attributes:
        axis_angles_rad: by how much each axis is turned counter-clockwise from where `mount_angle_rad` puts
            it (a calibration's misalignment); the axes are at right angles where both are equal.
        delay_s: delay of the acceleration beyond what the time stamps take off already, such as that of
            another filter capacitor.
    """

    part: str
    vref_V: float
    full_scale_code: int
    zero_g_V: tuple[float, float]
    sensitivity_V_per_g: tuple[float, float]
    mount: Literal["link2", "fixed"]
    mount_angle_rad: float
    axis_angles_rad: tuple[float, float] = (0.0, 0.0)
    delay_s: float = 0.0

    @property
    def reads_codes(self) -> bool:
        """Whether the setup says what the converter's codes mean; else the module gives m/s^2 itself."""
        return self.full_scale_code > 0


NO_CODES = AccelerometerSetup("", math.nan, 0, (math.nan, math.nan), (math.nan, math.nan), "link2", 0.0)


@dataclass(frozen=True, slots=True)
class ForceSensor:
    """The physical force sensor whose `fx, fy` a log holds.

    Attributes:
        timing: "mean" over the sample period centred on `t`, or "instant".
        frame: "base", or "link2": the axes turn with the second link.
        mount_angle_rad: from that frame's x to the sensor's first axis, counter-clockwise.
    """

    timing: Literal["mean", "instant"] = "mean"
    frame: Literal["base", "link2"] = "base"
    mount_angle_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How well the declared constants are known: one standard deviation each; gains as a fraction of 1."""

    link_lengths_m: float = 0.001
    force_gain: float = 0.01
    force_angle_rad: float = 0.01
    torque_gain: float = 0.05
    payload_kg: float = 0.002


@dataclass(frozen=True, slots=True)
class Session:
    """Who was measured (a code, never a name), which arm, when and how; None where nobody said."""

    subject: str | None = None
    side: Literal["left", "right"] | None = None
    date: datetime.date | None = None
    posture: str | None = None

    def over(self, general: "Session") -> "Session":
        """What is said here, and what `general` says where nothing is."""
        own = {f.name: getattr(self, f.name) for f in fields(self)}
        return Session(**{k: getattr(general, k) if v is None else v for k, v in own.items()})


@dataclass(frozen=True, slots=True)
class Setup:
    """`setup.toml`: the apparatus, one for all trials of the study.

    `force_sensor` is what the log's `fx, fy` mean, with the defaults where setup.toml says nothing: whether
    there is a sensor, the log says.
    """

    robot: RobotSetup
    encoder: EncoderSetup | None = None
    accelerometer: AccelerometerSetup | None = None
    handle_mass_kg: float = 0.0
    prior_alpha: tuple[float, ...] | None = None
    force_sensor: ForceSensor = ForceSensor()
    tolerance: Tolerance = Tolerance()
    session: Session = Session()


@dataclass(frozen=True, slots=True)
class StampFit:
    """Stamps put back on the clock that made the rows: t = start + number * period, missing rows counted.

    Attributes:
        found: "bursts": several rows stamped together, on arrival; "resolution": stamps rounded or cut.
        period_s: fitted period of the rows, s.
        step_s: the step in which the stamps as written advance, s.
        rows_per_step: rows to one stamp, the median.
        residual_rms_s, residual_max_s: of what that clock leaves of the stamps as written, s. Stamps rounded
            to a step leave step / sqrt(12).
        missing_rows: rows that the clock says are not there.
    """

    found: Literal["bursts", "resolution"]
    period_s: float
    step_s: float
    rows_per_step: float
    residual_rms_s: float
    residual_max_s: float
    missing_rows: int


@dataclass(frozen=True, slots=True)
class RobotLog:
    """`robot.csv`: what the robot's controller logged, on the robot's clock.

    Attributes:
        t: seconds on the robot's clock, shape (N,).
        theta: joint angles (rad; m for a prismatic joint), shape (N, n).
        tau: joint torques (N m; N for a prismatic joint), shape (N, n).
        force: force of the load on the robot by a physical sensor (N, in its own frame, see `ForceSensor`),
            shape (N, 2), or None.
        perturbation: commanded perturbation force (N, base frame), shape (N, 2), or None.
        reference: what the controller was told to follow (rad; m), shape (N, n), or None.
        sync: level of the sync line, shape (N,), or None.
        stamps: how `t` was recovered where the file's stamps were coarse or in bursts; None: as written.
        t_written: those stamps, shape (N,), or None.
        columns: other columns that were asked for, by name, in their own units, each of shape (N,).
    """

    t: Floats
    theta: Floats
    tau: Floats
    force: Floats | None = None
    perturbation: Floats | None = None
    sync: NDArray[np.uint8] | None = None
    stamps: StampFit | None = None
    t_written: Floats | None = None
    columns: Mapping[str, Floats] = field(default_factory=dict)
    reference: Floats | None = None

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True, slots=True)
class Trial:
    """One trial folder. `load` names what was on the end-effector; trials of one load share it.

    `session` is what its own trial.toml says; `Study.session_of` adds what setup.toml says for all.
    `narrow_counters` are the joints (from 0) whose 16-bit counter wrapped, which the reader has undone.
    """

    name: str
    kind: TrialKind
    load: str
    robot: RobotLog
    device: ModuleSamples | None = None
    on: Literal["mass-spring", "arm"] | None = None
    payload_kg: float | None = None
    note: str = ""
    session: Session = Session()
    narrow_counters: tuple[int, ...] = ()


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

    def session_of(self, trial: Trial) -> Session:
        """Subject, side, date and posture of a trial: its own, else the study's."""
        return trial.session.over(self.setup.session)
