"""Draw the pictures of docs/tutorial.md and docs/figures.md by running the tutorial's own commands.

    python scripts/docs_figures.py [FOLDER]

The commands run in FOLDER, or in a temporary one. The figures are those that the commands write, made
smaller; they go to docs/img/tutorial/. Only simulated ones: measured data are other people's.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image
from printed_commands import steps

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "docs" / "img" / "tutorial"
VARYING = (
    "impid-sim study arm-stiffens --seed 1 --out stiffens",
    "impid-host fit stiffens --varying time --figures varying_figures",
)
WIDTH = 900
PICTURES = {
    "robot": "figures/robot.png",
    "force_spring_K1_M1": "figures/force_spring_K1_M1.png",
    "parameters_spring_K1_M1": "figures/parameters_spring_K1_M1.png",
    "ellipses_spring_K1_M1": "figures/ellipses_spring_K1_M1.png",
    "diagnosis_stages": "diagnosis/diagnosis_stages.png",
    "bad_robot": "hidden_figures/robot.png",
    "bad_force": "hidden_figures/force_spring_K1_M1.png",
    "bad_parameters": "hidden_figures/parameters_spring_K1_M1.png",
    "found_stages": "found/diagnosis_stages.png",
    "found_residual": "found/diagnosis_residual_tau1.png",
}


def run(folder: Path) -> None:
    """The tutorial's simulated part."""
    for step in steps(ROOT / "docs" / "tutorial.md"):
        if step.kind in ("quick", "slow"):
            for command in step.commands:
                subprocess.run(command, cwd=folder, check=True)
    for line in VARYING:
        subprocess.run(line.split(), cwd=folder, check=True)


def shrink(source: Path, out: Path) -> None:
    """A figure as a page needs it: 900 pixels wide, 64 colours."""
    with Image.open(source) as drawn:
        height = round(drawn.height * WIDTH / drawn.width)
        small = drawn.convert("RGB").resize((WIDTH, height), Image.Resampling.LANCZOS)
    small.quantize(64, dither=Image.Dither.NONE).save(out, optimize=True)


def main(folder: Path) -> None:
    """Run, then copy."""
    folder.mkdir(parents=True, exist_ok=True)
    if not all((folder / figure).exists() for figure in PICTURES.values()):
        run(folder)
    OUT.mkdir(parents=True, exist_ok=True)
    for name, figure in PICTURES.items():
        shrink(folder / figure, OUT / f"{name}.png")
    shrink(folder / "varying_figures" / "varying_arm_virtual.png", OUT.parent / "varying.png")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as temporary:
            main(Path(temporary))
