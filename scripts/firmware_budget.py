"""Judge built firmware against its budgets: flash, RAM, worst-case stack, no heap.

Sizes are those of the linked ELF. The worst case of the stack is the deepest path through the calls found
in its disassembly, with the frame sizes that the compiler reported (`-fstack-usage`); library functions,
which have no report, are read off their own instructions. A call through a pointer may reach every function
whose address is stored anywhere outside the vector table. Interrupts nest once per priority, as the NVIC
lets them.
"""

import re
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BOARDS = ROOT / "firmware" / "boards"
BOTH = BOARDS / "stm32"  # what both chips have
# The port of every board that is none of the first chip.
PORTS = {"nucleo_g474re": "stm32g474"}
FLASH_BYTES = 32 * 1024
RAM_BYTES = 16 * 1024
FLASH_SECTIONS = (".text", ".data")
RAM_SECTIONS = (".stack", ".data", ".bss", ".noinit")
HEAP = {"malloc", "free", "calloc", "realloc", "_malloc_r", "_free_r", "_sbrk", "_sbrk_r"}
# Pushed by hardware on entry: eight words, and one more where the stack was not aligned to 8 bytes.
EXCEPTION_FRAME = 36


class BudgetError(Exception):
    """The firmware cannot be judged, or breaks a rule."""


@dataclass
class Function:
    """One function of the ELF: its own frame in bytes and whom it calls."""

    name: str
    frame: int
    calls: set[str] = field(default_factory=set)
    indirect: bool = False


def tool(program: str, *arguments: str) -> str:
    return subprocess.run(
        [f"arm-none-eabi-{program}", *arguments], check=True, capture_output=True, text=True
    ).stdout


def section_sizes(elf: Path) -> dict[str, int]:
    rows = (line.split() for line in tool("size", "-A", "-d", str(elf)).splitlines())
    return {row[0]: int(row[1]) for row in rows if len(row) == 3 and row[1].isdigit()}


def symbols(elf: Path) -> dict[str, int]:
    rows = (line.split() for line in tool("nm", str(elf)).splitlines())
    return {row[2]: int(row[0], 16) for row in rows if len(row) == 3}


def reported_frames(build: Path) -> dict[str, int]:
    """Frame by function from the compiler's .su files; a frame of unknown size is an error."""
    frames: dict[str, int] = {}
    for report in build.rglob("*.su"):
        for line in report.read_text().splitlines():
            place, size, kind = line.split("\t")
            name = place.rsplit(":", 1)[1]
            if "dynamic" in kind and "bounded" not in kind:
                raise BudgetError(f"{name}: frame of unknown size ({kind})")
            frames[name] = max(frames.get(name, 0), int(size))
    if not frames:
        raise BudgetError(f"{build}: no .su files; is -fstack-usage among the board's flags?")
    return frames


def frame_by_instructions(lines: Iterable[str]) -> int:
    """Upper bound of a library function's frame: everything it ever pushes or subtracts."""
    frame = 0
    for line in lines:
        if pushed := re.search(r"\t(?:push|stmdb\s+sp!,|vpush)(?:\.w)?\s*.*\{(.*)\}", line):
            frame += 4 * sum(_registers(part) for part in pushed[1].split(","))
        elif single := re.search(r"\tstr(?:\.w)?\s+\w+, \[sp, #-(\d+)\]!", line):
            frame += int(single[1])
        elif lowered := re.search(r"\tsub(?:w|\.w)?\s+sp,(?: sp,)? #(\d+)", line):
            frame += int(lowered[1])
    return frame


def _registers(part: str) -> int:
    ends = re.findall(r"\d+", part)
    return int(ends[1]) - int(ends[0]) + 1 if "-" in part else 1


def functions(elf: Path, frames: dict[str, int]) -> dict[str, Function]:
    """Every function in the disassembly with its callees; a branch to another's start is a call too."""
    bodies: dict[str, list[str]] = {}
    name = ""
    for line in tool("objdump", "-d", "--no-show-raw-insn", str(elf)).splitlines():
        if head := re.match(r"[0-9a-f]+ <(.+)>:$", line):
            name = head[1]
            bodies[name] = []
        elif name:
            bodies[name].append(line)
    found: dict[str, Function] = {}
    for name, body in bodies.items():
        plain = name.split(".", 1)[0]  # clones: name.part.0, name.constprop.0
        frame = frames.get(name, frames.get(plain))
        function = Function(name, frame_by_instructions(body) if frame is None else frame)
        for line in body:
            if target := re.search(r"\tb\w*(?:\.[nw])?\s+[0-9a-f]+ <([^+>]+)>", line):
                function.calls.add(target[1])
            elif re.search(r"\tblx\s+r\d+", line) or re.search(r"\tbx\s+(?!lr)\w+", line):
                function.indirect = True
        function.calls.discard(name)
        found[name] = function
    return found


