"""The `impid-sim` command: one thin file per subcommand in this folder."""

import importlib
import sys

import click

from hil_sim.errors import SimError

# name -> what it does; the module of the same name holds a click command called `command`.
COMMANDS = {
    "list": "Scenarios that ship with the simulator, and their trials.",
    "study": "Write a study folder in virtual time.",
    "random": "Write the study of a random laboratory, for validation.",
    "serve": "Serve the sensor board of one trial in real time.",
    "truth": "Print what a scenario hides.",
}
# What only `pip install impid[sim]` brings, and what a C compiler makes.
_OF_THE_EXTRA = ("cffi", "_cffi_backend", "unicorn", "elftools", "hil_sim._native", "hil_sim._chip")


class _LazyGroup(click.Group):
    """Imports a subcommand only when it is asked for: `--help` stays quick."""

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """The table above, word for word: click itself would import every command for its help."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = importlib.import_module(f"hil_sim.cli.{cmd_name}_").command
        return command


@click.group(
    cls=_LazyGroup, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
def cli() -> None:
    """A laboratory in software: robot, load and sensors around the real firmware.

    A SCENARIO is the name of a shipped one (see `impid-sim list`) or the path of a TOML file.

    \b
    In virtual time, straight to a study folder:
      impid-sim study first-light --out study --seed 1 --truth truth.json
    As a board to talk to:
      impid-sim serve first-light --trial free_01 --robot-log free_01.csv
    """


def main() -> None:
    """Run the command line; an error that the user can act on is one line and exit status 1."""
    try:
        cli(standalone_mode=True)
    except ModuleNotFoundError as error:
        if error.name not in _OF_THE_EXTRA:
            raise
        click.echo(
            f"impid-sim: {error.name} is missing: the simulator is an extra; pip install 'impid[sim]' (where "
            "no wheel fits this machine, that needs a C compiler)",
            err=True,
        )
        sys.exit(1)
    except SimError as error:
        click.echo(f"impid-sim: {error}", err=True)
        sys.exit(1)
