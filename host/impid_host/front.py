"""The front door of impid for Python: a study in, a frozen result out, to print, write and tabulate.

    >>> import impid_host as impid
    >>> study = impid.example_study()
    >>> fitted = study.fit()
    >>> K = fitted.loads["spring"]["method1"]["K"]
    >>> [round(value) for value in K["value"][0]], K["unit"]
    ([420, -20], 'N/m')

SI units throughout; forces are those of the load on the robot, in the robot's base frame.
"""

import html
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from impid_host.checks import Checks, check_study
from impid_host.checks.of_diagnosis import beside_diagnosis
from impid_host.diagnosis.diagnose import diagnose as _diagnose
from impid_host.example import example_parts
from impid_host.impedance.campaign import Options, default_chain
from impid_host.impedance.estimators.estimated import EstimatorWish
from impid_host.impedance.rows import Split
from impid_host.impedance.varying.campaign import vary_study
from impid_host.impedance.varying.schedule import Schedule
from impid_host.report.page.findings import fitted, gather
from impid_host.report.sessions_json import sessions_json
from impid_host.results import Diagnosed, Fitted, frame
from impid_host.study.folder import read_study as _read_study
from impid_host.study.model import Study as _Study
from impid_host.varied import Varied

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True)
class Study(_Study):
    """A measurement campaign: `setup` (the apparatus) and `trials` (raw samples and torque logs).

    `Study.load` reads a study folder (docs/study-format.md); the methods answer what the commands of the same
    names answer.

    >>> study = example_study()
    >>> len(study.of_kind("free")), study.session_of(study.trials[2]).side
    (2, 'right')
    >>> [trial.name for trial in study.trials]
    ['free_01', 'free_02', 'spring_01']
    >>> study.trials[0].robot.tau.shape  # N m, one column for each joint
    (10000, 2)
    """

    @classmethod
    def load(cls, path: str | Path, *, columns: tuple[str, ...] = ()) -> "Study":
        """Read a study folder; `columns` names other columns of robot.csv to be kept, for `fit_varying`.

        >>> Study.load("no/such/study")
        Traceback (most recent call last):
        ...
        impid_host.errors.InputError: no/such/study: does not exist; give the path of a study folder, which \
holds setup.toml

        Raises:
            InputError: the folder or a file of it cannot be read; names file, row or key, and the remedy.
        """
        return of_model(_read_study(Path(path), columns))

    def check(self) -> Checks:
        """What the study says about its own input: mistakes of the setup, contradictions.

        >>> len(example_study().check())
        0
        """
        return check_study(self)

    def fit(
        self,
        *,
        with_terms: tuple[str, ...] = (),
        validate_s: float = 10.0,
        estimator: EstimatorWish = "least-squares",
    ) -> Fitted:
        """Identify the robot, then every load, with 95 % intervals ([D] Sec. III).

        >>> fitted = example_study().fit(with_terms=("friction.coulomb",))
        >>> fitted.robot["Fc1"]["unit"]
        'N*m'

        Args:
            with_terms: optional terms of the robot model by name, as `fit --with`.
            validate_s: seconds at the end of each trial that are held out (a fifth of it at most).
            estimator: "least-squares", "instruments", "output-error" or "auto" (docs/estimators.md).

        Raises:
            UndeterminedError: the data do not determine what was asked, or the estimator cannot be had.
        """
        chain = default_chain(self)
        options = Options(chain=chain, terms=with_terms, split=Split(validate_s), estimator=estimator)
        first = fitted(self, options, check_study(self))
        return Fitted(self, first.fit, first.checks, first.agreement, chain, first.pushes)

    def fit_varying(self, by: str = "time", *, with_terms: tuple[str, ...] = ()) -> Varied:
        """Fit, then every load's K, B and x0 as curves with simultaneous 95 % bands (docs/varying.md).

        >>> print(example_study().fit_varying().summary())  # doctest: +ELLIPSIS
        spring_01, virtual sensor, with time: K may be constant (p ...); x0 may be constant (p ...). VAF ...

        Args:
            by: "time" (each trial by itself), "posture", "since:COLUMN" (seconds since a column's last
                rise) or a column of robot.csv, which `Study.load(path, columns=...)` must have kept.
            with_terms: as `fit`.

        Raises:
            UndeterminedError: the data do not determine what was asked.
            InputError: there is no such column.
        """
        constant = self.fit(with_terms=with_terms)
        return Varied(by, constant, vary_study(self, constant.result, constant.chain, Schedule(by)))

    def diagnose(self, *, cutoff_hz: float | None = None) -> Diagnosed:
        """Find what the first model lacks, add it, judge it on data that took no part. Takes a minute or so.

        >>> example_study().diagnose().effects
        []

        Args:
            cutoff_hz: of the band in which errors are told; None: by the motion, as `fit`.

        Raises:
            UndeterminedError: the data do not determine the robot or a load.
        """
        answer = _diagnose(self, cutoff_hz=cutoff_hz)
        return Diagnosed(self, answer, beside_diagnosis(self, answer, check_study(self)))

    def force(self, trial: str) -> "pd.DataFrame":
        """Force of the load on the robot along one trial: `Fitted.force` of a fit made anew.

        >>> force = example_study().force("spring_01")  # N in the base frame, against s
        >>> force.index.name, force.columns.tolist()
        ('t', ['Fx', 'Fx_sd', 'Fy', 'Fy_sd'])
        """
        return self.fit().force(trial)

    def report(self, out: str | Path, *, diagnosed: bool = True, figures: str | Path | None = None) -> Path:
        """Write the report, one HTML page (docs/report.md), and return its path.

        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     page = example_study().report(Path(folder) / "report.html", diagnosed=False)
        ...     page.read_text(encoding="utf-8")[:15]
        '<!doctype html>'

        Args:
            diagnosed: look for what the first model lacks.
            figures: also write the page's figures as PDF and SVG to this folder.
        """
        from impid_host.report.page.write import figures as plots_of  # noqa: PLC0415  (jinja2 is slow to import)
        from impid_host.report.page.write import write_page  # noqa: PLC0415

        found = gather(self, diagnosed=diagnosed)
        place = Path(out)
        place.write_text(write_page([found], [f"Study.report({str(out)!r})"]), encoding="utf-8")
        if figures is not None:
            from impid_host.report.page.journal import draw  # noqa: PLC0415  (matplotlib is slow to import)

            draw(plots_of(found), Path(figures))
        return place

    def to_pandas(self) -> "pd.DataFrame":
        """One row per trial: name, kind, load, seconds, rows, samples, subject, side, date, posture.

        >>> example_study().to_pandas().loc[2, ["trial", "kind", "load"]].tolist()
        ['spring_01', 'mass-spring', 'spring']
        """
        return frame(
            {
                "trial": trial.name,
                "kind": trial.kind,
                "load": trial.load,
                "seconds": float(trial.robot.t[-1] - trial.robot.t[0]),
                "rows": len(trial.robot),
                "samples": 0 if trial.device is None else len(trial.device),
                **sessions_json(self)["sessions"][trial.name],
            }
            for trial in self.trials
        )

    def _repr_html_(self) -> str:
        from impid_host.report.page.quality import quality_table  # noqa: PLC0415
        from impid_host.report.page.tables import of_terminal  # noqa: PLC0415
        from impid_host.report.page.write import tables_html  # noqa: PLC0415

        head = f"<p><strong>{html.escape(self.name)}</strong>: {html.escape(self.setup.robot.model)}</p>"
        return head + tables_html([of_terminal(quality_table(self, None))])