def addresses_taken(elf: Path, names: Iterable[str], port: Path) -> set[str]:
    """Functions whose address stands as a word in the program outside the vector table."""
    at = symbols(elf)
    interrupts = re.search(r"IRQ_COUNT = (\d+)", (port / "irq.h").read_text())
    if interrupts is None:
        raise BudgetError(f"{port / 'irq.h'}: no IRQ_COUNT")
    start, vectors_bytes = at["vectors"], 4 * (16 + int(interrupts[1]))
    by_address = {at[name] | 1: name for name in names if name in at}
    words: list[int] = []
    for line in tool("objdump", "-s", "-j", ".text", str(elf)).splitlines():
        if row := re.match(r" ([0-9a-f]{7,8}) ((?:[0-9a-f]{8} ?){1,4})", line):
            base = int(row[1], 16)
            words += [
                int.from_bytes(bytes.fromhex(group), "little")
                for i, group in enumerate(row[2].split())
                if base + 4 * i >= start + vectors_bytes
            ]
    return {by_address[word] for word in words if word in by_address}


def deepest(graph: dict[str, Function], taken: set[str], root: str) -> tuple[int, list[str]]:
    """Bytes of stack that `root` can need, and the path; recursion is an error."""
    known: dict[str, tuple[int, list[str]]] = {}

    def visit(name: str, above: tuple[str, ...]) -> tuple[int, list[str]]:
        if name in above:
            raise BudgetError(f"recursion: {' -> '.join([*above[above.index(name) :], name])}")
        if name not in known:
            function = graph[name]
            callees = (function.calls | (taken if function.indirect else set())) & graph.keys()
            below = max((visit(callee, (*above, name)) for callee in sorted(callees)), default=(0, []))
            known[name] = (function.frame + below[0], [name, *below[1]])
        return known[name]

    return visit(root, ())


def interrupt_priorities(port: Path) -> dict[int, list[str]]:
    """Handlers by priority, as the port's sources enable and name them."""
    text = "".join(path.read_text() for folder in (BOTH, port) for path in sorted(folder.glob("*.[ch]")))
    handlers = dict(re.findall(r"\[(IRQ_\w+)\] = (\w+)", text))
    numbers = {name: int(value) for name, value in re.findall(r"(PRIORITY_\w+) = (\d)", text)}
    levels: dict[int, list[str]] = {}
    for irq, priority in re.findall(r"interrupt_enable\((IRQ_\w+), (PRIORITY_\w+)\)", text):
        levels.setdefault(numbers[priority], []).append(handlers[irq])
    return levels


def stack_rows(elf: Path, port: Path = BOARDS / "stm32f446") -> list[tuple[str, int, list[str]]]:
    """What can be on the stack at once: (who, bytes, deepest path)."""
    graph = functions(elf, reported_frames(elf.parent))
    taken = addresses_taken(elf, graph, port) - {"reset_handler"}
    rows = [("main loop", *deepest(graph, taken, "reset_handler"))]
    for level, handlers in sorted(interrupt_priorities(port).items(), reverse=True):
        need, path = max(deepest(graph, taken, handler) for handler in handlers)
        rows.append((f"priority {level}", need + EXCEPTION_FRAME, path))
    need, path = deepest(graph, taken, "nmi_handler")
    rows.append(("clock lost", need + EXCEPTION_FRAME, path))
    rows.append(("fault", EXCEPTION_FRAME, ["fault_handler"]))  # continues on a stack of its own
    return rows


def judge(board: str) -> tuple[bool, list[str]]:
    """Whether one board is within all budgets, and its account in lines."""
    elf = ROOT / ".pio" / "build" / board / "firmware.elf"
    if not elf.is_file():
        raise BudgetError(f"{elf.relative_to(ROOT)} is missing; run scripts/firmware_build.sh")
    sizes = section_sizes(elf)
    table = symbols(elf)
    rows = stack_rows(elf, BOARDS / PORTS.get(board, "stm32f446"))
    accounts = [
        ("flash", sum(sizes.get(name, 0) for name in FLASH_SECTIONS), FLASH_BYTES),
        ("RAM", sum(sizes.get(name, 0) for name in RAM_SECTIONS), RAM_BYTES),
        ("stack", sum(need for _, need, _ in rows), table["linker_stack_size"]),
    ]
    heap = sorted(HEAP & table.keys())
    lines = [board]
    for what, used, budget in accounts:
        verdict = "" if used <= budget else "  OVER BUDGET"
        lines.append(f"  {what:6} {used:6d} of {budget:6d} bytes ({100 * used / budget:3.0f} %){verdict}")
    for who, need, path in rows:
        lines.append(f"    {who:11} {need:5d}  {' > '.join(path[:8])}{' > ...' if len(path) > 8 else ''}")
    lines.append(f"  heap   {'none' if not heap else 'USED: ' + ', '.join(heap)}")
    return not heap and all(used <= budget for _, used, budget in accounts), lines


def main(boards: list[str]) -> int:
    verdicts = []
    try:
        for board in boards:
            within, lines = judge(board)
            verdicts.append(within)
            sys.stdout.write("\n".join(lines) + "\n")
    except BudgetError as error:
        sys.stderr.write(f"firmware_budget: {error}\n")
        return 1
    return 0 if all(verdicts) else 1


if __name__ == "__main__":
    sys.exit(
        main(sys.argv[1:] or ["nucleo_f446re", "custom_f446re", "nucleo_f446re_adxl355", "nucleo_g474re"])
    )
