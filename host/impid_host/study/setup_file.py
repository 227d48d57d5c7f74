"""`setup.toml`: the apparatus, as a file and as a `Setup`."""

import datetime
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import tomli_w
from pydantic import Field, field_validator, model_validator

from impid_host.errors import InputError
from impid_host.robot.model import ROBOTS
from impid_host.study.model import (
    NO_CODES,
    AccelerometerSetup,
    EncoderSetup,
    ForceSensor,
    RobotModelName,
    RobotSetup,
    Session,
    Setup,
    Tolerance,
)
from impid_host.study.toml_file import Table, load_toml, validate

FORMAT = "impid-study/1"
_DEFAULT = Tolerance()
_OF_CODES = ("vref_V", "full_scale_code", "zero_g_V", "sensitivity_V_per_g")

Positive = Annotated[float, Field(gt=0)]
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
PositivePair = Annotated[list[Positive], Field(min_length=2, max_length=2)]


class _Robot(Table):
    model: RobotModelName
    link_lengths_m: list[Positive] = Field(default_factory=list)
    gravity_m_s2: list[float] = Field(default_factory=lambda: [0.0, 0.0])
    urdf: str | None = None
    baseline: Literal["papers", "textbook"] | None = None
    joints: list[str] = Field(default_factory=list)

    @field_validator("model")
    @classmethod
    def _known(cls, model: str) -> str:
        if model not in ROBOTS:
            raise ValueError(f"there are {', '.join(ROBOTS)}")
        return model

    @model_validator(mode="after")
    def _complete(self) -> Self:
        kind = ROBOTS[self.model]
        if kind.link_lengths and len(self.link_lengths_m) != kind.link_lengths:
            wanted = ", ".join(f"l{link + 1}" for link in range(kind.link_lengths))
            raise ValueError(f'model "{self.model}" needs link_lengths_m = [{wanted}]')
        if len(self.gravity_m_s2) not in (2, kind.gravity_axes):
            raise ValueError(f"gravity_m_s2 of model {self.model} has {kind.gravity_axes} components")
        if kind.described and not self.urdf:
            raise ValueError(f'model "{self.model}" needs urdf = "robot.urdf"')
        return self


class _Encoder(Table):
    counts_per_rev: Annotated[list[Positive], Field(min_length=1)]
    zero_rad: list[float]
    direction: list[Literal[1, -1]]

    @model_validator(mode="after")
    def _same_length(self) -> Self:
        if not len(self.counts_per_rev) == len(self.zero_rad) == len(self.direction):
            raise ValueError("counts_per_rev, zero_rad and direction need one entry per joint each")
        return self


class _Accelerometer(Table):
    part: str = "ADXL203"
    vref_V: Positive | None = None
    full_scale_code: Annotated[int, Field(gt=0)] | None = None
    zero_g_V: Pair | None = None
    sensitivity_V_per_g: Pair | None = None
    mount: Literal["link2", "fixed"] = "link2"
    mount_angle_rad: float = 0.0
    axis_angles_rad: Pair = Field(default_factory=lambda: [0.0, 0.0])
    delay_s: Annotated[float, Field(ge=-0.1, le=0.1)] = 0.0

    @model_validator(mode="after")
    def _sensitive(self) -> Self:
        given = [name for name in _OF_CODES if getattr(self, name) is not None]
        if given and len(given) < len(_OF_CODES):
            missing = next(name for name in _OF_CODES if name not in given)
            raise ValueError(
                f"{missing} is missing: codes need {', '.join(_OF_CODES)}, accelerations none of them"
            )
        if self.sensitivity_V_per_g is not None and 0 in self.sensitivity_V_per_g:
            raise ValueError("sensitivity_V_per_g must not be zero")
        return self


class _Handle(Table):
    mass_kg: Annotated[float, Field(ge=0)]


