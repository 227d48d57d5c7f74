"""Any serial robot from its URDF: dynamics by Pinocchio, cut down to the parameters that motion can show.

The torque is linear in ten inertial parameters per link, of which a motion shows only certain combinations,
the base parameters (Gautier and Khalil). They are found once, by QR of the regressor at random states;
viscous friction per joint stands beside them.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from scipy import linalg

from impid_host.errors import InputError
from impid_host.robot.model import LINK
from impid_host.robot.urdf_file import Chain, read_chain
from impid_host.signals.arrays import Floats

_LINK_UNITS = ("kg", "kg*m", "kg*m", "kg*m", *["kg*m^2"] * 6)
_RANK_TOLERANCE = 1e-8
_NEGLIGIBLE = 1e-6
_TERMS_IN_A_NAME = 2
_GRAVITY_M_S2 = (0.0, 0.0, -9.81)  # Pinocchio's own


@dataclass(frozen=True, slots=True)
class BaseParameters:
    """What a motion can show of n links' ten inertial parameters each.

    With W = [W1 W2] (W1 kept, W2 = W1 X), the kept columns carry p1 + X p2.

    Attributes:
        kept: columns of the full regressor that carry them, (b,).
        grouping: the whole map, base = grouping @ (10 n link parameters), (b, 10 n).
        names, units: of the b; a name that ends in R stands for a regrouping of several.
        meanings: of those names, what they gather.
    """

    kept: tuple[int, ...]
    grouping: Floats
    names: tuple[str, ...]
    units: tuple[str, ...]
    meanings: dict[str, str]


@dataclass(frozen=True, slots=True)
class Urdf:
    """A serial robot of n joints, each of one degree of freedom; gravity along -z of the URDF's base.

    Build it by `urdf_robot`.

    Attributes:
        frame: of the end-effector.
        chain: which joints move and which are fixed.
        base: the inertial parameters that motion can show.
        task_axes: x, y for an arm of two joints that stays in the plane, the one axis that a single joint
            moves along, else x, y, z.
        has_gravity: gravity pulls at some joint; where not, the arm stays level.
    """

    pin_model: Any
    pin_data: Any
    frame: int
    chain: Chain
    base: BaseParameters
    task_axes: tuple[str, ...]
    has_gravity: bool

    task_is_rotary: ClassVar[bool] = False
    torque_at_load: ClassVar[bool] = False
    baseline: ClassVar[str] = "textbook"
    gravity_parameters: ClassVar[tuple[str, ...]] = ()

    @property
    def name(self) -> str:
        """As `robot.model` in setup.toml."""
        return "urdf"

    @property
    def joints(self) -> int:
        """Number of joints, n."""
        return int(self.pin_model.nv)

    @property
    def prismatic(self) -> tuple[bool, ...]:
        """Which joints slide, n."""
        return self.chain.prismatic

    @property
    def plane_gravity_m_s2(self) -> tuple[float, float]:
        """A URDF's gravity is along -z; an arm that stays in x and y feels none."""
        return (0.0, 0.0)

    @property
    def link_lengths_m(self) -> tuple[float, ...]:
        """None declared."""
        return ()

    def with_links(self, lengths_m: tuple[float, ...]) -> "Urdf":  # noqa: ARG002
        """The robot itself: it has no declared lengths."""
        return self

    def first_moments(self, theta: Floats, parameters: Floats) -> Floats | None:  # noqa: ARG002
        """None: no arm in a plane."""
        return None

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Base parameters, then viscous friction per joint."""
        return self.base.names + tuple(f"Fv{joint + 1}" for joint in range(self.joints))

    @property
    def link_inertias(self) -> Floats:
        """Base parameters as sums of the links' own, (b, 10 n)."""
        return self.base.grouping

    @property
    def nonnegative(self) -> tuple[bool, ...]:
        """Friction; what a regrouping may be only its links together say."""
        return (False,) * len(self.base.names) + (True,) * self.joints

    @property
    def parameter_meanings(self) -> dict[str, str]:
        """What those names gather that end in R."""
        return self.base.meanings

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Units in the order of the names (prismatic joints: N s/m)."""
        return self.base.units + tuple("N*s/m" if slides else "N*m*s/rad" for slides in self.prismatic)

    def regressor(self, theta: Floats, omega: Floats, theta_dd: Floats) -> Floats:
        """Y (N, n, b + n)."""
        b = len(self.base.kept)
        Y = np.zeros((len(theta), self.joints, b + self.joints))
        Y[:, :, :b] = _full_regressor(
            self.pin_model, self.pin_data, theta, omega, theta_dd, list(self.base.kept)
        )
        for joint in range(self.joints):
            Y[:, joint, b + joint] = omega[:, joint]
        return Y

    def gravity_regressor(self, theta: Floats) -> Floats:
        """A URDF's gravity is part of its own regressor: (N, n) -> (N, n, 0)."""
        return np.zeros((len(theta), self.joints, 0))

    @property
    def _task_rows(self) -> list[int]:
        return ["xyz".index(axis) for axis in self.task_axes]

    def position(self, theta: Floats) -> Floats:
        """(N, n) -> (N, d), m."""
        pin = _pinocchio()
        rows = self._task_rows
        out = np.empty((len(theta), len(self.task_axes)))
        for k, q in enumerate(theta):
            pin.framesForwardKinematics(self.pin_model, self.pin_data, q)
            out[k] = self.pin_data.oMf[self.frame].translation[rows]
        return out

    def jacobian(self, theta: Floats) -> Floats:
        """(N, n) -> (N, d, n)."""
        pin = _pinocchio()
        rows = self._task_rows
        out = np.empty((len(theta), len(self.task_axes), self.joints))
        for k, q in enumerate(theta):
            full = pin.computeFrameJacobian(
                self.pin_model, self.pin_data, q, self.frame, pin.LOCAL_WORLD_ALIGNED
            )
            out[k] = full.reshape(6, -1)[rows]
        return out

    def jacobian_rate(self, theta: Floats, omega: Floats) -> Floats:
        """(N, n) twice -> (N, d, n)."""
        pin = _pinocchio()
        rows = self._task_rows
        out = np.empty((len(theta), len(self.task_axes), self.joints))
        for k, (q, v) in enumerate(zip(theta, omega, strict=True)):
            pin.computeJointJacobiansTimeVariation(self.pin_model, self.pin_data, q, v)
            full = pin.getFrameJacobianTimeVariation(
                self.pin_model, self.pin_data, self.frame, pin.LOCAL_WORLD_ALIGNED
            )
            out[k] = full.reshape(6, -1)[rows]
        return out

    def tip_angle(self, theta: Floats) -> Floats:
        """Of the last frame's x axis in the base's x-y plane: (N, n) -> (N,), rad."""
        pin = _pinocchio()
        pin.framesForwardKinematics(self.pin_model, self.pin_data, np.zeros(self.joints))
        R = self.pin_data.oMf[self.frame].rotation
        return self.tip_turn(theta) + float(np.arctan2(R[1, 0], R[0, 0]))

    def tip_turn(self, omega: Floats) -> Floats:
        """(N, n) -> (N,), rad/s; every axis of an arm in a plane is parallel to z."""
        pin = _pinocchio()
        still = np.zeros(self.joints)
        J = pin.computeFrameJacobian(
            self.pin_model, self.pin_data, still, self.frame, pin.LOCAL_WORLD_ALIGNED
        )
        return np.asarray(omega @ J.reshape(6, -1)[5])

    def inertia(self, theta: Floats, parameters: Floats) -> Floats:
        """(N, n) -> (N, n, n): the torque that a unit acceleration of each joint adds."""
        still = np.zeros_like(theta)
        rest = self.regressor(theta, still, still) @ parameters
        unit = np.eye(self.joints)
        columns = [
            self.regressor(theta, still, np.broadcast_to(row, theta.shape)) @ parameters - rest
            for row in unit
        ]
        return np.stack(columns, axis=2)

    def coriolis(self, theta: Floats, omega: Floats, parameters: Floats) -> Floats:
        """(N, n) twice -> (N, n, n), Christoffel's form of the inertia's central differences."""
        step, n = 1e-5, self.joints
        slope = np.empty((len(theta), n, n, n))
        for k, shift in enumerate(np.eye(n) * step):
            ahead, behind = self.inertia(theta + shift, parameters), self.inertia(theta - shift, parameters)
            slope[..., k] = (ahead - behind) / (2 * step)
        symbols = 0.5 * (slope + np.swapaxes(slope, 2, 3) - np.moveaxis(slope, 3, 1))
        result: Floats = np.einsum("Nijk,Nk->Nij", symbols, omega)
        return result


