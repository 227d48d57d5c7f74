"""What the site (`make docs`) has beside docs/: pages of other folders, and pages made from the code.

mkdocs calls the functions whose names begin with `on_`. Links are written as they work in the repository; one
that leaves the site is turned into plain text.
"""

import importlib
import os
import re
import sys
from pathlib import Path
from typing import Any

import cantools
import click

sys.path.insert(0, str(Path(__file__).parent))  # mkdocs loads a hook by its path
import gallery

ROOT = Path(__file__).resolve().parents[1]
# file of the repository -> page of the site
PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "firmware/README.md": "firmware.md",
    "firmware/boards/nucleo_f446re/README.md": "nucleo_f446re.md",
    "firmware/boards/stm32g474/README.md": "stm32g474.md",
} | {f"docs/gallery/{path.name}": f"gallery/{path.stem}.md" for path in gallery.paths()}
_LINK = re.compile(r"(!?)\[([^\]\n]*)\]\(([^)\s]+)\)")
_FENCE = re.compile(r"^(```.*?^```)", re.MULTILINE | re.DOTALL)


def on_files(files: Any, config: Any) -> Any:
    """Add the pages that no file in docs/ holds."""
    from mkdocs.structure.files import File  # noqa: PLC0415  (only the site needs mkdocs)

    texts: dict[str, str | bytes] = {
        page: (ROOT / source).read_text(encoding="utf-8")
        for source, page in PAGES.items()
        if source.endswith(".md")
    }
    texts |= {
        "reference/commands.md": commands_page(),
        "reference/effects.md": effects_page(),
        "reference/messages.md": messages_page(),
    }
    for path in gallery.paths():
        example = gallery.run(path)
        texts[f"gallery/{path.stem}.md"] = example.page()
        texts |= {f"gallery/{name}": picture for name, picture in example.pictures.items()}
    for page, text in texts.items():
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_rest: Any) -> str:
    """Links as the site needs them."""
    name = page.file.src_uri
    source = next((file for file, made in PAGES.items() if made == name), f"docs/{name}")
    parts = _FENCE.split(markdown)
    return "".join(part if part.startswith("```") else relinked(part, source, name) for part in parts)


def relinked(text: str, source: str, page: str) -> str:
    """Relative links of a file of the repository as links of the page that it becomes."""

    def change(found: re.Match[str]) -> str:
        mark, shown, target = found.groups()
        path, _, anchor = target.partition("#")
        if not path or "://" in target or target.startswith("mailto:"):
            return found[0]
        aim = os.path.normpath(Path(source).parent / path)
        made = PAGES.get(aim) or (aim.removeprefix("docs/") if aim.startswith("docs/") else None)
        if made is None or (ROOT / aim).is_dir():
            return f"{shown} (`{aim}`)"
        there = Path(os.path.relpath(made, Path(page).parent)).as_posix()
        return f"{mark}[{shown}]({there}{'#' + anchor if anchor else ''})"

    return _LINK.sub(change, text)


def commands_page() -> str:
    """Every command of both programs, as its --help says."""
    lines = ["# Command line", "", "Made from the programs' own help.", ""]
    for program, module in (("impid-host", "impid_host.cli"), ("impid-sim", "hil_sim.cli")):
        lines += [f"## {program}", ""]
        lines += _command(program, importlib.import_module(module).cli, None, 3)
    return "\n".join(lines) + "\n"


def _command(path: str, command: click.Command, parent: click.Context | None, level: int) -> list[str]:
    context = click.Context(
        command, info_name=path if parent is None else path.rpartition(" ")[2], parent=parent
    )
    context.max_content_width = context.terminal_width = 100
    lines = ["```text", command.get_help(context).rstrip(), "```", ""]
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            part = command.get_command(context, name)
            assert part is not None
            lines += [
                f"{'#' * level} {path} {name}",
                "",
                *_command(f"{path} {name}", part, context, level + 1),
            ]
    return lines


def effects_page() -> str:
    """The catalogue of what diagnose can name."""
    from impid_host.effects.catalogue import CATALOGUE  # noqa: PLC0415

    lines = [
        "# Effects",
        "",
        "What `diagnose` can name. In the pictures: what the first model leaves without the effect",
        "(grey) and with it (blue), drawn against the cause.",
        "",
    ]
    for effect in CATALOGUE.values():
        lines += [f"## {effect.name}", "", f"`{effect.equation}`", ""]
        lines += [f"Acts on: {effect.acts_on}; belongs to: {effect.carries}. Source: {effect.source}.", ""]
        lines += ["| parameter | unit | least possible | most possible |", "| --- | --- | --- | --- |"]
        lines += [f"| {p.name} | {p.unit} | {p.low:g} | {p.high:g} |" for p in effect.parameters]
        for other, trial in effect.tells.items():
            lines += ["", f"Told from {other or 'others'} by: {trial}."]
        picture = f"img/effects/{effect.name}.png"
        if (ROOT / "docs" / picture).exists():
            lines += ["", f"![What {effect.name} leaves]({picture_link(picture)})"]
        lines += [""]
    return "\n".join(lines) + "\n"


def picture_link(picture: str) -> str:
    """A picture of docs/ as a page in reference/ links it."""
    return f"../{picture}"


def messages_page() -> str:
    """Every message of protocol/impid.dbc."""
    messages: Any = cantools.database.load_file(ROOT / "protocol" / "impid.dbc")
    lines = [
        "# Messages",
        "",
        "Made from `protocol/impid.dbc`; [the protocol](../protocol.md) says what they mean.",
        "",
    ]
    for message in sorted(messages.messages, key=lambda each: each.frame_id):
        lines += [f"## {message.name}", "", f"Identifier 0x{message.frame_id:03X}, {message.length} bytes."]
        lines += [f" {message.comment}"] if message.comment else []
        lines += ["", "| signal | start bit | bits | scale | offset | unit | values |", "| --- " * 7 + "|"]
        for signal in message.signals:
            sign = " signed" if signal.is_signed else ""
            values = ", ".join(f"{number} {name}" for number, name in (signal.choices or {}).items())
            numbers = f"{signal.start} | {signal.length}{sign} | {signal.scale:g} | {signal.offset:g}"
            lines += [f"| {signal.name} | {numbers} | {signal.unit or ''} | {values} |"]
        lines += [""]
    return "\n".join(lines) + "\n"