class _ForceSensor(Table):
    timing: Literal["mean", "instant"] = "mean"
    frame: Literal["base", "link2"] = "base"
    mount_angle_rad: float = 0.0


class _Tolerance(Table):
    link_lengths_m: Positive = _DEFAULT.link_lengths_m
    force_gain: Positive = _DEFAULT.force_gain
    force_angle_rad: Positive = _DEFAULT.force_angle_rad
    torque_gain: Positive = _DEFAULT.torque_gain
    payload_kg: Positive = _DEFAULT.payload_kg


class SessionTable(Table):
    """Keys of [session], which a trial.toml may override."""

    subject: Annotated[str, Field(min_length=1)] | None = None
    side: Literal["left", "right"] | None = None
    date: datetime.date | None = None
    posture: Annotated[str, Field(min_length=1)] | None = None

    def session(self) -> Session:
        """As the study holds it."""
        return Session(self.subject, self.side, self.date, self.posture)


class _Prior(Table):
    alpha: Annotated[list[float], Field(min_length=1)]


class _SetupFile(Table):
    format: str
    robot: _Robot
    encoder: _Encoder | None = None
    accelerometer: _Accelerometer | None = None
    handle: _Handle | None = None
    prior: _Prior | None = None
    force_sensor: _ForceSensor = Field(default_factory=_ForceSensor)
    tolerance: _Tolerance = Field(default_factory=_Tolerance)
    session: SessionTable = Field(default_factory=SessionTable)


def read_setup(path: Path) -> Setup:
    """Read `setup.toml`.

    Raises:
        InputError: the file is missing or a key of it is missing or wrong; names the key.
    """
    return setup_from_tables(load_toml(path), path)


def setup_from_tables(tables: dict[str, Any], path: Path, *, prefix: str = "") -> Setup:
    """The `Setup` that the tables of `path` describe; a URDF is looked for beside `path`.

    Raises:
        InputError: a key is missing or wrong, the format is another one, or the URDF does not exist.
    """
    written = tables.get("format")
    if isinstance(written, str) and written != FORMAT:
        remedy = f'this version reads format = "{FORMAT}"; convert the study or use another version of impid'
        raise InputError(path, f'has format = "{written}"', remedy)
    checked = validate(_SetupFile, tables, path, prefix=prefix)
    robot = RobotSetup(
        model=checked.robot.model,
        link_lengths_m=tuple(checked.robot.link_lengths_m),
        gravity_m_s2=tuple(checked.robot.gravity_m_s2),
        urdf=None if checked.robot.urdf is None else _existing_urdf(path, checked.robot.urdf),
        baseline=checked.robot.baseline,
        joints=tuple(checked.robot.joints),
    )
    return Setup(
        robot=robot,
        encoder=_encoder(checked.encoder),
        accelerometer=_accelerometer(checked.accelerometer),
        handle_mass_kg=0.0 if checked.handle is None else checked.handle.mass_kg,
        prior_alpha=None if checked.prior is None else tuple(checked.prior.alpha),
        force_sensor=ForceSensor(**_fields(checked.force_sensor)),
        tolerance=Tolerance(**_fields(checked.tolerance)),
        session=checked.session.session(),
    )


def _fields(table: Table) -> dict[str, Any]:
    return table.model_dump(include=set(type(table).model_fields))


def _existing_urdf(setup_path: Path, named: str) -> Path:
    if "\0" in named or not (setup_path.parent / named).is_file():
        raise InputError(
            setup_path, f"key `robot.urdf` names {named!r}, which does not exist", "put the file there"
        )
    return setup_path.parent / named


def _encoder(table: _Encoder | None) -> EncoderSetup | None:
    if table is None:
        return None
    return EncoderSetup(tuple(table.counts_per_rev), tuple(table.zero_rad), tuple(table.direction))


