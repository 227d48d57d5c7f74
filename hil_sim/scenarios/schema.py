"""What a scenario file may say. Every quantity carries its unit in its name; unknown keys are refused."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from hil_sim.faults.schema import Fault

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Pair = tuple[float, float]
PositivePair = tuple[Positive, Positive]
Matrix = tuple[Pair, Pair]
Direction = Literal[-1, 1]
ZERO: Matrix = ((0.0, 0.0), (0.0, 0.0))


RobotModel = Literal["planar-2r-absolute", "planar-2r-relative", "joint-1d", "slide-1d"]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class SetupRobot(_Table):
    """setup.toml [robot]."""

    model: RobotModel = "planar-2r-absolute"
    link_lengths_m: PositivePair = (1.0, 1.0)  # of a single axis nobody asks
    gravity_m_s2: Pair | None = None

    @property
    def single(self) -> bool:
        """One axis, its load on it, no board."""
        return self.model in ("joint-1d", "slide-1d")

    @property
    def relative(self) -> bool:
        """The second joint's angle is that of its link against the first one."""
        return self.model == "planar-2r-relative"

    @model_validator(mode="after")
    def _keys_fit_model(self) -> "SetupRobot":
        if self.single == ("link_lengths_m" in self.model_fields_set):
            remedy = "remove it" if self.single else "add the lengths of both links"
            raise ValueError(f"link_lengths_m does not go with {self.model}: {remedy}")
        if self.gravity_m_s2 is not None and not self.relative:
            raise ValueError("gravity_m_s2 is for planar-2r-relative: remove it, or hide gravity.tilt")
        return self


class SetupEncoder(_Table):
    """setup.toml [encoder]."""

    counts_per_rev: tuple[Annotated[int, Field(gt=0)], Annotated[int, Field(gt=0)]]
    zero_rad: Pair = (0.0, 0.0)
    direction: tuple[Direction, Direction] = (1, 1)


class SetupAccelerometer(_Table):
    """setup.toml [accelerometer]: nominal values, or those of the laboratory's calibration."""

    part: str = "ADXL203"
    vref_V: Positive
    full_scale_code: Literal[65536, 16777216] = 65536
    zero_g_V: Pair
    sensitivity_V_per_g: PositivePair
    mount: Literal["link2", "fixed"] = "link2"
    mount_angle_rad: float = 0.0

    @model_validator(mode="after")
    def _width_fits_part(self) -> "SetupAccelerometer":
        expected = 16777216 if self.part == "ADXL355" else 65536
        if self.full_scale_code != expected:
            raise ValueError(f"full_scale_code of the part {self.part} is {expected}: correct one of them")
        return self


class SetupHandle(_Table):
    """setup.toml [handle]."""

    mass_kg: NotNegative = 0.0


class Setup(_Table):
    """What the laboratory knows; goes into setup.toml as it is."""

    robot: SetupRobot
    encoder: SetupEncoder
    accelerometer: SetupAccelerometer
    handle: SetupHandle = SetupHandle()

    @model_validator(mode="before")
    @classmethod
    def _nothing_but_the_axis(cls, content: Any) -> Any:
        """A single axis is logged by its own drive; what the plant needs besides, nobody knows."""
        if not isinstance(content, dict) or not isinstance(content.get("robot"), dict):
            return content
        if content["robot"].get("model") not in ("joint-1d", "slide-1d"):
            return content
        sensor = {"vref_V": 3.3, "zero_g_V": (1.65, 1.65), "sensitivity_V_per_g": (0.62, 0.62)}
        return {"encoder": {"counts_per_rev": (400_000, 400_000)}, "accelerometer": sensor, **content}


