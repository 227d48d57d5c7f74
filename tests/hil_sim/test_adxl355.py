"""The digital accelerometer from the motion to the host: three axes of 20 bits, both carriers."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.csv
import pytest
from click.testing import CliRunner
from impid_host.samples import DeviceSamples
from impid_host.signals.counts import specific_force
from impid_host.study.device_csv import read_device_samples
from impid_host.study.setup_file import read_setup
from impid_host.wire.can import CanDecoder
from impid_host.wire.decoder import SerialDecoder
from impid_host.wire.records import BoardStatus, Segment, join_segments
from scipy.signal import butter, sosfiltfilt

from hil_sim.board import layout
from hil_sim.board.native import BoardConfig, NativeBoard
from hil_sim.board.wire import command
from hil_sim.cli import cli
from hil_sim.scenarios.load import load, trial
from hil_sim.scenarios.sensor import with_sensor
from hil_sim.study.write import write_study
from hil_sim.trials import trial_truth
from hil_sim.world import World

G = 9.80665


def board() -> NativeBoard:
    return NativeBoard(BoardConfig(part="ADXL355", serial_bytes_per_ms=0))


def streamed(carrier: str, ticks: int) -> tuple[Segment, np.ndarray, np.ndarray]:
    """What the host makes of a stream, and the readings and counts that the board was given."""
    rng = np.random.default_rng(5)
    readings = rng.integers(1, 0xFFFFF, (ticks, 1, 3), dtype=np.uint32)
    counts = rng.integers(-(2**31), 2**31, (ticks, 2)).astype(np.int32)
    module = board()
    module.run(readings[:1], counts[:1])
    start = {"request_id": 1, "opcode": layout.code("COMMAND", "opcode", "START"), "item": 0, "value": 0}
    if carrier == "serial":
        module.serial_receive(command(1, "START"), module.now_us)
    else:
        module.can_receive(0x100, layout.database().encode_message("COMMAND", start), module.now_us)
    module.run(readings[1:], counts[1:])
    if carrier == "serial":
        segments = list(SerialDecoder().feed(module.serial_take()).segments)
    else:
        frames = module.can_take()
        identifiers = np.array([identifier for identifier, _ in frames], dtype=np.uint16)
        words = np.frombuffer(b"".join(data.ljust(8, b"\0") for _, data in frames), dtype="<u8")
        segments = list(CanDecoder().feed(identifiers, words).segments)
    (segment,) = join_segments(segments)
    return segment, readings, counts


@pytest.mark.parametrize("carrier", ["serial", "can"])
def test_every_bit_of_a_reading_reaches_the_host(carrier: str) -> None:
    segment, readings, counts = streamed(carrier, 503)
    samples = segment.samples
    assert samples.az is not None
    assert len(samples) >= 490  # on the serial line the last batch is not full
    tick = samples.t_us.astype(int) // 1000  # the instant's; the reading of two ticks later belongs to it
    got = np.stack([samples.ax, samples.ay, samples.az], axis=1)
    assert np.array_equal(got, readings[tick + 2, 0] << 4)
    assert np.array_equal(np.stack([samples.enc1, samples.enc2], axis=1), counts[tick])
    assert not samples.flags[1:].any()


def test_the_self_test_of_three_axes_passes_in_the_simulator() -> None:
    scenario = with_sensor(load("first-light"), "adxl355")
    world, module = World(trial_truth(scenario, trial(scenario, "free_01"), 3)), board()
    module.serial_receive(command(1, "SELF_TEST"), 0)
    for _ in range(400):
        readings = world.read(module.next_tick_us, 1, self_test=module.self_test_pin)
        module.run(readings.adc, readings.encoder)
    for n, item in enumerate(("SELF_TEST_X_MV", "SELF_TEST_Y_MV", "SELF_TEST_Z_MV")):
        number = layout.code("COMMAND", "item", item)
        module.serial_receive(command(10 + n, "INFO", item=number), module.now_us)
    heard = SerialDecoder().feed(module.serial_take())
    statuses: Sequence[BoardStatus] = heard.statuses
    assert statuses[-1].self_test == layout.code("STATUS_HEALTH", "self_test", "PASSED")
    told = [response.value for response in heard.responses[-3:]]
    # The third axis carries gravity: of its 1.5 g there is room for 2.048 - 1 g, which is within the limits.
    assert told == pytest.approx([300, 300, 1048], abs=2)


def test_noise_and_gravity_of_a_resting_sensor() -> None:
    """22.5 ug/rtHz over the filter's noise bandwidth of about 280 Hz: 0.38 mg."""
    scenario = with_sensor(load("first-light"), "adxl355")
    world = World(trial_truth(scenario, trial(scenario, "free_01"), 3))
    codes = world.read(1000, 20_000).adc[100:, 0, :]
    in_g = (codes.astype(float) - 2**19) / 256_000
    assert in_g.std(axis=0) == pytest.approx([0.38e-3] * 3, rel=0.05)
    assert in_g[:, 2].mean() == pytest.approx(1.0, abs=1e-4)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A free motion of 30 s with the digital sensor."""
    folder = tmp_path_factory.mktemp("digital") / "study"
    scenario = with_sensor(load("first-light"), "adxl355")
    trials = (scenario.trials[0].model_copy(update={"duration_s": 30.0}),)
    write_study(scenario.model_copy(update={"trials": trials}), folder, 11)
    return folder


def test_acceleration_belongs_to_the_instant_of_the_encoders(study: Path) -> None:
    """The acceleration against the second derivative of the board's own encoders: gain 1, delay 0."""
    device = read_device_samples(study / "free_01" / "device.csv")
    assert isinstance(device, DeviceSamples)
    q = np.stack([device.enc1, device.enc2], axis=1) * 2 * np.pi / 400_000
    x = np.stack(
        [
            0.254 * np.cos(q[:, 0]) + 0.2667 * np.sin(q[:, 1]),
            0.254 * np.sin(q[:, 0]) - 0.2667 * np.cos(q[:, 1]),
        ],
        axis=1,
    )
    setup = read_setup(study / "setup.toml")
    assert setup.accelerometer is not None
    seen = specific_force(device, setup.accelerometer)
    cosine, sine = np.cos(q[:, 1]), np.sin(q[:, 1])
    in_base = np.stack(
        [cosine * seen[:, 0] - sine * seen[:, 1], sine * seen[:, 0] + cosine * seen[:, 1]], axis=1
    )
    low = butter(4, 8.0, fs=1000.0, output="sos")
    measured = sosfiltfilt(low, in_base, axis=0)[3000:-3000]
    twice = np.gradient(np.gradient(sosfiltfilt(low, x, axis=0), 1e-3, axis=0), 1e-3, axis=0)[3000:-3000]
    for axis in (0, 1):
        basis = np.stack([twice[:, axis], -np.gradient(twice[:, axis], 1e-3), np.ones(len(twice))], axis=1)
        gain, delay, _ = np.linalg.lstsq(basis, measured[:, axis], rcond=None)[0]
        assert gain == pytest.approx(1.0, abs=2e-3)
        assert abs(delay / gain) < 20e-6


