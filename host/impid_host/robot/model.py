"""What every robot model offers: kinematics, and dynamics that are linear in its parameters."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

from impid_host.errors import UndeterminedError
from impid_host.robot.joint_1d import Joint1D
from impid_host.robot.planar_2r_absolute import Planar2RAbsolute
from impid_host.robot.planar_2r_relative import Planar2RRelative
from impid_host.robot.slide_1d import Slide1D
from impid_host.signals.arrays import Floats
from impid_host.study.model import RobotSetup

LINK = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")  # of a link, about its own origin


class RobotModel(Protocol):
    """A robot whose torque is `regressor @ parameters`; n joints, d task axes, p parameters, N instants.

    Angles in rad (m for a prismatic joint), torques in N m (N), task coordinates in m in the base frame.
    """

    @property
    def name(self) -> str:
        """As `robot.model` in setup.toml."""

    @property
    def joints(self) -> int:
        """Number of joints, n."""

    @property
    def task_axes(self) -> tuple[str, ...]:
        """Names of the end-effector's axes, d of them."""

    @property
    def prismatic(self) -> tuple[bool, ...]:
        """Which joints slide: N and m stand for N m and rad there, n of them."""

    @property
    def task_is_rotary(self) -> bool:
        """True where the load is a torque against the joint's own angle, not a force at an end-effector."""

    @property
    def torque_at_load(self) -> bool:
        """True where tau is measured at the load, with no drive between; `torque_at_load` asks a study."""

    @property
    def baseline(self) -> str:
        """What a diagnosis of this robot starts from: "papers" or "textbook" (dry friction, offset too)."""

    @property
    def has_gravity(self) -> bool:
        """True where gravity is part of the model: its parameters hold the links' first moments."""

    @property
    def gravity_parameters(self) -> tuple[str, ...]:
        """Names of the g moments by which gravity would act on a model that has none, kg m^2/s^2 each."""

    def gravity_regressor(self, theta: Floats) -> Floats:
        """What one unit of each adds to the torque: (N, n) -> (N, n, g); g is 0 where `has_gravity`."""

    @property
    def link_lengths_m(self) -> tuple[float, ...]:
        """Declared link lengths, m; empty where setup.toml declares none."""

    def with_links(self, lengths_m: tuple[float, ...]) -> "RobotModel":
        """The same robot with other link lengths."""

    def first_moments(self, theta: Floats, parameters: Floats) -> Floats | None:
        """Torque per unit of gravity along x and y by moments that the inertias tell: (N, n) -> (N, n, 2)."""

    @property
    def plane_gravity_m_s2(self) -> tuple[float, float]:
        """Gravity along x and y of an arm in a plane, m/s^2; it pulls at an accelerometer too."""

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """The p parameters, in the order of the regressor's columns."""

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Their units."""

    @property
    def parameter_meanings(self) -> dict[str, str]:
        """What those gather whose names do not say it."""

    @property
    def link_inertias(self) -> Floats | None:
        """The first b parameters as sums of each link's ten of `LINK`, (b, 10 n); None: unknown."""

    @property
    def nonnegative(self) -> tuple[bool, ...]:
        """Which of the p parameters cannot be negative by themselves: friction, an axis's inertia."""

    def regressor(self, theta: Floats, omega: Floats, theta_dd: Floats) -> Floats:
        """Y with tau = Y @ parameters in free motion: (N, n) three times -> (N, n, p)."""

    def position(self, theta: Floats) -> Floats:
        """End-effector position: (N, n) -> (N, d), m."""

    def jacobian(self, theta: Floats) -> Floats:
        """J = d position / d theta: (N, n) -> (N, d, n)."""

    def jacobian_rate(self, theta: Floats, omega: Floats) -> Floats:
        """J', the rate of J along the motion: (N, n) twice -> (N, d, n)."""

    def tip_angle(self, theta: Floats) -> Floats:
        """Angle from x to the end-effector's x' axis, of an arm in a plane: (N, n) -> (N,), rad."""

    def tip_turn(self, omega: Floats) -> Floats:
        """Rate of that angle, linear in the joints' rates: (N, n) -> (N,); of accelerations likewise."""

    def inertia(self, theta: Floats, parameters: Floats) -> Floats:
        """I(theta): (N, n) -> (N, n, n)."""

    def coriolis(self, theta: Floats, omega: Floats, parameters: Floats) -> Floats:
        """C(theta, omega) with I' - 2C skew-symmetric: (N, n) twice -> (N, n, n)."""


@dataclass(frozen=True, slots=True)
class RobotKind:
    """A row of the table of robot models: what must be known before a log of one can be read.

    Attributes:
        build: the model of a robot that setup.toml describes.
        joints: how many; None where setup.toml or the log says it.
        slides: all of its joints are prismatic (of a robot with its own description, that says which).
        link_lengths: how many entries `link_lengths_m` needs.
        gravity_axes: how many entries `gravity_m_s2` may have.
        described: True where setup.toml names a file that describes the robot.
    """

    build: Callable[[RobotSetup], RobotModel]
    joints: int | None = None
    slides: bool = False
    link_lengths: int = 0
    gravity_axes: int = 2
    described: bool = False


def _absolute(setup: RobotSetup) -> RobotModel:
    l1, l2 = setup.link_lengths_m
    return Planar2RAbsolute(l1, l2)


def _relative(setup: RobotSetup) -> RobotModel:
    l1, l2 = setup.link_lengths_m
    gx, gy = setup.gravity_m_s2
    return Planar2RRelative(l1, l2, (gx, gy))


def _urdf(setup: RobotSetup) -> RobotModel:
    from impid_host.robot.urdf import urdf_robot  # noqa: PLC0415  (needs an optional extra)

    if setup.urdf is None:
        raise UndeterminedError('robot.model = "urdf" needs urdf = "robot.urdf" in setup.toml')
    gravity = setup.gravity_m_s2
    if len(gravity) == 3:
        return urdf_robot(setup.urdf, setup.joints, (gravity[0], gravity[1], gravity[2]))
    return urdf_robot(setup.urdf, setup.joints)


ROBOTS: dict[str, RobotKind] = {
    "planar-2r-absolute": RobotKind(_absolute, 2, link_lengths=2),
    "planar-2r-relative": RobotKind(_relative, 2, link_lengths=2),
    "slide-1d": RobotKind(lambda _setup: Slide1D(), 1, slides=True),
    "joint-1d": RobotKind(lambda _setup: Joint1D(), 1),
    "urdf": RobotKind(_urdf, gravity_axes=3, described=True),
}


def robot_model(setup: RobotSetup) -> RobotModel:
    """The model that setup.toml names.

    Raises:
        InputError: a URDF that cannot be used, or the library for it is missing.
        UndeterminedError: the setup names no URDF.
    """
    return ROBOTS[setup.model].build(setup)


def torque_at_load(model: RobotModel, kinds: Iterable[str]) -> bool:
    """True where a study's torque is the load's own: no free trial shows a robot between drive and load.

    A free trial of a torque sensor that carried nothing would show nothing; so where there is one, there is a
    machine in it, with its own inertia, friction and gravity.

    Args:
        kinds: of the study's trials.
    """
    return model.torque_at_load and "free" not in set(kinds)