class RobotTruth(_Table):
    """[world.robot]: alpha as in [D] eqs. 11 to 13, SI; of a single axis inertia (or mass), damping."""

    alpha: tuple[Positive, float, Positive, NotNegative, NotNegative]
    moment_kg_m: Pair | None = None  # first moments of the links; None: those of masses at their ends

    @model_validator(mode="before")
    @classmethod
    def _second_joint_stands_aside(cls, content: Any) -> Any:
        if isinstance(content, dict) and len(content.get("alpha", ())) == 2:
            inertia, damping = content["alpha"]
            return {**content, "alpha": (inertia, 0.0, 1.0, damping, 0.0)}
        return content

    @model_validator(mode="after")
    def _inertia_is_positive(self) -> "RobotTruth":
        if 0.25 * self.alpha[1] ** 2 >= self.alpha[0] * self.alpha[2]:
            raise ValueError("no robot has this inertia: alpha2 must be below 2 sqrt(alpha1 alpha3)")
        return self


class ControllerTruth(_Table):
    """[world.controller]: joint PD at 1 kHz on the encoders."""

    kp_Nm_per_rad: tuple[NotNegative, NotNegative] = (150.0, 150.0)
    kd_Nms_per_rad: tuple[NotNegative, NotNegative] = (5.0, 5.0)
    velocity_cutoff_Hz: Positive = 60.0


class AccelerometerErrors(_Table):
    """[world.accelerometer]: how this sensor differs from the setup, and its noise."""

    bandwidth_Hz: Positive = 500.0
    noise_density_ug_per_rtHz: NotNegative = 110.0
    offset_mg: Pair = (0.0, 0.0)
    gain_error: Pair = (0.0, 0.0)
    cross_axis: Pair = (0.0, 0.0)
    mount_angle_error_rad: float = 0.0
    supply_V: Positive | None = None  # None: exactly setup's vref_V; the converter shares it
    warm_up_C: float = 0.0
    warm_up_s: Positive = 600.0
    offset_mg_per_C: Pair = (0.1, 0.1)
    gain_per_C: Pair = (0.0, 0.0)
    # Data sheet: about 150 mV at a 3 V supply, growing with its cube: 0.2 V, or 0.32 g, at 3.3 V.
    self_test_g: Pair = (0.32, 0.32)


class _Noise(_Table):
    rms: tuple[NotNegative, NotNegative]
    corner_Hz: Positive = 5.0


class NoiseTable(_Noise):
    """[[world.force_sensor.noise]] (N): sources add up."""

    kind: Literal["white", "ar", "pink", "heteroscedastic", "student"] = "white"


class TorqueNoiseTable(_Noise):
    """[[world.torque_log.noise]] (N m): sources add up; a drive's noise may also grow with the speed."""

    kind: Literal["white", "ar", "pink", "heteroscedastic", "speed", "student"] = "white"


class ForceSensorTable(_Table):
    """[world.force_sensor]: present only where the robot has one."""

    noise_N: tuple[NotNegative, NotNegative] = (0.03, 0.03)
    noise: tuple[NoiseTable, ...] = ()
    offset_N: Pair = (0.0, 0.0)
    gain_error: Pair = (0.0, 0.0)
    quantum_N: NotNegative = 0.0


class TorqueLogTable(_Table):
    """[world.torque_log]: what the robot's own log suffers from."""

    noise: tuple[TorqueNoiseTable, ...] = ()
    quantum_Nm: tuple[NotNegative, NotNegative] = (0.0, 0.0)
    jitter_s: NotNegative = 0.0
    gap_every_s: NotNegative = 0.0
    gap_rows: Annotated[int, Field(ge=0)] = 0
    late_start_s: NotNegative = 0.0


class AdcTable(_Table):
    """[world.adc]: the converter of the board."""

    noise_lsb: NotNegative = 0.0


class EncoderLines(_Table):
    """[world.encoder]: noise on the lines makes the board's counters count wrongly now and then."""

    miscounts_per_min: NotNegative = 0.0
    miscount: int = 4


