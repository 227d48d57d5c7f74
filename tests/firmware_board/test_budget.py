"""The budget script itself, against programs whose stack and calls are known by construction."""

import shutil
import subprocess
from pathlib import Path
from types import ModuleType

import pytest

CPU = ["-mcpu=cortex-m4", "-mthumb", "-std=c11", "-Os", "-fstack-usage", "-ffreestanding", "-nostdlib"]


def build(folder: Path, source: str) -> Path:
    assert shutil.which("arm-none-eabi-gcc"), "arm-none-eabi-gcc is missing; see scripts/system_packages.sh"
    (folder / "a.c").write_text(source)
    elf = folder / "program.elf"
    subprocess.run(
        ["arm-none-eabi-gcc", *CPU, "-c", "a.c", "-o", "a.o"], cwd=folder, check=True, capture_output=True
    )
    subprocess.run(
        ["arm-none-eabi-gcc", *CPU, "a.o", "-Wl,-Ttext=0x8000000,-e,root,--no-warnings", "-o", str(elf)],
        cwd=folder, check=True, capture_output=True,
    )  # fmt: skip
    return elf


VECTORS = 'const unsigned vectors[113] __attribute__((section(".text"))) = {1};\n'
NOINLINE = "__attribute__((noinline, noclone, used)) "
USE = "extern void *volatile sink; void *volatile sink;\n"


def test_the_deepest_of_two_paths_is_found(budget: ModuleType, tmp_path: Path) -> None:
    elf = build(
        tmp_path,
        VECTORS + USE
        + NOINLINE + "void small(void) { char a[16]; sink = a; sink = 0; }\n"
        + NOINLINE + "void large(void) { char a[400]; sink = a; sink = 0; }\n"
        + NOINLINE + "void middle(int n) { char a[100]; sink = a; if (n) large(); else small(); sink = 0; }\n"
        + NOINLINE + "void root(int n) { middle(n); sink = 0; }\n",
    )  # fmt: skip
    graph = budget.functions(elf, budget.reported_frames(tmp_path))
    need, path = budget.deepest(graph, set(), "root")
    assert path == ["root", "middle", "large"]
    # The arrays, and at each of three levels a few saved registers and padding.
    assert 400 + 100 <= need <= 400 + 100 + 3 * 24


def test_a_tail_call_and_a_call_through_a_pointer_are_followed(budget: ModuleType, tmp_path: Path) -> None:
    elf = build(
        tmp_path,
        VECTORS + USE
        + NOINLINE + "void hidden(void) { char a[256]; sink = a; sink = 0; }\n"
        + "void (*const table[2])(void) = {hidden, hidden};\n"
        + NOINLINE + "void jump(int n) { table[n](); }\n"
        + NOINLINE + "void root(int n) { jump(n + 1); }\n",
    )  # fmt: skip
    graph = budget.functions(elf, budget.reported_frames(tmp_path))
    assert graph["jump"].indirect
    assert "jump" in graph["root"].calls
    need, path = budget.deepest(graph, {"hidden"}, "root")
    assert path == ["root", "jump", "hidden"]
    assert 256 <= need <= 256 + 48


def test_recursion_is_refused(budget: ModuleType, tmp_path: Path) -> None:
    elf = build(
        tmp_path,
        VECTORS + USE
        + NOINLINE + "int other(int n);\n"
        + NOINLINE + "int root(int n) { sink = &n; return other(n - 1) + 1; }\n"
        + "int other(int n) { sink = &n; return n > 0 ? root(n) + 2 : 0; }\n",
    )  # fmt: skip
    graph = budget.functions(elf, budget.reported_frames(tmp_path))
    with pytest.raises(budget.BudgetError, match=r"recursion: .*root"):
        budget.deepest(graph, set(), "root")


def test_a_frame_of_unknown_size_is_refused(budget: ModuleType, tmp_path: Path) -> None:
    build(tmp_path, VECTORS + USE + "void root(int n) { char a[n]; sink = a; }\n")
    with pytest.raises(budget.BudgetError, match=r"root: frame of unknown size"):
        budget.reported_frames(tmp_path)


def test_instructions_give_the_frame_where_no_report_does(budget: ModuleType) -> None:
    body = ["\tpush\t{r4, r5, r6, lr}", "\tsub\tsp, #24", "\tadd\tsp, #24", "\tpop\t{r4, r5, r6, pc}"]
    assert budget.frame_by_instructions(body) == 16 + 24
    wide = ["\tstmdb\tsp!, {r4-r11, lr}", "\tsub.w\tsp, sp, #512", "\tstr.w\tr0, [sp, #-8]!"]
    assert budget.frame_by_instructions(wide) == 36 + 512 + 8
