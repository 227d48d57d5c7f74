"""What the firmware's headers say, asked of the compiler: every macro and every member of registers.h."""

import re
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BOARDS = ROOT / "firmware" / "boards"
BOTH = BOARDS / "stm32"  # what both chips have


class Header:
    """registers.h of a port, and the port's sources."""

    def __init__(self, port: str) -> None:
        self.port = BOARDS / port
        self.text = (self.port / "registers.h").read_text(encoding="utf-8")
        # Macros that stand for registers: name, type of what is there.
        self.blocks = dict(
            re.findall(r"^#define (\w+)\s+\(\((?:const )?(?:volatile )?(\w+) \*\)0x", self.text, re.MULTILINE)
        )
        self._macros = {
            name: bool(arguments)
            for name, arguments in re.findall(r"^#define (\w+)(\(\w+\))?[ \t]+\S", self.text, re.M)
        }
        self._values: dict[str, int] | None = None

    def sources(self) -> dict[str, str]:
        """Every source that is built for the port, by its name."""
        paths = [*BOTH.glob("*.[ch]"), *self.port.glob("*.[ch]")]
        return {path.name: path.read_text(encoding="utf-8") for path in paths}

    def members(self, type_name: str) -> list[str]:
        """Members of a register struct that are registers, arrays as `S[1]`: their second element."""
        found = re.search(r"typedef struct \{((?:(?!typedef).)*?)\} " + type_name + ";", self.text, re.DOTALL)
        if found is None:
            return []
        body = re.sub(r"struct \{.*?\} (\w+\[\d+\])", r"inner \1", found[1], flags=re.DOTALL)
        names = [name.strip() for line in re.findall(r"\w+ ([^;]+);", body) for name in line.split(",")]
        return [re.sub(r"\[\d+\]", "[1]", name) for name in names if not name.startswith("reserved")]

    def values(self) -> dict[str, int]:
        """Value of every macro (with an argument: for 0 and 1), offset of every member: the compiler's."""
        if self._values is None:
            self._values = self._ask()
        return self._values

    def _ask(self) -> dict[str, int]:
        lines = []
        for name, has_argument in self._macros.items():
            for argument in (0, 1) if has_argument else ("",):
                call = f"{name}({argument})" if has_argument else name
                lines.append(f'say("{call}", (unsigned long long)(uintptr_t)({call}));')
        for kind in re.findall(r"^\} (\w+);", self.text, re.MULTILINE):
            lines += [f'say("{kind}.{name}", offsetof({kind}, {name}));' for name in self.members(kind)]
        source = f"""
            #include "registers.h"
            #include <stddef.h>
            #include <stdio.h>
            static void say(const char *name, unsigned long long v) {{ printf("%s %llu\\n", name, v); }}
            int main(void) {{ {" ".join(lines)} return 0; }}"""
        with tempfile.TemporaryDirectory() as folder:
            program = Path(folder) / "ask"
            command = ["cc", "-std=c11", "-w", f"-I{self.port}", "-xc", "-", "-o", str(program)]
            subprocess.run(command, input=source, text=True, check=True)
            told = subprocess.run([program], capture_output=True, text=True, check=True).stdout
        return {name: int(value) for name, value in (line.rsplit(" ", 1) for line in told.splitlines())}


F446, G474 = Header("stm32f446"), Header("stm32g474")
# What the tests of the first board ask.
PORT, TEXT, BLOCKS = F446.port, F446.text, F446.blocks
members, values = F446.members, F446.values
