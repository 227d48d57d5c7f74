"""From a scenario, one of its trials and a seed to everything that is true of that trial."""

import numpy as np

from hil_sim.errors import SimError
from hil_sim.plant.kinematics import joint_angles
from hil_sim.plant.plant import Load, PlantParameters
from hil_sim.plant.reference import Reference, ten_sinusoids
from hil_sim.scenarios.schema import LoadTruth, Motion, Scenario, Trial
from hil_sim.seeds import generator
from hil_sim.sensors.accelerometer import AccelerometerTruth
from hil_sim.sensors.clock import Clock
from hil_sim.sensors.encoder import EncoderTruth
from hil_sim.sensors.force_sensor import ForceSensorTruth
from hil_sim.world import TrialTruth

TICK_S = 1e-3  # of the robot's controller and log, on its own clock


def trial_truth(scenario: Scenario, trial: Trial, seed: int) -> TrialTruth:
    """Everything that is true of one trial.

    Raises:
        SimError: the motion cannot be carried out.
    """
    world, setup = scenario.world, scenario.setup
    robot_clock = Clock(trial.robot_zero_s, world.clocks.robot_ppm)
    load = _load(world.loads[trial.load]) if trial.load else Load.none()
    encoder = EncoderTruth(
        counts_per_rev=setup.encoder.counts_per_rev,
        zero_rad=setup.encoder.zero_rad,
        direction=setup.encoder.direction,
    )
    return TrialTruth(
        name=trial.name,
        plant=PlantParameters(
            alpha=world.robot.alpha,
            link_lengths_m=setup.robot.link_lengths_m,
            load=load,
            counts_per_rev=encoder.counts_per_rev,
            direction=encoder.direction,
            zero_rad=encoder.zero_rad,
            kp=world.controller.kp_Nm_per_rad,
            kd=world.controller.kd_Nms_per_rad,
            velocity_cutoff_Hz=world.controller.velocity_cutoff_Hz,
            tick_s=TICK_S,
            true_tick_s=TICK_S / robot_clock.rate,
        ),
        reference=_reference(scenario, trial, load, seed),
        accelerometer=_accelerometer(scenario),
        encoder=encoder,
        force_sensor=None
        if world.force_sensor is None
        else ForceSensorTruth(noise_N=world.force_sensor.noise_N),
        vref_V=setup.accelerometer.vref_V,
        robot_clock=robot_clock,
        board_rate_ppm=world.clocks.board_ppm,
        duration_s=trial.duration_s,
        seed=seed,
    )


def _load(table: LoadTruth) -> Load:
    return Load(
        M=np.array(table.M_kg),
        B=np.array(table.B_Ns_per_m),
        K=np.array(table.K_N_per_m),
        x0=np.array(table.x0_m),
    )


def _reference(scenario: Scenario, trial: Trial, load: Load, seed: int) -> Reference:
    motion: Motion = scenario.motion.load if trial.load else scenario.motion.free
    centre = np.array(scenario.motion.free_centre_rad)
    if trial.load:
        try:
            centre = joint_angles(load.x0, scenario.setup.robot.link_lengths_m)
        except ValueError as error:
            raise SimError(f"trial {trial.name}: {error}; move x0_m of load {trial.load}") from None
    return ten_sinusoids(
        centre_rad=centre,
        range_deg=motion.range_deg,
        highest_Hz=motion.highest_Hz,
        ramp_s=motion.ramp_s,
        duration_s=trial.duration_s,
        generator=generator(seed, trial.name, "reference"),
    )


def _accelerometer(scenario: Scenario) -> AccelerometerTruth:
    nominal, errors = scenario.setup.accelerometer, scenario.world.accelerometer
    return AccelerometerTruth(
        zero_g_V=nominal.zero_g_V,
        sensitivity_V_per_g=nominal.sensitivity_V_per_g,
        supply_V=nominal.vref_V,
        turns_with_link2=nominal.mount == "link2",
        mount_angle_rad=nominal.mount_angle_rad + errors.mount_angle_error_rad,
        bandwidth_Hz=errors.bandwidth_Hz,
        noise_density_ug_per_rtHz=errors.noise_density_ug_per_rtHz,
        offset_mg=errors.offset_mg,
        gain_error=errors.gain_error,
        cross_axis=errors.cross_axis,
        self_test_g=errors.self_test_g,
    )