def _accelerometer(table: _Accelerometer | None) -> AccelerometerSetup | None:
    if table is None:
        return None
    zero, gain = table.zero_g_V, table.sensitivity_V_per_g
    return AccelerometerSetup(
        part=table.part,
        vref_V=table.vref_V or NO_CODES.vref_V,
        full_scale_code=table.full_scale_code or NO_CODES.full_scale_code,
        zero_g_V=NO_CODES.zero_g_V if zero is None else (zero[0], zero[1]),
        sensitivity_V_per_g=NO_CODES.sensitivity_V_per_g if gain is None else (gain[0], gain[1]),
        mount=table.mount,
        mount_angle_rad=table.mount_angle_rad,
        axis_angles_rad=(table.axis_angles_rad[0], table.axis_angles_rad[1]),
        delay_s=table.delay_s,
    )


def setup_tables(setup: Setup) -> dict[str, Any]:
    """The tables of `setup.toml` for a `Setup`; keys that keep their default are left out."""
    tables: dict[str, Any] = {"format": FORMAT, "robot": _robot_keys(setup.robot)}
    if setup.encoder is not None:
        tables["encoder"] = {
            "counts_per_rev": list(setup.encoder.counts_per_rev),
            "zero_rad": list(setup.encoder.zero_rad),
            "direction": list(setup.encoder.direction),
        }
    if setup.accelerometer is not None:
        sensor = setup.accelerometer
        codes: dict[str, Any] = {
            "vref_V": sensor.vref_V,
            "full_scale_code": sensor.full_scale_code,
            "zero_g_V": list(sensor.zero_g_V),
            "sensitivity_V_per_g": list(sensor.sensitivity_V_per_g),
        }
        tables["accelerometer"] = {
            "part": sensor.part,
            **(codes if sensor.reads_codes else {}),
            "mount": sensor.mount,
            "mount_angle_rad": sensor.mount_angle_rad,
        }
        if any(angle != 0.0 for angle in sensor.axis_angles_rad):
            tables["accelerometer"]["axis_angles_rad"] = list(sensor.axis_angles_rad)
        if sensor.delay_s != 0.0:
            tables["accelerometer"]["delay_s"] = sensor.delay_s
    if setup.handle_mass_kg != 0.0:
        tables["handle"] = {"mass_kg": setup.handle_mass_kg}
    if setup.prior_alpha is not None:
        tables["prior"] = {"alpha": list(setup.prior_alpha)}
    grown = (
        ("force_sensor", setup.force_sensor, ForceSensor()),
        ("tolerance", setup.tolerance, Tolerance()),
        ("session", setup.session, Session()),
    )
    for name, table, default in grown:
        if table != default:
            tables[name] = said(table)
    return tables


def _robot_keys(robot: RobotSetup) -> dict[str, Any]:
    keys: dict[str, Any] = {"model": robot.model}
    if robot.link_lengths_m:
        keys["link_lengths_m"] = list(robot.link_lengths_m)
    if len(robot.gravity_m_s2) == 3 or any(robot.gravity_m_s2):
        keys["gravity_m_s2"] = list(robot.gravity_m_s2)
    if robot.urdf is not None:
        keys["urdf"] = robot.urdf.name
    if robot.baseline is not None:
        keys["baseline"] = robot.baseline
    if robot.joints:
        keys["joints"] = list(robot.joints)
    return keys


def said(table: ForceSensor | Tolerance | Session) -> dict[str, Any]:
    """The keys of a table that have a value: TOML knows no None."""
    return {key: value for key, value in asdict(table).items() if value is not None}


def write_setup(setup: Setup, path: Path) -> None:
    """Write `setup.toml` at `path` (replacing it in one step), and the URDF beside it."""
    if setup.robot.urdf is not None and not (path.parent / setup.robot.urdf.name).exists():
        (path.parent / setup.robot.urdf.name).write_bytes(setup.robot.urdf.read_bytes())
    draft = path.with_name(path.name + ".part")
    draft.write_bytes(tomli_w.dumps(setup_tables(setup)).encode())
    draft.replace(path)