def test_the_study_says_which_sensor_it_has(study: Path) -> None:
    setup = tomllib.loads((study / "setup.toml").read_text())["accelerometer"]
    assert (setup["part"], setup["full_scale_code"], setup["vref_V"]) == ("ADXL355", 1 << 24, 4.096)
    table = pyarrow.csv.read_csv(study / "free_01" / "device.csv")
    upright = table["az"].to_numpy() / 2**24 * 4.096 - 2.048
    assert upright.mean() == pytest.approx(1.0, abs=1e-4)
    assert not table["flags"].to_numpy()[1:].any()


def test_the_sensor_is_chosen_on_the_command_line(scenario_file, tmp_path: Path) -> None:
    command_line = ["study", str(scenario_file(1.0)), "--sensor", "adxl355", "--out", str(tmp_path / "study")]
    done = CliRunner().invoke(cli, command_line)
    assert done.exit_code == 0, done.output
    assert (
        (tmp_path / "study/free_01/device.csv").read_text().startswith("t_us,seq,ax,ay,enc1,enc2,flags,az\n")
    )


def test_a_scenario_may_have_the_sensor_itself(scenario_file) -> None:
    def digital(content: dict[str, Any]) -> None:
        content["setup"]["accelerometer"] |= {
            "part": "ADXL355", "vref_V": 4.096, "full_scale_code": 1 << 24,
            "zero_g_V": [2.048, 2.048], "sensitivity_V_per_g": [1.0, 1.0],
        }  # fmt: skip

    scenario = load(str(scenario_file(1.0, digital)))
    world = World(trial_truth(scenario, scenario.trials[0], 1))
    assert world.read(1000, 5).adc.shape == (5, 1, 3)
