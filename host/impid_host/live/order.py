"""What an observer is asked to do, as one line of JSON to its process."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from impid_host.impedance.identify import RobotParameters
from impid_host.study.model import AccelerometerSetup, Setup
from impid_host.study.setup_file import read_setup

SHORTEST_WINDOW_S = 4.0  # of which the filters' edges take two


@dataclass(frozen=True, slots=True)
class Order:
    """What to observe.

    Attributes:
        model: the file that `fit --save-model` wrote; setup: the apparatus' file.
        accelerometer: the setup's, calibrated; None: as the file has it.
        host, port: where the robot's torques arrive; window_s: of the running stiffness.
        log: everything that is shown, a line of JSON each; None: nowhere.
    """

    model: Path
    setup: Path
    accelerometer: AccelerometerSetup | None
    host: str
    port: int
    window_s: float
    log: Path | None

    def to_dict(self) -> dict[str, Any]:
        """For the pipe."""
        paths = {"model": str(self.model), "setup": str(self.setup), "log": self.log and str(self.log)}
        return asdict(self) | paths

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> "Order":
        """What `to_dict` gave."""
        sensor = values["accelerometer"]
        if sensor is not None:
            plain: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in sensor.items()}
            sensor = AccelerometerSetup(**plain)
        places = {name: values[name] and Path(values[name]) for name in ("model", "setup", "log")}
        return cls(**{**values, **places, "accelerometer": sensor})

    def apparatus(self) -> Setup:
        """The setup as it is used.

        Raises:
            InputError: it cannot be read.
        """
        setup = read_setup(self.setup)
        return setup if self.accelerometer is None else replace(setup, accelerometer=self.accelerometer)


def known_robot(model: Path, setup: Setup) -> tuple[RobotParameters, str]:
    """The robot of a saved model, and what of the model is not used here, in words ("": nothing).

    Raises:
        InputError: the file cannot be used, or is of another robot.
    """
    # The diagnosis' half of impid stands behind a saved model; the recorder does without unless it is asked.
    from impid_host.diagnosis.reuse import require_same_robot  # noqa: PLC0415
    from impid_host.diagnosis.saved import read_model  # noqa: PLC0415
    from impid_host.robot.model import robot_model  # noqa: PLC0415
    from impid_host.study.model import Study  # noqa: PLC0415

    saved = read_model(model)
    require_same_robot(saved, Study("", setup, ()))
    structure = saved.structure.of(robot_model(setup.robot))
    robot = RobotParameters(structure, saved.alpha, saved.covariance, "saved model")
    effects = ", ".join(dict.fromkeys(effect.label for effect in saved.effects))
    return robot, f"{model}: its effects are not taken out of the live force: {effects}" if effects else ""