def urdf_robot(
    path: Path, joints: tuple[str, ...] = (), gravity_m_s2: tuple[float, float, float] = _GRAVITY_M_S2
) -> Urdf:
    """The robot that a URDF describes.

    Args:
        joints: names of the joints that move, base to tip; by default the longest chain.
        gravity_m_s2: in the URDF's base frame.

    Raises:
        InputError: Pinocchio is not installed, the file cannot be read, or it holds no serial chain of joints
            with one degree of freedom.
    """
    chain = read_chain(path, joints)
    pin = _pinocchio(path)
    try:
        whole = pin.buildModelFromXML(chain.xml)
    except (ValueError, RuntimeError, OSError) as error:
        reason = (str(error).strip().splitlines() or ["no reason given"])[0]
        raise InputError(path, f"is no robot that Pinocchio can read ({reason})", "check the URDF") from None
    rest = pin.neutral(whole)
    for name, place in chain.fixed.items():
        rest[whole.joints[whole.getJointId(name)].idx_q] = place
    model = pin.buildReducedModel(whole, [whole.getJointId(name) for name in chain.fixed], rest)
    model.gravity.linear = np.array(gravity_m_s2)
    data, frame = model.createData(), model.getFrameId(chain.tip)
    axes = _task_axes(model, data, frame)
    return Urdf(model, data, frame, chain, _base_parameters(model, data), axes, _pulls(model, data))


