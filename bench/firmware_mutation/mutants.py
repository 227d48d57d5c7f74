"""The list of mistakes, and the binaries that have them."""

import shutil
import subprocess
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LISTS = sorted(Path(__file__).parent.glob("mutants*.toml"))
BOARDS = {"nucleo": "nucleo_f446re", "custom": "custom_f446re"}
COPIED = ("platformio.ini", "firmware")


class MutantError(Exception):
    """A mistake cannot be put into the firmware as it is now, or does not build."""


@dataclass(frozen=True)
class Mutant:
    """A row of the lists.

    Attributes:
        what: the mistake, in words.
        file: below firmware.
        old, new: text that stands in the file once, and what takes its place.
        board: "nucleo" or "custom".
        harmless: why no check can notice it; empty where one must.
        of_list: name of the list that has it, without its ending.
    """

    what: str
    file: str
    old: str
    new: str
    board: str = "nucleo"
    harmless: str = ""
    of_list: str = ""


def mutants(named: str = "") -> list[Mutant]:
    """All of the lists whose file's name contains this."""
    lists = {path.stem: tomllib.loads(path.read_text(encoding="utf-8")) for path in LISTS}
    rows = ((stem, row) for stem, content in lists.items() if named in stem for row in content["mutant"])
    return [Mutant(**row, of_list=stem) for stem, row in rows]


class Workshop:
    """A copy of the firmware's sources in a folder, built by PlatformIO as what ships is."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        for name in COPIED:
            source, target = ROOT / name, folder / name
            if source.is_dir():
                shutil.rmtree(target, ignore_errors=True)
                shutil.copytree(source, target)
            else:
                shutil.copy(source, target)
        (folder / "tests" / "firmware").mkdir(parents=True, exist_ok=True)

    def build(self, mutant: Mutant) -> Path:
        """The ELF with the mistake; the sources are as before afterwards.

        Raises:
            MutantError: the text is not there once, or the compiler refuses what becomes of it.
        """
        source = self._folder / "firmware" / mutant.file
        before = source.read_text(encoding="utf-8")
        if before.count(mutant.old) != 1:
            raise MutantError(
                f"{mutant.what}: {mutant.file} has {mutant.old!r} {before.count(mutant.old)} times"
            )
        source.write_text(before.replace(mutant.old, mutant.new), encoding="utf-8")
        try:
            return self._compile(BOARDS[mutant.board])
        finally:
            source.write_text(before, encoding="utf-8")

    def _compile(self, environment: str) -> Path:
        # A mistake may leave something unused: that alone must not keep it from being built.
        config = self._folder / "platformio.ini"
        config.write_text(
            (ROOT / "platformio.ini").read_text(encoding="utf-8").replace("-Werror", "-Wno-unused")
        )
        done = subprocess.run(
            [ROOT / "scripts" / "pio.sh", "run", "--silent", "-d", self._folder.resolve(), "-e", environment],
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise MutantError(f"does not build: {(done.stdout + done.stderr).strip()[-400:]}")
        return self._folder / ".pio" / "build" / environment / "firmware.elf"
