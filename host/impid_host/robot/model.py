"""What every robot model offers: kinematics, and dynamics that are linear in its parameters."""

from typing import Protocol

from impid_host.errors import UndeterminedError
from impid_host.robot.joint_1d import Joint1D
from impid_host.robot.planar_2r_absolute import Planar2RAbsolute
from impid_host.robot.planar_2r_relative import Planar2RRelative
from impid_host.robot.slide_1d import Slide1D
from impid_host.robot.urdf import urdf_robot
from impid_host.signals.arrays import Floats
from impid_host.study.model import RobotSetup


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
    def plane_gravity_m_s2(self) -> tuple[float, float]:
        """Gravity along x and y of an arm in a plane, m/s^2; it pulls at an accelerometer too."""

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """The p parameters, in the order of the regressor's columns."""

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Their units."""

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


def robot_model(setup: RobotSetup) -> RobotModel:
    """The model that setup.toml names.

    Raises:
        InputError: a URDF that cannot be used, or the library for it is missing.
        UndeterminedError: the setup names no URDF.
    """
    if setup.model == "planar-2r-absolute":
        l1, l2 = setup.link_lengths_m
        return Planar2RAbsolute(l1, l2)
    if setup.model == "planar-2r-relative":
        l1, l2 = setup.link_lengths_m
        return Planar2RRelative(l1, l2, gravity_m_s2=setup.gravity_m_s2)
    if setup.model == "slide-1d":
        return Slide1D()
    if setup.model == "joint-1d":
        return Joint1D()
    if setup.urdf is None:
        raise UndeterminedError('robot.model = "urdf" needs urdf = "robot.urdf" in setup.toml')
    return urdf_robot(setup.urdf)
