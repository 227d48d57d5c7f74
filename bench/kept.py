"""Answers kept in a file as they come, so that a run may be broken off and taken up.

The file begins with a fingerprint of the code that the answers depend on, and is begun anew when that has changed.
"""

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any


class Kept:
    """The answers of one bench, by name.

    Args:
        path: of the file; its folder is made.
        files: of the code that the answers depend on.
    """

    def __init__(self, path: Path, files: Iterable[Path]) -> None:
        self.answers: dict[str, Any] = {}
        self._path = path
        code = b"".join(file.read_bytes() for file in files)
        first = json.dumps({"fingerprint": hashlib.sha256(code).hexdigest()[:16]})
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        if text.startswith(first + "\n"):
            # A run that was broken off may have left half a line.
            entries = [json.loads(line) for line in text.splitlines()[1:] if line.endswith("}")]
            self.answers = {entry["name"]: entry["answer"] for entry in entries}
            if not text.endswith("\n"):
                self._write("\n", "a")
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._write(first + "\n", "w")

    def put(self, name: str, answer: Any) -> None:
        """One answer more, in the file before this returns."""
        self.answers[name] = answer
        self._write(json.dumps({"name": name, "answer": answer}) + "\n", "a")

    def _write(self, text: str, mode: str) -> None:
        with self._path.open(mode, encoding="utf-8") as file:
            file.write(text)