class Clocks(_Table):
    """[world.clocks]: how fast the two clocks run against the truth."""

    board_ppm: Annotated[float, Field(ge=-1000.0, le=1000.0)] = 0.0
    robot_ppm: Annotated[float, Field(ge=-1000.0, le=1000.0)] = 0.0
    wander_ppm: NotNegative = 0.0
    wander_period_s: Positive = 600.0


class Serial(_Table):
    """[world.serial]: the line between board and host."""

    baud: Annotated[int, Field(ge=9600)] = 921600

    @property
    def bytes_per_ms(self) -> int:
        """Ten bits carry a byte: start, eight, stop."""
        return self.baud // 10000


class LoadTruth(_Table):
    """[world.loads.NAME]: F_ext = -(M x'' + B x' + K (x - x0)).

    On a single axis numbers stand for the matrices: kg or kg m^2, N s/m or N m s/rad, and so on.
    """

    M_kg: Matrix
    B_Ns_per_m: Matrix = ZERO
    K_N_per_m: Matrix = ZERO
    x0_m: Pair

    @model_validator(mode="before")
    @classmethod
    def _numbers_are_along_the_axis(cls, content: Any) -> Any:
        if not isinstance(content, dict):
            return content

        def widened(name: str, value: Any) -> Any:
            if not isinstance(value, (int, float)):
                return value
            return (value, 0.0) if name == "x0_m" else ((value, 0.0), (0.0, 0.0))

        return {name: widened(name, value) for name, value in content.items()}

    @model_validator(mode="after")
    def _mass_is_not_negative(self) -> "LoadTruth":
        (xx, xy), (yx, yy) = self.M_kg
        if xx < 0.0 or yy < 0.0 or xx * yy < 0.25 * (xy + yx) ** 2:
            raise ValueError("M_kg must not take energy from nowhere: make it positive semidefinite")
        return self


class Motion(_Table):
    """[motion.free] and [motion.load]: ten sinusoids per joint."""

    range_deg: Positive
    highest_Hz: Positive = 2.0
    ramp_s: Positive = 2.0


class PerturbationTable(_Table):
    """[motion.perturbation]: stochastic trials, [P] Sec. II: random force, weak PD at the end-effector."""

    rms_N: Positive = 4.0
    highest_Hz: Positive = 15.0
    kp_N_per_m: tuple[NotNegative, NotNegative] = (100.0, 100.0)
    kd_Ns_per_m: tuple[NotNegative, NotNegative] = (5.0, 5.0)
    velocity_cutoff_Hz: Positive = 20.0
    alike: bool = False  # the same forces in every trial, as [P]'s test of repeatability presumes


class Motions(_Table):
    """[motion]: free trials move about a pose, loaded ones about the load's equilibrium."""

    free_centre_rad: Pair = (0.7854, 0.7854)
    free: Motion = Motion(range_deg=40.0)
    load: Motion = Motion(range_deg=10.0)
    perturbation: PerturbationTable = PerturbationTable()


class World(_Table):
    """What is really true."""

    robot: RobotTruth
    controller: ControllerTruth = ControllerTruth()
    accelerometer: AccelerometerErrors = AccelerometerErrors()
    force_sensor: ForceSensorTable | None = None
    torque_log: TorqueLogTable = TorqueLogTable()
    adc: AdcTable = AdcTable()
    encoder: EncoderLines = EncoderLines()
    clocks: Clocks = Clocks()
    serial: Serial = Serial()
    loads: dict[str, LoadTruth] = {}


