"""Device profiles: the paper's rates, the shipped files, and what a malformed file is told."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from posed.errors import InvalidArgumentError, ProfileError
from posed.events import RateMode, SensorType
from posed.hal.profile import DeviceProfile, SensorProfile, load_profile, profile_names

ACCELEROMETER, MAGNETIC_FIELD, GYROSCOPE = SensorType.ACCELEROMETER, SensorType.MAGNETIC_FIELD, SensorType.GYROSCOPE

MINIMAL = """
name = "mine"
description = "a phone of one's own"

[accelerometer]
name = "A"
vendor = "V"
max_range = 40
resolution = 0.01
power_ma = 0.1
rates_hz = [15, 50]
noise_density = 0.001

[gyroscope]
name = "G"
vendor = "V"
max_range = 10
resolution = 0.001
power_ma = 1
rates_hz = [50]
noise_density = 0.0001

[magnetic_field]
name = "M"
vendor = "V"
max_range = 2000
resolution = 0.1
power_ma = 1
rates_hz = [12.5, 25]
noise_density = 0.1
"""


@pytest.fixture
def tablet() -> DeviceProfile:
    return load_profile("patonis2018")


def write(folder: Path, text: str) -> str:
    file = folder / "mine.toml"
    file.write_text(text)
    return str(file)


@pytest.mark.parametrize(
    ("mode", "accelerometer", "gyroscope", "magnetic_field", "events"),
    [
        (RateMode.NORMAL, 15, 5, 5, 25),
        (RateMode.UI, 15, 15, 15, 45),
        (RateMode.GAME, 50, 50, 50, 150),
        (RateMode.FASTEST, 100, 200, 50, 350),
    ],
)
def test_tablet_reproduces_table_2(
    tablet: DeviceProfile, mode: RateMode, accelerometer: int, gyroscope: int, magnetic_field: int, events: int
) -> None:
    period_ns = mode.sampling_period_us * 1000
    rates = {kind: part.configured_rate_hz(period_ns) for kind, part in tablet.sensors.items()}
    assert rates == {ACCELEROMETER: accelerometer, MAGNETIC_FIELD: magnetic_field, GYROSCOPE: gyroscope}
    assert sum(rates.values()) == events


def test_table_2_survives_the_clamp_to_the_delays(tablet: DeviceProfile) -> None:
    for kind, slowest, fastest in ((ACCELEROMETER, 15, 100), (GYROSCOPE, 5, 200), (MAGNETIC_FIELD, 5, 50)):
        part = tablet.sensors[kind]
        assert part.configured_rate_hz(part.max_delay_us * 1000) == slowest
        assert part.configured_rate_hz(part.min_delay_us * 1000) == fastest


def test_delays_of_15_hz_enclose_its_period() -> None:
    part = sensor(rates_hz=(15.0,))
    assert (part.min_delay_us, part.max_delay_us) == (66_666, 66_667)


def sensor(rates_hz: tuple[float, ...]) -> SensorProfile:
    return dataclasses.replace(load_profile("patonis2018").sensors[GYROSCOPE], rates_hz=rates_hz)


@pytest.mark.parametrize(
    ("period_ns", "rate_hz", "configured_ns"),
    [
        (0, 200, 5_000_000),
        (4_999_999, 200, 5_000_000),
        (5_000_000, 200, 5_000_000),
        (19_999_999, 200, 5_000_000),
        (20_000_000, 50, 20_000_000),
        (66_666_666, 50, 20_000_000),
        (66_666_667, 15, 66_666_667),
        (100_000_000, 15, 66_666_667),
        (10**12, 5, 200_000_000),
    ],
)
def test_slowest_rate_not_slower_than_the_request(
    tablet: DeviceProfile, period_ns: int, rate_hz: float, configured_ns: int
) -> None:
    gyroscope = tablet.sensors[GYROSCOPE]
    assert gyroscope.configured_rate_hz(period_ns) == rate_hz
    assert gyroscope.configured_period_ns(period_ns) == configured_ns


@pytest.mark.parametrize("name", profile_names())
def test_asking_for_the_configured_period_again_changes_nothing(name: str) -> None:
    for part in load_profile(name).sensors.values():
        for rate in part.rates_hz:
            again = part.configured_period_ns(part.configured_period_ns(round(1.2e9 / rate)))
            assert again == part.configured_period_ns(round(1.2e9 / rate))


def test_negative_period_is_refused(tablet: DeviceProfile) -> None:
    with pytest.raises(InvalidArgumentError, match="sampling_period_ns = -1; allowed: 0"):
        tablet.sensors[GYROSCOPE].configured_period_ns(-1)


def test_three_profiles_are_shipped() -> None:
    assert profile_names() == ("cdd-minimum", "modern", "patonis2018")
    for name in profile_names():
        profile = load_profile(name)
        assert profile.name == name
        assert all(calibration.is_identity for calibration in profile.calibration.values())


def test_resolutions_are_those_of_table_1(tablet: DeviceProfile) -> None:
    resolutions = {kind: part.resolution for kind, part in tablet.sensors.items()}
    assert resolutions == {ACCELEROMETER: 0.038, GYROSCOPE: 2.66316e-4, MAGNETIC_FIELD: 0.060}


def test_modern_phone_has_the_median_top_rates() -> None:
    tops = {kind: part.rates_hz[-1] for kind, part in load_profile("modern").sensors.items()}
    assert tops == {ACCELEROMETER: 200, GYROSCOPE: 400, MAGNETIC_FIELD: 100}


@pytest.mark.parametrize("name", profile_names())
def test_every_shipped_profile_meets_the_compatibility_definition(name: str) -> None:
    profile = load_profile(name)
    accelerometer, gyroscope, magnetic_field = (
        profile.sensors[kind] for kind in (ACCELEROMETER, GYROSCOPE, MAGNETIC_FIELD)
    )
    assert accelerometer.rates_hz[-1] >= 50
    assert gyroscope.rates_hz[-1] >= 50
    assert magnetic_field.rates_hz[-1] >= 10
    assert accelerometer.max_range >= 4 * 9.80665
    assert magnetic_field.max_range >= 900
    assert 2 * accelerometer.max_range / accelerometer.resolution >= 2**12
    assert 2 * gyroscope.max_range / gyroscope.resolution >= 2**12
    assert magnetic_field.resolution <= 0.6
    assert profile.noise.accelerometer_std <= 0.05
    assert profile.noise.magnetic_field_std <= 1.5
    assert profile.noise.gyroscope_density**2 <= 1e-7


def test_minimum_phone_is_at_the_limits() -> None:
    noise = load_profile("cdd-minimum").noise
    assert noise.accelerometer_std == pytest.approx(0.05, rel=0.01)
    assert noise.magnetic_field_std == pytest.approx(1.5, rel=0.01)
    assert noise.gyroscope_density**2 == pytest.approx(1e-7, rel=0.01)


def test_sensors_are_listed_in_handle_order_with_their_uncalibrated_forms(tablet: DeviceProfile) -> None:
    infos = tablet.sensor_infos()
    assert [info.handle for info in infos] == [1, 2, 4, 14, 16, 35]
    assert all(info.handle == int(info.type) for info in infos)
    assert len({info.name for info in infos}) == 6
    gyroscope = infos[2]
    assert (gyroscope.min_delay_us, gyroscope.max_delay_us) == (5_000, 200_000)
    assert all(0 <= info.fifo_reserved_event_count <= info.fifo_max_event_count for info in infos)


def test_part_behind_a_handle(tablet: DeviceProfile) -> None:
    assert tablet.sensor(4) is tablet.sensor(16) is tablet.sensors[GYROSCOPE]
    with pytest.raises(InvalidArgumentError, match=r"handle 5 .*allowed: 1 \(accelerometer\), 2 \(magnetic_field\)"):
        tablet.sensor(5)


def test_own_profile_is_read_by_path(tmp_path: Path) -> None:
    profile = load_profile(write(tmp_path, MINIMAL))
    assert profile.name == "mine"
    assert profile.sensors[MAGNETIC_FIELD].rates_hz == (12.5, 25.0)
    assert profile.sensors[ACCELEROMETER].fifo_max == 0


def test_calibration_is_matrix_times_raw_minus_bias(tmp_path: Path) -> None:
    text = """
