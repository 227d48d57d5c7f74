"""The measured records of other laboratories as studies: which files, which mapping, what is published of them.

Data are found where IMPID_DATA points or beside the checkout (docs/data.md says where they come from). Nothing here
changes a measured number; records of one machine share a `machine`, so that a model of one may be judged on another.
"""

import os
from dataclasses import dataclass, replace
from pathlib import Path

from impid_host.study.importing import import_logs
from impid_host.study.model import Study

CHECKOUT = Path(__file__).resolve().parents[2]
MAPPINGS = CHECKOUT / "docs" / "mappings"


@dataclass(frozen=True, slots=True)
class Record:
    """One study to be diagnosed.

    Attributes:
        key: its name on the page; machine: what other records share with it; folder, files, mapping: where it is.
        trial: the one trial of the mapping that is kept; None for all.
        published: what its authors chose by hand, and what error that gave, in words.
    """

    key: str
    machine: str
    folder: str
    files: tuple[str, ...]
    mapping: str
    trial: str | None = None
    published: str = "nothing published"

    def study(self, data: Path) -> Study:
        """As `impid-host import` makes it."""
        logs = [data / self.folder / f"{name}.parquet" for name in self.files]
        study = import_logs(logs, MAPPINGS / f"{self.mapping}.toml", self.key)
        if self.trial is None:
            return study
        return replace(study, trials=tuple(t for t in study.trials if t.name == self.trial))


_EMPS = (
    "Janot, Gautier, Brunot 2019, 100 Hz, fitted and judged on this record: 4.08 % with dry friction and offset, "
    "3.11 % with friction unequal in the two directions"
)
_DFKI = "inertia, gravity, viscous friction of 0.001 N m s, dry friction as an arctangent; no error published"
_ANKLE = "inertia, viscosity, elasticity and a late reflex (40 to 50 ms, one direction); no error published"
_UR10E = "viscous and dry friction and an offset per joint, drive gains; no error published"
_LWR4 = (
    "viscous and dry friction beside the URDF: 0.36, 1.55, 0.49, 0.98, 0.63, 0.49, 0.27 N m left on joints 1 to 7 of "
    "measurements_1"
)
_PANDA = "a logistic curve of speed as friction; no error published with the record"
_TX40 = (
    "viscous and dry friction per joint, rotor inertias, a coupled wrist; no error published with the record"
)
_PENDUBOT = "their commit says that the identified model does not predict well; no error published"
_LEG = "static force -J^-T tau beside the sensor, in a plot"


def _pendulum(key: str, design: str, *files: str) -> Record:
    mapping = "dfki_double_pendulum" if design == "A0" else "dfki_double_pendulum_c"
    return Record(key, f"pendulum_{design}", "dfki_double_pendulum", files, mapping, published=_DFKI)


def _ankle(key: str, trial: str) -> Record:
    return Record(
        key, "ankle", "ankle_impedance", ("z_df", "z_pf", "z_df2"), "ankle_impedance", trial, _ANKLE
    )


def _pendubot(key: str, *files: str) -> Record:
    return Record(
        key, "pendubot", "pendubot_torque_sensor", files, "pendubot_torque_sensor", published=_PENDUBOT
    )


RECORDS: tuple[Record, ...] = (
    Record("emps", "emps", "emps", ("bangbang",), "emps", published=_EMPS),
    *(
        Record(
            f"ur10e_joint{joint}",
            f"ur10e_joint{joint}",
            "ur10e",
            tuple(f"single_joint_{other}" for other in (1, 3, 4, 6)),
            "ur10e_single_joint",
            f"joint{joint}_01",
            _UR10E,
        )
        for joint in (1, 3, 4, 6)
    ),
    _pendulum("pendulum_exciting", "A0", "A0_exciting_061157"),
    _pendulum("pendulum_sysid", "A0", *(f"A0_sysid_0{k}" for k in (0, 1, 2, 3, 5))),
    _pendulum("pendulum_pd", "A0", "A0_pd_060143", "A0_pd_060245"),
    _pendulum(
        "pendulum_C1",
        "C1",
        *(f"C1_sysid_{k}" for k in (143339, 143524, 143601, 143704, 143906)),
    ),
    _pendulum("pendulum_C0", "C0", *(f"C0_sysid_0{k}" for k in (0, 1, 2, 3, 4))),
    _ankle("z_df", "dorsiflexors_01"),
    _ankle("z_pf", "plantarflexors_01"),
    _ankle("z_df2", "dorsiflexors_02"),
    Record("leg", "leg", "leg_force_sensor", ("press_cycles",), "leg_force_sensor", published=_LEG),
    _pendubot("pendubot_harmonic", "apr2020_harmonic_A_0.7854_v_0.25", "apr2020_harmonic_A_0.7854_v_0.5"),
    _pendubot("pendubot_position", "apr2020_position_A_0.3141_v_0.5", "apr2020_position_A_0.3141_v_1"),
    Record("panda", "panda", "franka_panda", ("exciting",), "franka_panda", published=_PANDA),
    Record("lwr4_1", "lwr4", "kuka_lwr4", ("measurements_1",), "kuka_lwr4", published=_LWR4),
    Record("lwr4_2", "lwr4", "kuka_lwr4", ("measurements_2",), "kuka_lwr4", published=_LWR4),
    Record("tx40", "tx40", "staubli_tx40", ("exciting",), "staubli_tx40", published=_TX40),
    Record("ur10e_12harm", "ur10e", "ur10e", ("exc_20_02_12_40sec_12harm",), "ur10e", published=_UR10E),
    Record("ur10e_10harm", "ur10e", "ur10e", ("exc_20_02_06_20sec_10harm",), "ur10e", published=_UR10E),
    Record("ur10e_14harm", "ur10e", "ur10e", ("exc_20_02_19_14harm50sec",), "ur10e", published=_UR10E),
)
BY_KEY = {record.key: record for record in RECORDS}


def data_folder(named: Path | None = None) -> Path:
    """Where the data are.

    Raises:
        SystemExit: they are not there.
    """
    folder = named or Path(os.environ.get("IMPID_DATA", CHECKOUT.parent / "shared" / "data"))
    if not (folder / "emps").is_dir():
        raise SystemExit(f"measured data not found at {folder}; set IMPID_DATA (docs/data.md)")
    return folder