class Trial(_Table):
    """[[trials]]: one recording."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")]
    kind: Literal["free", "mass-spring", "arm", "stochastic"]
    on: Literal["mass-spring", "arm"] | None = None
    load: str | None = None
    payload_kg: NotNegative | None = None
    duration_s: Annotated[float, Field(gt=0.0, le=86400.0)] = 50.0
    robot_zero_s: float = 0.0
    note: str = ""
    # What to play: fdx, fdy (N) at 500 rows a second in stochastic trials, else theta1, omega1, ... at 1000.
    command_csv: str | None = None

    @model_validator(mode="after")
    def _load_fits_kind(self) -> "Trial":
        if self.kind == "free" and self.load is not None:
            raise ValueError("a free trial has nothing on the end-effector: remove load, or change kind")
        if self.kind != "free" and self.load is None:
            raise ValueError("name the load: one of the tables below [world.loads]")
        if (self.kind == "stochastic") != (self.on is not None):
            raise ValueError(
                'a stochastic trial, and no other, says what it shakes: on = "mass-spring" or "arm"'
            )
        return self

    @property
    def on_arm(self) -> bool:
        """The load is a human arm, so the handle lies between it and the force sensor."""
        return "arm" in (self.kind, self.on)


def _repeated(trial: Any) -> list[Any]:
    """A trial with `repeat = n` becomes NAME_01 to NAME_n, the robot's clock another in each."""
    if not isinstance(trial, dict) or "repeat" not in trial:
        return [trial]
    rest = {key: value for key, value in trial.items() if key != "repeat"}
    repeat = trial["repeat"]
    if not isinstance(repeat, int) or not 1 <= repeat <= 99 or "name" not in trial:
        raise ValueError(f"trial {trial.get('name', '?')}: repeat must be a whole number from 1 to 99")
    zero_s = float(rest.get("robot_zero_s", 0.0))
    return [
        {**rest, "name": f"{trial['name']}_{number:02}", "robot_zero_s": zero_s + 61.375 * (number - 1)}
        for number in range(1, repeat + 1)
    ]


class EffectTable(BaseModel):
    """[[effects]]: something hidden; its parameters stand beside these keys (hil_sim/effects)."""

    model_config = ConfigDict(extra="allow", frozen=True)

    effect: str
    where: str | tuple[str, ...] = ()
    trials: tuple[str, ...] = ()
    when: Literal["all", "free", "load"] = "all"
    per_trial: dict[str, dict[str, Any]] = {}

    @property
    def places(self) -> tuple[str, ...]:
        """`where` as a tuple."""
        return (self.where,) if isinstance(self.where, str) else self.where

    @property
    def values(self) -> dict[str, Any]:
        """The effect's own parameters."""
        return dict(self.__pydantic_extra__ or {})


class Scenario(_Table):
    """The whole file."""

    format: Literal["impid-scenario/1"]
    title: str
    setup: Setup
    world: World
    motion: Motions = Motions()
    effects: tuple[EffectTable, ...] = ()
    trials: Annotated[tuple[Trial, ...], Field(min_length=1)]
    faults: tuple[Fault, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _repeat_trials(cls, content: Any) -> Any:
        if isinstance(content, dict) and isinstance(content.get("trials"), (list, tuple)):
            return {**content, "trials": [one for trial in content["trials"] for one in _repeated(trial)]}
        return content

    @model_validator(mode="after")
    def _names_hold_together(self) -> "Scenario":
        names = [trial.name for trial in self.trials]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"two trials are called {twice[0]}: give each its own name")
        for effect in self.effects:
            there = {*names, *(trial.load for trial in self.trials)}
            unknown = [name for name in (*effect.trials, *effect.per_trial) if name not in there]
            if unknown:
                raise ValueError(f"effect {effect.effect} names {unknown[0]}: there is no such trial or load")
        if self.setup.robot.single:
            if any(trial.kind == "stochastic" for trial in self.trials):
                raise ValueError(f"{self.setup.robot.model} has no stochastic trials: choose another kind")
            if self.world.force_sensor is not None:
                raise ValueError("a single axis has no force sensor: remove [world.force_sensor]")
        for trial in self.trials:
            if trial.load is not None and trial.load not in self.world.loads:
                raise ValueError(
                    f"trial {trial.name} names the load {trial.load}: add [world.loads.{trial.load}]"
                )
        return self