[calibration.accelerometer]
bias = [0.1, 0.2, 0.3]
scale = [1.01, 0.99, 1.02]
misalignment = [[1, 0.01, 0], [0, 1, 0.02], [0, 0, 1]]
[calibration.magnetic_field]
hard_iron = [30, -20, 10]
soft_iron = [[1.1, 0, 0], [0, 0.9, 0.05], [0, 0.05, 1]]
"""
    calibration = load_profile(write(tmp_path, MINIMAL + text)).calibration
    raw = np.array([[1.0, 2.0, 3.0], [40.0, -10.0, 25.0]])
    expected = np.diag([1.01, 0.99, 1.02]) @ (raw[0] - [0.1, 0.2, 0.3])
    expected[0] += 0.01 * expected[1]
    expected[1] += 0.02 * expected[2]
    np.testing.assert_allclose(calibration[ACCELEROMETER].apply(raw)[0], expected)
    np.testing.assert_allclose(calibration[MAGNETIC_FIELD].apply(raw)[1], [11.0, 9.75, 15.5])
    for each in calibration.values():
        np.testing.assert_allclose(each.invert(each.apply(raw)), raw)
    assert calibration[GYROSCOPE].apply(raw) is raw


@pytest.mark.parametrize(
    ("old", "new", "key", "allowed"),
    [
        ('name = "mine"', "", "name is missing", "allowed: a string"),
        ('name = "mine"', "name = 3", "name = 3", "allowed: a string that is not blank"),
        ('description = "a phone of one\'s own"', 'description = " "', "description = ' '", "not blank"),
        ("[gyroscope]", "[gyro]", "gyroscope is missing", "allowed: a table"),
        ('name = "mine"', 'name = "mine"\ncalibration = 1', "calibration = 1", "allowed: a table"),
        ("max_range = 40", "", "accelerometer.max_range is missing", "a number above 0"),
        ("max_range = 40", "max_range = 0", "accelerometer.max_range = 0", "a number above 0"),
        ("max_range = 40", 'max_range = "4 g"', "accelerometer.max_range = '4 g'", "a number above 0"),
        ("max_range = 40", "max_range = true", "accelerometer.max_range = True", "a number above 0"),
        ("max_range = 40", "max_range = inf", "accelerometer.max_range = inf", "a number above 0"),
        ("resolution = 0.001", "resolution = 11", "gyroscope.resolution = 11", "at most max_range, 10"),
        ("power_ma = 0.1", "power_ma = -1", "accelerometer.power_ma = -1", "a number, 0 or more"),
        ("rates_hz = [15, 50]", "rates_hz = []", "accelerometer.rates_hz = []", "ascending"),
        ("rates_hz = [15, 50]", "rates_hz = 50", "accelerometer.rates_hz = 50", "ascending"),
        ("rates_hz = [15, 50]", "rates_hz = [50, 15]", "accelerometer.rates_hz = [50, 15]", "ascending"),
        ("rates_hz = [15, 50]", "rates_hz = [15, 15]", "accelerometer.rates_hz = [15, 15]", "none twice"),
        ("rates_hz = [15, 50]", "rates_hz = [0, 15]", "accelerometer.rates_hz = [0, 15]", "above 0"),
        ("rates_hz = [15, 50]", "rates_hz = [nan]", "accelerometer.rates_hz = [nan]", "above 0"),
        ("rates_hz = [15, 50]", "rates_hz = [1e-7, 200]", "rates_hz = [1e-07, 200.0]", "from 0.01 up to 1000 Hz"),
        ("max_range = 40", f"max_range = {10**400}", "accelerometer.max_range = 1000", "a number above 0"),
        ("rates_hz = [15, 50]", f"rates_hz = [15, {10**400}]", "accelerometer.rates_hz = [15, 1000", "ascending"),
        ("noise_density = 0.1", "noise_density = 0.1\nversion = 10000000000", "version = 10000000000", "2147483647"),
        ("noise_density = 0.1", "noise_density = 0.1\nfifo_max = 2147483648", "fifo_max = 2147483648", "2147483647"),
        ("rates_hz = [15, 50]", "rates_hz = [2000]", "accelerometer.rates_hz = [2000.0]", "up to 1000 Hz"),
        (
            "noise_density = 0.1",
            "noise_density = 0.1\ndelay_s = -0.003",
            "magnetic_field.delay_s = -0.003",
            "0 or more",
        ),
        ("noise_density = 0.1", "noise_density = 0.1\ndelay_s = 3", "magnetic_field.delay_s = 3", "seconds up to 0.1"),
        ("noise_density = 0.1", "noise_density = nan", "magnetic_field.noise_density = nan", "0 or more"),
        ("noise_density = 0.1", "noise_density = 0.1\nversion = 0", "magnetic_field.version = 0", "an integer, 1"),
        ("noise_density = 0.1", "noise_density = 0.1\nfifo_reserved = 9", "fifo_reserved = 9", "at most fifo_max, 0"),
        ("noise_density = 0.1", "noise_density = 0.1\nfifo_max = 1.5", "fifo_max = 1.5", "an integer, 0 or more"),
    ],
)
def test_malformed_value_names_file_key_value_and_what_is_allowed(
    tmp_path: Path, old: str, new: str, key: str, allowed: str
) -> None:
    assert old in MINIMAL
    file = write(tmp_path, MINIMAL.replace(old, new, 1))
    with pytest.raises(ProfileError) as raised:
        load_profile(file)
    message = str(raised.value)
    assert message.startswith(f"{file}: ")
    assert key in message
    assert allowed in message


@pytest.mark.parametrize(
    ("added", "key", "allowed"),
    [
        ("[magnetic_field.residual]\nbias = 1", "unknown key magnetic_field.residual.bias", "hard_iron, soft_iron"),
        ("[accelerometer.residual]\nscale = -1", "accelerometer.residual.scale = -1", "a number, 0 or more"),
        ("[calibration.gyroscope]\nbias = [1, 2]", "calibration.gyroscope.bias = [1, 2]", "a list of 3 numbers"),
        (
            "[calibration.gyroscope]\nscale = [1, 0, 1]",
            "calibration.gyroscope.scale = [1.0, 0.0, 1.0]",
            "none of them 0",
        ),
        ("[calibration.gyroscope]\nmisalignment = [1, 2, 3]", "misalignment = [1, 2, 3]", "a list of 3 rows of 3"),
        (
            "[calibration.magnetic_field]\nsoft_iron = [[1, 0, 0], [1, 0, 0], [0, 0, 1]]",
            "calibration.magnetic_field.soft_iron",
            "a matrix that can be inverted",
        ),
        ("[calibration.magnetic_field]\nbias = [1, 2, 3]", "unknown key calibration.magnetic_field.bias", "hard_iron"),
        ("[camera]\nfov_deg = 180", "camera.fov_deg = 180", "less than 180"),
        ("[screen]\nrotation_deg = 45", "screen.rotation_deg = 45", "0, 90, 180 or 270"),
        ("[calibration.compass]", "unknown key calibration.compass", "accelerometer, gyroscope, magnetic_field"),
    ],
)
def test_malformed_optional_tables(tmp_path: Path, added: str, key: str, allowed: str) -> None:
    file = write(tmp_path, f"{MINIMAL}\n{added}\n")
    with pytest.raises(ProfileError) as raised:
        load_profile(file)
    message = str(raised.value)
    assert message.startswith(f"{file}: ")
    assert key in message
    assert allowed in message


def test_camera_and_screen(tmp_path: Path) -> None:
    phone = load_profile(write(tmp_path, f"{MINIMAL}\n[camera]\nfov_deg = 80\n[screen]\nrotation_deg = 270\n"))
    assert (phone.camera_fov_deg, phone.screen_rotation_deg) == (80.0, 270)
    plain = load_profile(write(tmp_path, MINIMAL))
    assert (plain.camera_fov_deg, plain.screen_rotation_deg) == (67.0, 0)


def test_unknown_key_names_the_allowed_ones_and_the_nearest(tmp_path: Path) -> None:
    file = write(tmp_path, MINIMAL.replace("power_ma = 0.1", "power_mA = 0.1\npower_ma = 0.1"))
    with pytest.raises(
        ProfileError, match=r"unknown key accelerometer\.power_mA; allowed in \[accelerometer\]: bias_walk,"
    ):
        load_profile(file)
    with pytest.raises(ProfileError, match=r"did you mean power_ma\?"):
        load_profile(file)


def test_files_that_are_no_profile(tmp_path: Path) -> None:
    with pytest.raises(ProfileError, match=r"mine\.toml: not TOML: "):
        load_profile(write(tmp_path, "name = "))
    for beyond in ("1" * 5000, f"0x{'f' * 5000}", "[" * 3000 + "]" * 3000):
        with pytest.raises(ProfileError, match=r"mine\.toml: not TOML: an integer of thousands of digits, or arrays"):
            load_profile(write(tmp_path, f"name = {beyond}\n"))
    with pytest.raises(ProfileError, match="nested too deep"):
        load_profile(write(tmp_path, f"name{'.a' * 3000} = 1\n"))
    (tmp_path / "latin.toml").write_bytes(b'name = "\xe9"')
    with pytest.raises(ProfileError, match=r"latin\.toml: not TOML: "):
        load_profile(str(tmp_path / "latin.toml"))
    with pytest.raises(ProfileError, match=r"absent\.toml: No such file"):
        load_profile(str(tmp_path / "absent.toml"))


def test_unknown_name_lists_the_shipped_ones() -> None:
    with pytest.raises(InvalidArgumentError, match=r"'moderm' .*allowed: cdd-minimum, modern, .*did you mean modern"):
        load_profile("moderm")
