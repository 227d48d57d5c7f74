"""TOML at the edge: read, validate against a pydantic schema, or say file, key and remedy."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from impid_host.errors import InputError
from impid_host.study.notices import notice

# A setup or mapping is written by hand; anything longer is another kind of file.
MAX_TOML_BYTES = 1 << 20


class Table(BaseModel):
    """A TOML table: types are meant literally ("3" is no number); unknown keys are kept to be reported."""

    model_config = ConfigDict(strict=True, extra="allow", frozen=True, allow_inf_nan=False)


Schema = TypeVar("Schema", bound=Table)


def load_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file.

    Raises:
        InputError: the file is missing, no text, or no TOML.
    """
    try:
        if path.stat().st_size > MAX_TOML_BYTES:
            raise InputError(path, "is too large for a TOML file", "check that this is the right file")
        return tomllib.loads(path.read_bytes().decode("utf-8-sig").replace("\r\n", "\n"))
    except FileNotFoundError:
        raise InputError(path, "does not exist", "create it (docs/study-format.md shows one)") from None
    except OSError as error:
        raise InputError(
            path, f"cannot be read ({error.strerror})", "check the path and its permissions"
        ) from None
    except UnicodeDecodeError:
        raise InputError(path, "is not UTF-8 text", "save it as UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(path, f"is not valid TOML: {error}", "correct that line") from None
    except RecursionError:
        raise InputError(path, "is nested too deeply", "check that this is the right file") from None


def validate(schema: type[Schema], data: object, path: Path, *, prefix: str = "") -> Schema:
    """Check `data` against `schema`; unknown keys are warned about, the first wrong one is an error.

    Raises:
        InputError: names the key, what is wrong with it and what it should be.
    """
    try:
        table = schema.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        key = _dotted(prefix, first["loc"])
        if first["type"] == "missing":
            raise InputError(path, f"key `{key}` is missing", "add it (docs/study-format.md)") from None
        value = repr(first["input"])
        shown = value if len(value) <= 60 else value[:57] + "..."
        what = (
            f"key `{key}` = {shown} does not fit"
            if first["loc"]
            else f"table `{prefix or 'top'}` does not fit"
        )
        raise InputError(path, what, f"{_plain(first['msg'])}") from None
    _warn_unknown(table, path, prefix)
    return table


def _dotted(prefix: str, location: Sequence[int | str]) -> str:
    text = prefix
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else (f".{part}" if text else part)
    return text


def _plain(message: str) -> str:
    message = message.removeprefix("Value error, ").replace("\n", " ")
    return message[0].lower() + message[1:]


def _warn_unknown(table: Table, path: Path, prefix: str) -> None:
    for key in table.model_extra or {}:
        notice(f"{path}: unknown key `{_dotted(prefix, (key,))}` is ignored; check its spelling")
    for name in type(table).model_fields:
        value = getattr(table, name)
        if isinstance(value, Table):
            _warn_unknown(value, path, _dotted(prefix, (name,)))