def _pinocchio(path: Path | None = None) -> Any:
    try:
        import pinocchio  # noqa: PLC0415  (an optional extra)
    except ImportError:
        raise InputError(
            path or "robot.urdf",
            "needs the library Pinocchio, which is not installed",
            "pip install 'impid[urdf]'",
        ) from None
    return pinocchio


def _full_regressor(
    model: Any, data: Any, theta: Floats, omega: Floats, theta_dd: Floats, columns: list[int] | None = None
) -> Floats:
    """Ten columns per link, or those of them that are asked for, (N, n, 10 n)."""
    pin = _pinocchio()
    wanted = list(range(10 * model.nv)) if columns is None else columns
    out = np.empty((len(theta), model.nv, len(wanted)))
    for k, (q, v, a) in enumerate(zip(theta, omega, theta_dd, strict=True)):
        # Of a single joint Pinocchio hands out one row without its axis.
        out[k] = pin.computeJointTorqueRegressor(model, data, q, v, a).reshape(model.nv, -1)[:, wanted]
    return out


def _base_parameters(model: Any, data: Any) -> BaseParameters:
    """By QR without pivoting: a column that depends on those before it shows a zero on R's diagonal.

    Masses are offered last, so that inertias and first moments gather them, as in Gautier and Khalil's
    regrouping.
    """
    n = model.nv
    rng = np.random.default_rng(0)
    states = rng.uniform(-1, 1, (3, 60 * n, n)) * np.array([np.pi, 4.0, 20.0])[:, None, None]
    W = _full_regressor(model, data, *states).reshape(-1, 10 * n)
    size = np.linalg.norm(W, axis=0)
    alive = [c for c in sorted(range(10 * n), key=lambda c: (c % 10 == 0, c)) if size[c] > _NEGLIGIBLE]
    R = linalg.qr(W[:, alive] / size[alive], mode="r")[0]
    free = np.abs(np.diag(R[: len(alive)])) > _RANK_TOLERANCE
    kept = np.sort([c for c, independent in zip(alive, free, strict=True) if independent])
    rest = np.sort([c for c, independent in zip(alive, free, strict=True) if not independent]).astype(int)
    X, *_ = np.linalg.lstsq(W[:, kept], W[:, rest], rcond=None)
    grouping = np.zeros((len(kept), 10 * n))
    grouping[np.arange(len(kept)), kept] = 1.0
    grouping[:, rest] = np.where(np.abs(X) > _NEGLIGIBLE, X, 0.0)
    links = [f"{LINK[c % 10]}{c // 10 + 1}" for c in range(10 * n)]
    names, meanings = [], {}
    for row, column in zip(grouping, kept, strict=True):
        terms = [
            f"{'+' if row[other] > 0 else '-'}{_factor(abs(row[other]))}{links[other]}"
            for other in np.flatnonzero(row)
            if other != column
        ]
        whole = " ".join([links[column], *terms])
        short = whole if len(terms) < _TERMS_IN_A_NAME else f"{links[column]}R"
        names.append(short)
        if short != whole:
            meanings[short] = whole
    units = tuple(_LINK_UNITS[c % 10] for c in kept)
    return BaseParameters(tuple(int(c) for c in kept), grouping, tuple(names), units, meanings)


def _factor(value: float) -> str:
    return "" if abs(value - 1) < _NEGLIGIBLE else f"{value:.4g}*"


def _task_axes(model: Any, data: Any, frame: int) -> tuple[str, ...]:
    moves = _extent(model, data, frame) > _NEGLIGIBLE
    if model.nv == 2 and not moves[2]:
        return ("x", "y")
    if model.nv == 1 and moves.sum() == 1:
        return (("x", "y", "z")[int(np.argmax(moves))],)
    return ("x", "y", "z")


def _pulls(model: Any, data: Any) -> bool:
    """True where a robot at rest needs torque against gravity somewhere."""
    places = np.random.default_rng(2).uniform(-1, 1, (20, model.nv))
    still = np.zeros_like(places)
    return bool(np.abs(_full_regressor(model, data, places, still, still)).max() > _NEGLIGIBLE)


def _extent(model: Any, data: Any, frame: int) -> Floats:
    pin = _pinocchio()
    places = []
    for q in np.random.default_rng(1).uniform(-1, 1, (20, model.nv)):
        pin.framesForwardKinematics(model, data, q)
        places.append(np.array(data.oMf[frame].translation))
    result: Floats = np.ptp(np.array(places), axis=0)
    return result
