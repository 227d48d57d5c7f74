"""Build the C side once for all tests of the protocol."""

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.protocol.framing_reference import Parse

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = ROOT / "firmware"
INCLUDES = [FIRMWARE / "core", FIRMWARE / "generated", FIRMWARE / "boards" / "native"]


@pytest.fixture(scope="session")
def vectors(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The compiled tests/protocol/vectors.c."""
    program = tmp_path_factory.mktemp("vectors") / "vectors"
    sources = [Path(__file__).with_name("vectors.c"), *(c for folder in INCLUDES for c in folder.glob("*.c"))]
    flags = ["-std=c11", "-O1", "-Wall", "-Wextra", "-Werror", "-fsanitize=address,undefined"]
    flags.append("-fno-sanitize-recover=all")
    subprocess.run(
        ["cc", *flags, *(f"-I{folder}" for folder in INCLUDES), *map(str, sources), "-o", str(program)],
        check=True,
    )
    return program


@pytest.fixture(scope="session")
def c_parse(vectors: Path) -> Parse:
    """What the C parser makes of some bytes: frames, and how many were damaged or foreign."""

    def parse(stream: bytes) -> dict[str, Any]:
        result = subprocess.run([str(vectors), "parse"], input=stream, stdout=subprocess.PIPE, check=True)
        return json.loads(result.stdout)

    return parse
