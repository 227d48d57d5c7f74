"""`impid-host init`: setup.toml from a short dialogue, or from a URDF."""

from pathlib import Path
from typing import Any

import click

from impid_host.errors import InputError
from impid_host.robot.model import ROBOTS
from impid_host.study.setup_file import FORMAT, setup_from_tables, write_setup

_PICTURES = {
    "planar-2r-absolute": "two revolute joints in a plane, both angles from the base frame",
    "planar-2r-relative": "two revolute joints in a plane, the second angle from the first link",
    "slide-1d": "one sliding axis",
    "joint-1d": "one revolute joint with the load on it",
    "urdf": "any serial robot with a URDF",
}
# Zero and sensitivity at 3.3 V, V and V/g: ADXL203 by docs/hardware.md, ADXL335 ratiometric, 0.3 V/g at 3 V.
_PARTS = {"ADXL203": (1.65, 0.616), "ADXL335": (1.65, 0.330)}


@click.command()
@click.argument("out", type=click.Path(path_type=Path, dir_okay=False), default=Path("setup.toml"))
@click.option(
    "--urdf", type=click.Path(path_type=Path, dir_okay=False), help="The robot's URDF: its chain is read."
)
def command(out: Path, urdf: Path | None) -> None:
    """Write the apparatus as setup.toml (OUT), asking for what it must know. Enter takes what stands in [ ].

    Answers may be piped in, one a line. What is not known yet may be mended in the file later
    (docs/study-format.md explains every key).

    \b
    Examples:
      impid-host init
      impid-host init rig.toml --urdf robot.urdf
    """
    if out.exists():
        raise InputError(out, "is there already", "name another file, or move it away first")
    robot, described_in = _robot(urdf, out)
    tables: dict[str, Any] = {"format": FORMAT, "robot": robot, **_module(ROBOTS[robot["model"]].joints or 2)}
    mass = click.prompt("Mass between robot and hand (handle), kg", type=click.FloatRange(0), default=0.0)
    if mass:
        tables["handle"] = {"mass_kg": mass}
    session = _session()
    if session:
        tables["session"] = session
    # The tables as a file would have them: what is wrong is named by its key.
    setup = setup_from_tables(tables, described_in / out.name)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        write_setup(setup, out)
    except OSError as error:
        raise InputError(out, f"cannot be written ({error.strerror})", "choose another place") from None
    click.echo(
        f"{out} written. Next: record free trials (docs/recording.md), or import logs (docs/import.md)."
    )


def _robot(urdf: Path | None, out: Path) -> tuple[dict[str, Any], Path]:
    """Its table, and the folder in which its URDF lies."""
    if urdf is None:
        for name in ROBOTS:
            click.echo(f"  {name:20}{_PICTURES[name]}")
        model = click.prompt("Robot", type=click.Choice(list(ROBOTS)), default="planar-2r-absolute")
        if ROBOTS[model].described:
            urdf = Path(click.prompt("URDF file", type=str))
    if urdf is not None:
        return _described(urdf, out), urdf.parent
    robot: dict[str, Any] = {"model": model}
    if ROBOTS[model].link_lengths:
        robot["link_lengths_m"] = [
            click.prompt(f"Length of link {link + 1}, m", type=click.FloatRange(0, min_open=True))
            for link in range(ROBOTS[model].link_lengths)
        ]
    return robot, out.parent


def _described(urdf: Path, out: Path) -> dict[str, Any]:
    """The chain that the URDF's longest branch is, shown; the file has to lie beside setup.toml."""
    from impid_host.robot.urdf_file import read_chain  # noqa: PLC0415

    if not urdf.is_file():
        raise InputError(urdf, "does not exist", "check the path of the URDF")
    chain = read_chain(urdf)
    kinds = ", ".join(
        f"{name} ({'slides' if slides else 'turns'})"
        for name, slides in zip(chain.joints, chain.prismatic, strict=True)
    )
    click.echo(f"  {urdf}: {len(chain.joints)} joints: {kinds}; tip {chain.tip}")
    beside = out.parent / urdf.name
    if beside.exists() and beside.resolve() != urdf.resolve():
        raise InputError(beside, "is there already and is another URDF", "move it away first")
    keys: dict[str, Any] = {"model": "urdf", "urdf": urdf.name}
    named = click.prompt("Joints that the log follows, base to tip", default=" ".join(chain.joints))
    if named.split() != list(chain.joints):
        keys["joints"] = list(read_chain(urdf, named.replace(",", " ").split()).joints)
    return keys


def _module(joints: int) -> dict[str, Any]:
    """The sensor module's tables."""
    kind = click.prompt(
        "Sensor module: impid's board, another one in m/s^2, or none",
        type=click.Choice(["board", "other", "none"]),
        default="board",
    )
    if kind == "none":
        return {}
    mount = click.prompt(
        "Accelerometer turns with the last link, or stays along x and y",
        type=click.Choice(["link2", "fixed"]),
        default="link2",
    )
    angle = click.prompt("Angle from that x to its first axis, rad", type=float, default=0.0)
    where = {"mount": mount, "mount_angle_rad": angle}
    if kind == "other":
        return {"accelerometer": {"part": click.prompt("Its name", default="IMU"), **where}}
    part = click.prompt("Accelerometer", type=click.Choice(list(_PARTS)), default="ADXL203")
    zero, gain = _PARTS[part]
    counts = [
        click.prompt(f"Counts per turn of joint {joint + 1}", type=click.FloatRange(1))
        for joint in range(joints)
    ]
    click.echo("  zero and sensitivity are the data sheet's; `impid-host device calibrate` measures them")
    return {
        "encoder": {"counts_per_rev": counts, "zero_rad": [0.0] * joints, "direction": [1] * joints},
        "accelerometer": {
            "part": part,
            "vref_V": 3.3,
            "full_scale_code": 65536,
            "zero_g_V": [zero, zero],
            "sensitivity_V_per_g": [gain, gain],
            **where,
        },
    }


def _session() -> dict[str, Any]:
    """Who, which side, when, how; what is left empty is left out."""
    subject = click.prompt("Subject, a code and never a name", default="", show_default=False)
    if not subject:
        return {}
    session: dict[str, Any] = {"subject": subject}
    side = click.prompt("Side", type=click.Choice(["left", "right", ""]), default="", show_choices=True)
    if side:
        session["side"] = side
    date = click.prompt("Date", type=click.DateTime(["%Y-%m-%d"]), default="", show_default=False)
    if date:
        session["date"] = date.date()
    posture = click.prompt("Posture", default="", show_default=False)
    if posture:
        session["posture"] = posture
    return session
