"""Measure a human arm's mechanical impedance without a force sensor: read a study, check it, fit it,
diagnose it.

    >>> import impid_host as impid
    >>> study = impid.example_study()          # or impid.Study.load("study/")
    >>> study.check().trusted
    True
    >>> fitted = study.fit()
    >>> round(fitted.loads["spring"]["method1"]["M"]["value"][0][0], 2)   # kg; the truth is 0.8
    0.8
    >>> force = fitted.force("spring_01")      # a DataFrame, N against s
    >>> study.diagnose().effects               # what the model lacks: nothing
    []

What stands in `__all__` is public; the rest may change. Everything is loaded when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from impid_host.checks import Checks
    from impid_host.errors import ImpidError, InputError, UndeterminedError
    from impid_host.front import Study, check, diagnose, example_study, fit, read_study
    from impid_host.results import Diagnosed, Fitted

    __version__: str

__all__ = [
    "Checks",
    "Diagnosed",
    "Fitted",
    "ImpidError",
    "InputError",
    "Study",
    "UndeterminedError",
    "__version__",
    "check",
    "diagnose",
    "example_study",
    "fit",
    "read_study",
]
_FROM = {
    "Checks": "impid_host.checks",
    "Diagnosed": "impid_host.results",
    "Fitted": "impid_host.results",
    "ImpidError": "impid_host.errors",
    "InputError": "impid_host.errors",
    "UndeterminedError": "impid_host.errors",
}


def __getattr__(name: str) -> Any:
    """Import a public name when it is first asked for."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; there are {', '.join(__all__)}")
    if name == "__version__":
        return import_module("importlib.metadata").version("impid")
    return getattr(import_module(_FROM.get(name, "impid_host.front")), name)


def __dir__() -> list[str]:
    return sorted(__all__)
