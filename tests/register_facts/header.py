"""What the firmware's headers say, asked of the compiler: every macro and every member of registers.h."""

import re
import subprocess
import tempfile
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PORT = ROOT / "firmware" / "boards" / "stm32f446"
TEXT = (PORT / "registers.h").read_text(encoding="utf-8")
# Macros that stand for registers: name, type of what is there.
BLOCKS = dict(re.findall(r"^#define (\w+)\s+\(\((?:const )?(?:volatile )?(\w+) \*\)0x", TEXT, re.MULTILINE))
MACROS = {
    name: bool(arguments) for name, arguments in re.findall(r"^#define (\w+)(\(\w+\))?[ \t]+\S", TEXT, re.M)
}


def members(type_name: str) -> list[str]:
    """Members of a register struct that are registers, arrays as `S[1]`: their second element."""
    found = re.search(r"typedef struct \{((?:(?!typedef).)*?)\} " + type_name + ";", TEXT, re.DOTALL)
    if found is None:
        return []
    body = re.sub(r"struct \{.*?\} (\w+\[\d+\])", r"inner \1", found[1], flags=re.DOTALL)
    names = [name.strip() for line in re.findall(r"\w+ ([^;]+);", body) for name in line.split(",")]
    return [re.sub(r"\[\d+\]", "[1]", name) for name in names if not name.startswith("reserved")]


@cache
def values() -> dict[str, int]:
    """Every macro's value (with an argument: for 0 and 1) and member's offset, as the compiler sees them."""
    lines = []
    for name, has_argument in MACROS.items():
        for argument in (0, 1) if has_argument else ("",):
            call = f"{name}({argument})" if has_argument else name
            lines.append(f'say("{call}", (unsigned long long)(uintptr_t)({call}));')
    for type_name in re.findall(r"^\} (\w+);", TEXT, re.MULTILINE):
        lines += [f'say("{type_name}.{name}", offsetof({type_name}, {name}));' for name in members(type_name)]
    source = f"""
        #include "registers.h"
        #include <stddef.h>
        #include <stdio.h>
        static void say(const char *name, unsigned long long value) {{ printf("%s %llu\\n", name, value); }}
        int main(void) {{ {" ".join(lines)} return 0; }}"""
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "ask"
        command = ["cc", "-std=c11", "-w", f"-I{PORT}", "-xc", "-", "-o", str(program)]
        subprocess.run(command, input=source, text=True, check=True)
        told = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    return {name: int(value) for name, value in (line.rsplit(" ", 1) for line in told.splitlines())}