def of_model(study: _Study) -> Study:
    """The same study with the methods of the front door."""
    if isinstance(study, Study):
        return study
    return Study(study.name, study.setup, study.trials, study.source)


def example_study() -> Study:
    """A small study in memory, made by a formula: a planar robot, free, and with 0.8 kg on a known spring.

    >>> example_study().name
    'example'
    """
    return Study("example", *example_parts())


def read_study(path: str | Path) -> Study:
    """`Study.load`: read a study folder (docs/study-format.md).

    >>> import tempfile
    >>> from impid_host.study.folder import write_study
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     read_study(write_study(example_study(), Path(folder) / "example")).name
    'example'

    Raises:
        InputError: the folder or a file of it cannot be read; names file, row or key, and the remedy.
    """
    return Study.load(path)


def check(study: _Study | str | Path) -> Checks:
    """`Study.check` of a study or of the folder at a path.

    >>> check(example_study()).trusted
    True

    Raises:
        InputError: as `read_study`.
    """
    return _study(study).check()


def fit(
    study: _Study | str | Path,
    *,
    with_terms: tuple[str, ...] = (),
    validate_s: float = 10.0,
    estimator: EstimatorWish = "least-squares",
) -> Fitted:
    """`Study.fit` of a study or of the folder at a path.

    >>> fit(example_study(), validate_s=4.0).trusted
    True

    Raises:
        InputError: as `read_study`.
        UndeterminedError: the data do not determine what was asked.
    """
    return _study(study).fit(with_terms=with_terms, validate_s=validate_s, estimator=estimator)


def diagnose(study: _Study | str | Path, *, cutoff_hz: float | None = None) -> Diagnosed:
    """`Study.diagnose` of a study or of the folder at a path.

    >>> diagnose(example_study()).verdict.startswith("nothing is missing")
    True

    Raises:
        InputError: as `read_study`.
        UndeterminedError: the data do not determine the robot or a load.
    """
    return _study(study).diagnose(cutoff_hz=cutoff_hz)


def _study(study: _Study | str | Path) -> Study:
    return of_model(study) if isinstance(study, _Study) else read_study(study)
