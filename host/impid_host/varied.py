"""Impedance over time, posture or a column, for Python: frozen, and able to print, tabulate, draw itself."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from impid_host.impedance.varying.fit import VaryingFit
from impid_host.report.varying_report import varying_json, varying_line
from impid_host.results import Fitted, frame

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True)
class Varied:
    """Loads whose K, B and x0 are curves over `by`.

    >>> from impid_host import example_study
    >>> varied = example_study().fit_varying()
    >>> varied.changes  # the example's spring holds still
    {'spring_01': ()}
    >>> varied.to_pandas().columns.tolist()
    ['trial', 'method', 'curve', 'time', 'value', 'low', 'high', 'unit']
    >>> sorted(varied.to_dict()["varying"][0]["curves"])
    ['ks', 'kxx', 'kyy', 'x0', 'y0']
    >>> varied.summary().startswith("spring_01, virtual sensor, with time: K may be constant")
    True
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     [path.name for path in varied.draw(folder)]
    ['varying_spring_01_virtual.png']

    Attributes:
        by: "time", "posture", "since:COLUMN" or a column's name; constant: the ordinary fit;
        result: one for each load and method, and by time for each trial.
    """

    by: str
    constant: Fitted
    result: tuple[VaryingFit, ...]

    @property
    def changes(self) -> dict[str, tuple[str, ...]]:
        """Which of K, B and x0 change, by trial (by load, where trials share curves), first method."""
        out: dict[str, tuple[str, ...]] = {}
        for fit in self.result:
            out.setdefault(fit.trials[0] if self.by == "time" else fit.load, fit.claimed)
        return out

    def summary(self) -> str:
        """A sentence for each load, method and trial."""
        return "\n".join(varying_line(fit) for fit in self.result)

    def to_dict(self) -> dict[str, Any]:
        """What `impid-host fit --varying --json` writes."""
        return self.constant.to_dict() | {"varying": varying_json(self.result)}

    def to_pandas(self) -> "pd.DataFrame":
        """One row for each place of each curve; low and high hold the whole curve with 95 %."""
        return frame(
            (
                {
                    "trial": "+".join(fit.trials),
                    "method": fit.method,
                    "curve": name,
                    self.by: float(fit.places[k]),
                    "value": float(own.value[k]),
                    "low": float(own.low[k]),
                    "high": float(own.high[k]),
                    "unit": own.unit,
                }
                for fit in self.result
                for name, own in fit.curves.items()
                for k in range(len(fit.places))
            ),
            ("trial", "method", "curve", self.by, "value", "low", "high", "unit"),
        )

    def draw(self, folder: str | Path) -> list[Path]:
        """Write a figure (PNG) for each result and return the paths."""
        from impid_host.report.varying_figure import draw_varying  # noqa: PLC0415  (matplotlib is slow to import)

        return draw_varying(self.result, self.constant.result.loads, Path(folder))
