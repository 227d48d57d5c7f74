"""The `impid-host` command: one thin file per subcommand in this folder."""

import importlib
import sys

import click

from impid_host.errors import ImpidError

# name -> what it does; the module of the same name holds a click command called `command`.
COMMANDS = {
    "doctor": "Ports, permissions, board, versions, clock, disk: is this desk ready?",
    "init": "Write setup.toml from a short dialogue, or from a URDF.",
    "record": "Record the sensor board (or the simulator) into an MCAP file.",
    "info": "Tell what a recording holds.",
    "device": "Talk to the board: info, self-test, calibrate, set, reset, log.",
    "sync": "Offset and drift between the board's clock and the robot's log.",
    "check": "Look for mistakes in a study: signs, units, swaps, labels.",
    "fit": "Identify the robot, then the load or arm, of a study.",
    "diagnose": "Find what the model lacks in a study, and prove it on held-out data.",
    "report": "One page about a study: verdict, tables, figures, provenance.",
    "compare": "Change of M, B, K from session to session; many studies as one table.",
    "batch": "Check, fit and diagnose any number of studies, on all cores or a cluster.",
    "judge": "Error of a saved model on other records of the same machine, nothing fitted.",
    "import": "Turn foreign logs (CSV, Parquet, .mat) into a study folder.",
    "export": "Write a study folder, Parquet, .mat or CAN log from a recording.",
    "design": "Excitations for the robot: joint references, force perturbations.",
}


class _LazyGroup(click.Group):
    """Imports a subcommand only when it is asked for: `--help` stays quick."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        return list(COMMANDS)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(
            f"impid_host.cli.{cmd_name}_" if cmd_name == "import" else f"impid_host.cli.{cmd_name}"
        )
        command: click.Command = module.command
        return command


@click.group(
    cls=_LazyGroup, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.version_option(package_name="impid")
def cli() -> None:
    """Measure a human arm's mechanical impedance without a force sensor.

    \b
    The usual order:
      impid-host record  --port /dev/ttyACM0 --duration 50 --out free_01.mcap
      impid-host export  free_01.mcap --robot-log free_01.csv --trial free_01 --out study/
      impid-host fit     study/
    """


def main() -> None:
    """Run the command line; an error that the user can act on is one line and exit status 1."""
    try:
        cli(standalone_mode=True)
    except ImpidError as error:
        click.echo(f"impid-host: {error}", err=True)
        sys.exit(1)
    except OSError as error:
        # A result that cannot be written (no such folder, no permission, no space) names its file itself.
        if error.filename is None:
            raise
        click.echo(f"impid-host: {error.filename}: {error.strerror}; choose another place", err=True)
        sys.exit(1)
