"""From a scenario, one of its trials and a seed to everything that is true of that trial."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hil_sim.effects import catalogue
from hil_sim.effects.entry import Entry
from hil_sim.errors import SimError
from hil_sim.plant.kinematics import QUARTER_TURN, joint_angles, joints_of
from hil_sim.plant.perturbation import RATE_HZ, played_perturbation, random_perturbation
from hil_sim.plant.physics import SPRING, PlantEffects, Term
from hil_sim.plant.plant import Load, PlantParameters
from hil_sim.plant.played import played_reference
from hil_sim.plant.reference import Course, ten_sinusoids
from hil_sim.scenarios.schema import LoadTruth, Motion, NoiseTable, Scenario, TorqueNoiseTable, Trial
from hil_sim.seeds import generator
from hil_sim.sensors import adxl355
from hil_sim.sensors.accelerometer import AccelerometerTruth
from hil_sim.sensors.clock import Clock
from hil_sim.sensors.encoder import EncoderTruth
from hil_sim.sensors.force_sensor import ForceSensorTruth
from hil_sim.sensors.noise import NoiseTruth
from hil_sim.sensors.torque_log import LogTruth
from hil_sim.world import TrialTruth

TICK_S = 1e-3  # of the robot's controller and log, on its own clock


def trial_truth(scenario: Scenario, trial: Trial, seed: int) -> TrialTruth:
    """Everything that is true of one trial.

    Raises:
        SimError: the motion cannot be carried out, or an effect is not what the catalogue says.
    """
    return catalogue.apply(without_effects(scenario, trial, seed), effects_in(scenario, trial))


def effects_in(scenario: Scenario, trial: Trial) -> tuple[Entry, ...]:
    """The effects that the scenario hides in this trial.

    Raises:
        SimError: an effect is not what the catalogue says.
    """
    entries = [
        catalogue.entry(
            one.effect, one.places, one.trials, one.values, when=one.when, per_trial=one.per_trial
        )
        for one in scenario.effects
    ]
    for entry in entries:
        if scenario.setup.robot.single and entry.where != ("joint1",):
            raise SimError(
                f'effect {entry.effect}: {scenario.setup.robot.model} has joint1 alone; say where = "joint1"'
                " or choose another effect"
            )
    return tuple(
        entry
        for entry in entries
        if catalogue.applies(entry, trial.name, loaded=trial.load is not None, load=trial.load)
    )


def without_effects(scenario: Scenario, trial: Trial, seed: int) -> TrialTruth:
    """The trial as it would be if nothing were hidden in it.

    Raises:
        SimError: the motion cannot be carried out.
    """
    world, setup = scenario.world, scenario.setup
    robot_clock = Clock(
        trial.robot_zero_s,
        world.clocks.robot_ppm,
        wander_ppm=world.clocks.wander_ppm,
        wander_period_s=world.clocks.wander_period_s,
    )
    load = _load(world.loads[trial.load]) if trial.load else Load.none()
    if trial.on_arm:
        # The handle sits on the load's side of the force sensor.
        load = replace(load, M=load.M + setup.handle.mass_kg * np.eye(2))
    encoder = EncoderTruth(
        counts_per_rev=setup.encoder.counts_per_rev,
        zero_rad=setup.encoder.zero_rad,
        direction=setup.encoder.direction,
    )
    plain = TrialTruth(
        name=trial.name,
        plant=PlantParameters(
            alpha=world.robot.alpha,
            link_lengths_m=setup.robot.link_lengths_m,
            believed_lengths_m=setup.robot.link_lengths_m,
            relative=setup.robot.relative,
            load=load,
            counts_per_rev=encoder.counts_per_rev,
            direction=encoder.direction,
            zero_rad=encoder.zero_rad,
            **_controller(scenario, trial),
            tick_s=TICK_S,
            true_tick_s=TICK_S / robot_clock.rate,
        ),
        course=_course(scenario, trial, load, seed),
        inputs=None,
        accelerometer=_accelerometer(scenario),
        encoder=encoder,
        force_sensor=_force_sensor(scenario),
        accelerometer_delay_s=adxl355.LATE_S if setup.accelerometer.part == adxl355.PART else 0.0,
        vref_V=world.accelerometer.supply_V or setup.accelerometer.vref_V,
        adc_noise_lsb=world.adc.noise_lsb,
        miscounts_per_min=world.encoder.miscounts_per_min,
        miscount=world.encoder.miscount,
        log=_log(scenario, trial),
        robot_clock=robot_clock,
        board_rate_ppm=world.clocks.board_ppm,
        duration_s=trial.duration_s,
        seed=seed,
        part=setup.accelerometer.part,
    )
    if setup.robot.single:
        return _on_the_axis(plain)
    return _weighted(plain, scenario) if setup.robot.gravity_m_s2 else plain


def _on_the_axis(truth: TrialTruth) -> TrialTruth:
    """A single axis carries its load: inertia and damping are parts of its own, the spring holds it.

    The plant's second joint stands aside: nothing couples it, and its drive holds it at zero.
    """
    load, a = truth.plant.load, truth.plant.alpha
    alpha = (a[0] + float(load.M[0, 0]), a[1], a[2], a[3] + float(load.B[0, 0]), a[4])
    spring = Term(SPRING, 0, size=float(load.K[0, 0]), a=float(load.x0[0]), b=0.0)
    effects = PlantEffects(terms=(spring,) if spring.size else ())
    plant = replace(truth.plant, alpha=alpha, load=Load.none(), effects=effects)
    return replace(truth, plant=plant)


def _weighted(truth: TrialTruth, scenario: Scenario) -> TrialTruth:
    """Where the plane is not level and the laboratory knows it, links, payload and sensor feel that."""
    gravity = scenario.setup.robot.gravity_m_s2 or (0.0, 0.0)
    moment = scenario.world.robot.moment_kg_m or truth.plant.likely_moments_kg_m
    effects = PlantEffects(gravity=gravity, moment=moment)
    return replace(
        truth,
        plant=replace(truth.plant, effects=effects),
        accelerometer=replace(truth.accelerometer, gravity_m_s2=gravity),
    )


def _load(table: LoadTruth) -> Load:
    return Load(
        M=np.array(table.M_kg),
        B=np.array(table.B_Ns_per_m),
        K=np.array(table.K_N_per_m),
        x0=np.array(table.x0_m),
    )


def _controller(scenario: Scenario, trial: Trial) -> dict[str, Any]:
    """The fields of PlantParameters that depend on what the robot is to do."""
    if trial.kind == "stochastic":
        weak = scenario.motion.perturbation
        return {
            "kp": weak.kp_N_per_m,
            "kd": weak.kd_Ns_per_m,
            "velocity_cutoff_Hz": weak.velocity_cutoff_Hz,
            "at_tip": True,
        }
    pd = scenario.world.controller
    return {
        "kp": pd.kp_Nm_per_rad,
        "kd": pd.kd_Nms_per_rad,
        "velocity_cutoff_Hz": pd.velocity_cutoff_Hz,
    }


def _course(scenario: Scenario, trial: Trial, load: Load, seed: int) -> Course:
    motion: Motion = scenario.motion.load if trial.load else scenario.motion.free
    centre = np.array(scenario.motion.free_centre_rad)
    if trial.load and scenario.setup.robot.single:
        centre = np.array([load.x0[0], 0.0])
    elif trial.load:
        try:
            links = joint_angles(load.x0, scenario.setup.robot.link_lengths_m)
            centre = joints_of(links, relative=scenario.setup.robot.relative)
        except ValueError as error:
            raise SimError(f"trial {trial.name}: {error}; move x0_m of load {trial.load}") from None
    if trial.command_csv is not None and trial.kind != "stochastic":
        joints = 1 if scenario.setup.robot.single else 2
        try:
            return played_reference(Path(trial.command_csv), TICK_S, joints=joints)
        except ValueError as error:
            raise SimError(f"trial {trial.name}: {error}") from None
    if trial.command_csv is not None:
        try:
            played = played_perturbation(
                Path(trial.command_csv), load.x0, scenario.setup.robot.link_lengths_m
            )
            return replace(played, relative=scenario.setup.robot.relative)
        except ValueError as error:
            raise SimError(f"trial {trial.name}: {error}") from None
    if trial.kind == "stochastic":
        table = scenario.motion.perturbation
        shaken = random_perturbation(
            hold_m=load.x0,
            rms_N=table.rms_N,
            highest_Hz=table.highest_Hz,
            duration_s=trial.duration_s,
            link_lengths_m=scenario.setup.robot.link_lengths_m,
            generator=generator(seed, "every trial" if table.alike else trial.name, "perturbation"),
        )
        return replace(shaken, relative=scenario.setup.robot.relative)
    return ten_sinusoids(
        centre_rad=centre,
        range_deg=motion.range_deg,
        highest_Hz=motion.highest_Hz,
        ramp_s=motion.ramp_s,
        duration_s=trial.duration_s,
        generator=generator(seed, trial.name, "reference"),
    )


def _noise(tables: tuple[NoiseTable | TorqueNoiseTable, ...]) -> tuple[NoiseTruth, ...]:
    return tuple(NoiseTruth(table.kind, table.rms, table.corner_Hz) for table in tables)


def _force_sensor(scenario: Scenario) -> ForceSensorTruth | None:
    table = scenario.world.force_sensor
    if table is None:
        return None
    return ForceSensorTruth(
        noise=(NoiseTruth("white", table.noise_N), *_noise(table.noise)),
        offset_N=table.offset_N,
        gain_error=table.gain_error,
        quantum_N=table.quantum_N,
    )


def _log(scenario: Scenario, trial: Trial) -> LogTruth:
    table = scenario.world.torque_log
    stochastic = trial.kind == "stochastic"
    return LogTruth(
        every_ticks=round(1.0 / (RATE_HZ * TICK_S)) if stochastic else 1,
        with_command=stochastic,
        noise=_noise(table.noise),
        quantum_Nm=table.quantum_Nm,
        jitter_s=table.jitter_s,
        gap_every_s=table.gap_every_s,
        gap_rows=table.gap_rows,
        late_start_s=table.late_start_s,
    )


def _accelerometer(scenario: Scenario) -> AccelerometerTruth:
    nominal, errors = scenario.setup.accelerometer, scenario.world.accelerometer
    # On a relative robot x' lies along the second link; the plant's angle of it is a quarter turn ahead.
    behind = QUARTER_TURN if scenario.setup.robot.relative and nominal.mount == "link2" else 0.0
    return AccelerometerTruth(
        zero_g_V=nominal.zero_g_V,
        sensitivity_V_per_g=nominal.sensitivity_V_per_g,
        supply_V=errors.supply_V or nominal.vref_V,
        nominal_supply_V=nominal.vref_V,
        warm_up_C=errors.warm_up_C,
        warm_up_s=errors.warm_up_s,
        offset_mg_per_C=errors.offset_mg_per_C,
        gain_per_C=errors.gain_per_C,
        turns_with_link2=nominal.mount == "link2",
        mount_angle_rad=nominal.mount_angle_rad + errors.mount_angle_error_rad - behind,
        bandwidth_Hz=errors.bandwidth_Hz,
        noise_density_ug_per_rtHz=errors.noise_density_ug_per_rtHz,
        offset_mg=errors.offset_mg,
        gain_error=errors.gain_error,
        cross_axis=errors.cross_axis,
        self_test_g=errors.self_test_g,
    )
