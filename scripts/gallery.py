"""Run the examples of docs/gallery/ and make pages of them: text, code, what it printed, its pictures.

    python scripts/gallery.py            # run all, and write the pictures that docs/gallery/index.md shows

An example is a Python file: its docstring is the title and the opening, a line `# %% ...` begins a cell with
a sentence above it. What a cell's last expression shows of itself in Jupyter is shown here too.
"""

import ast
import contextlib
import io
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs" / "gallery"
PICTURES = ROOT / "docs" / "img" / "gallery"
_STYLE: dict[Any, Any] = {
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "figure.constrained_layout.use": True,
    "font.size": 9,
}
_CELL = re.compile(r"^# %% ?", re.MULTILINE)


@dataclass(frozen=True)
class Cell:
    """A piece of an example: a sentence, its code, what it printed and showed, its pictures (PNG)."""

    words: str
    code: str
    printed: str
    shown: str
    pictures: tuple[bytes, ...]


@dataclass(frozen=True)
class Example:
    """An example that was run."""

    name: str
    title: str
    opening: str
    cells: tuple[Cell, ...]

    @property
    def pictures(self) -> dict[str, bytes]:
        """File name -> PNG, in their order."""
        found = [picture for cell in self.cells for picture in cell.pictures]
        return {f"{self.name}_{k}.png": picture for k, picture in enumerate(found, start=1)}

    def page(self) -> str:
        """As Markdown; pictures stand beside it."""
        names = iter(self.pictures)
        lines = [f"# {self.title}", "", self.opening, ""]
        for cell in self.cells:
            lines += [cell.words, "", "```python", cell.code, "```", ""]
            if cell.printed:
                lines += ["```text", cell.printed.rstrip(), "```", ""]
            if cell.shown:
                lines += [cell.shown, ""]
            for _ in cell.pictures:
                lines += [f"![{self.title}]({next(names)})", ""]
        lines += [f"The whole file: `docs/gallery/{self.name}.py`.", ""]
        return "\n".join(lines)


def paths() -> list[Path]:
    """The examples, in the order of their names."""
    return sorted(FOLDER.glob("*.py"))


def title(path: Path) -> str:
    """The first line of an example's docstring."""
    return _docstring(path.read_text(encoding="utf-8")).partition("\n")[0]


def run(path: Path) -> Example:
    """Run an example from the checkout's root; its errors are the caller's."""
    text = path.read_text(encoding="utf-8")
    first, _, opening = _docstring(text).partition("\n")
    body = text.split('"""', 2)[2]
    space: dict[str, Any] = {"__name__": "__main__", "__file__": str(path)}
    before = Path.cwd()
    os.chdir(ROOT)
    try:
        with mpl.rc_context(_STYLE):
            cells = tuple(
                _run_cell(part, space, path, opening=k == 0) for k, part in enumerate(_CELL.split(body))
            )
    finally:
        os.chdir(before)
        plt.close("all")
    return Example(path.stem, first, opening.strip(), cells)


def _docstring(text: str) -> str:
    return ast.get_docstring(ast.parse(text)) or ""


def _run_cell(part: str, space: dict[str, Any], path: Path, *, opening: bool) -> Cell:
    words, code = ("", part) if opening else _sentence(part)
    tree = ast.parse(code)
    last = tree.body[-1] if tree.body else None
    if isinstance(last, ast.Expr):
        tree.body.pop()
    printed = io.StringIO()
    value: Any = None
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, str(path), "exec"), space)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), str(path), "eval"), space)
    shown = value._repr_html_() if hasattr(value, "_repr_html_") else ""
    return Cell(words.strip(), code.strip(), printed.getvalue(), shown, tuple(_figures()))


def _sentence(part: str) -> tuple[str, str]:
    """The words of a cell's first comment, and its code."""
    lines = part.split("\n")
    count = next((k for k, line in enumerate(lines[1:], start=1) if not line.startswith("# ")), len(lines))
    return " ".join(line.removeprefix("# ").strip() for line in lines[:count]), "\n".join(lines[count:])


def _figures() -> list[bytes]:
    """Every open figure as PNG; they are closed."""
    found = []
    for number in plt.get_fignums():
        out = io.BytesIO()
        plt.figure(number).savefig(out, format="png", dpi=110, metadata={"Software": None})
        found.append(out.getvalue())
    plt.close("all")
    return found


def main() -> None:
    """Pictures of the simulated examples for the index; measured data are other people's."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    for path in paths():
        example = run(path)
        print(f"{path.name}: {example.title}", file=sys.stderr)
        if example.pictures and not path.stem.startswith("measured"):
            (PICTURES / f"{path.stem}.png").write_bytes(list(example.pictures.values())[-1])


if __name__ == "__main__":
    main()
