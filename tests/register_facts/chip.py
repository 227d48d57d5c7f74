"""A chip as its public description has it: the metadata of the crate stm32-metapac."""

import json
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

from tests.register_facts.rust_literals import statics

HERE = Path(__file__).resolve().parent


@cache
def crate(name: str) -> Path:
    """The sources of a crate of Cargo.lock; cargo fetches them where they are not there yet."""
    cargo = [
        "cargo",
        "metadata",
        "--locked",
        "--format-version",
        "1",
        "--manifest-path",
        str(HERE / "Cargo.toml"),
    ]
    done = subprocess.run(cargo, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"cargo cannot fetch {name}:\n{done.stderr}")
    (package,) = [p for p in json.loads(done.stdout)["packages"] if p["name"] == name]
    return Path(package["manifest_path"]).parent / "src"


class Chip:
    """One chip of the description, by its part number."""

    def __init__(self, part: str) -> None:
        self._part = part
        self._described: dict[str, Any] | None = None

    def metadata(self) -> str:
        """Its file in the crate, as text: memories, and where the rest is."""
        return (crate("stm32-metapac") / "chips" / self._part / "metadata.rs").read_text()

    def description(self, part: str) -> Any:
        """PERIPHERALS (by name), INTERRUPTS (number by name) or PINS (names) of the chip."""
        if self._described is None:
            named = self.metadata().split('include!("../')[1].split('"')[0]
            self._described = statics((crate("stm32-metapac") / "chips" / named).read_text())
        found = self._described[part]
        if part == "PERIPHERALS":
            return {entry["name"]: entry for entry in found}
        if part == "INTERRUPTS":
            return {entry["name"].upper(): entry["number"] for entry in found}
        return {entry["name"] for entry in found}

    def address(self, peripheral: str) -> int:
        """Where its registers begin."""
        return int(self.description("PERIPHERALS")[peripheral]["address"])

    def _registers(self, peripheral: str) -> tuple[Any, str]:
        kind = self.description("PERIPHERALS")[peripheral]["registers"]
        return _register_file(kind["kind"], kind["version"]), kind["block"]

    def register(self, peripheral: str, path: str) -> tuple[int, str | None]:
        """Offset of a register in bytes, and its field set: `cr1`, `ccr[2]`, `st[5].ndtr`."""
        registers, block = self._registers(peripheral)
        offset = 0
        for part in path.split("."):
            name, index = _split(part)
            item = next(entry for entry in _items(registers, block) if entry["name"] == name)
            offset += item["byte_offset"] + _step(item, index)
            block = item["inner"].get("block", "")
        return offset, item["inner"].get("fieldset")

    def field(self, peripheral: str, path: str, name: str) -> tuple[int, int, dict[str, int]]:
        """Lowest bit, width and named values of a field (`st[0].cr`, `chsel`), or of its first piece."""
        registers, _ = self._registers(peripheral)
        _, fieldset = self.register(peripheral, path)
        assert fieldset is not None, f"{peripheral}.{path} has no fields"
        plain, index = _split(name)
        found = next(entry for entry in _fields(registers, fieldset) if entry["name"] == plain)
        place, width = found["bit_offset"], found["bit_size"]
        if "ranges" in place:
            first = place["ranges"][0]
            offset, width = first.start, len(first)
        else:
            offset = place["offset"]
        values = _named(registers["enums"], found["enumm"])["variants"] if found["enumm"] else []
        return offset + _step(found, index), width, {entry["name"]: entry["value"] for entry in values}

    def bits(self, spelled: str | int) -> int:
        """What PERIPHERAL.register.field=value stands for; a number stands for itself."""
        if isinstance(spelled, int):
            return spelled
        place, _, value = spelled.rpartition("=")
        peripheral, rest = place.split(".", 1)
        path, name = rest.rsplit(".", 1)
        position, width, named = self.field(peripheral, path, name)
        if value == "position":
            return position
        number = (1 << width) - 1 if value == "mask" else int(value) if value.isdigit() else named[value]
        assert number < 1 << width
        return number << position


@cache
def _register_file(kind: str, version: str) -> Any:
    text = (crate("stm32-metapac") / "registers" / f"{kind}_{version}.rs").read_text()
    return statics(text)["REGISTERS"]


def _same(left: str, right: str) -> bool:
    return left.replace("_", "").lower() == right.replace("_", "").lower()


def _named(entries: list[Any], name: str) -> Any:
    (found,) = [entry for entry in entries if _same(entry["name"], name)]
    return found


def _items(registers: Any, block: str) -> list[Any]:
    """Registers of a block and of those that it extends, its own first."""
    found = _named(registers["blocks"], block)
    return found["items"] + (_items(registers, found["extends"]) if found["extends"] else [])


def _fields(registers: Any, fieldset: str) -> list[Any]:
    found = _named(registers["fieldsets"], fieldset)
    return found["fields"] + (_fields(registers, found["extends"]) if found["extends"] else [])


def _step(entry: Any, index: int) -> int:
    """Distance of an array's element from its first."""
    if entry["array"] is None:
        assert index == 0, f"{entry['name']} is no array"
        return 0
    if "offsets" in entry["array"]:
        return int(entry["array"]["offsets"][index])
    assert index < entry["array"]["len"], f"{entry['name']}[{index}]"
    return int(index * entry["array"]["stride"])


def _split(name: str) -> tuple[str, int]:
    plain, _, index = name.partition("[")
    return plain, int(index.rstrip("]") or 0) if index else 0


F446 = Chip("stm32f446re")
G474 = Chip("stm32g474re")
# What the tests of the first board ask.
description, address, register, field = F446.description, F446.address, F446.register, F446.field
