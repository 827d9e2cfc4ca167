"""Device profiles: what a phone's parts can do, read from TOML, and the rates they answer a request with."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from posed.errors import InvalidArgumentError, ProfileError
from posed.events import ReportingMode, SensorInfo, SensorType
from posed.hal.calibration import Calibration
from posed.hal.quantisation import as_listed
from posed.hal.toml_table import TomlTable, close_match, parse_toml

UNCALIBRATED_TYPE: Mapping[SensorType, SensorType] = {
    SensorType.ACCELEROMETER: SensorType.ACCELEROMETER_UNCALIBRATED,
    SensorType.MAGNETIC_FIELD: SensorType.MAGNETIC_FIELD_UNCALIBRATED,
    SensorType.GYROSCOPE: SensorType.GYROSCOPE_UNCALIBRATED,
}
"""The three parts of a phone, each with the type of its uncalibrated stream."""


@dataclass(frozen=True, slots=True)
class ResidualErrors:
    """How far a calibrated sensor may still be off: bounds of constant errors, drawn once a simulated phone.

    bias: the sensor's unit, each axis. scale: fraction of the reading. misalignment: rad. hard_iron: uT, each axis.
    soft_iron: fraction of the field. The last two belong to a magnetometer, the first three to the others.
    """

    bias: float = 0.0
    scale: float = 0.0
    misalignment: float = 0.0
    hard_iron: float = 0.0
    soft_iron: float = 0.0


@dataclass(frozen=True, slots=True)
class SensorProfile:
    """One part of a phone. Range, resolution and errors in the sensor's own unit (m/s2, rad/s, uT)."""

    type: SensorType
    name: str
    vendor: str
    version: int
    max_range: float
    resolution: float
    power_ma: float
    rates_hz: tuple[float, ...]
    """The output rates the part has, ascending."""
    noise_density: float
    """White noise, unit/sqrt(Hz): the standard deviation of a sample is this times sqrt(rate)."""
    bias_walk: float = 0.0
    """Random walk of the bias, unit/sqrt(s): its standard deviation after t seconds is this times sqrt(t)."""
    timestamp_jitter_s: float = 0.0
    """Standard deviation of a timestamp about its even spacing, seconds."""
    delay_s: float = 0.0
    """Group delay of the part's low-pass: seconds by which a sample is older than its stamp, at most 0.1."""
    fifo_reserved: int = 0
    fifo_max: int = 0
    residual: ResidualErrors = ResidualErrors()

    def configured_rate_hz(self, sampling_period_ns: int) -> float:
        """Return the slowest rate (Hz) that is not slower than the period asked for, else the fastest there is.

        Raises InvalidArgumentError for a negative period; 0 asks for the fastest.
        """
        if sampling_period_ns < 0:
            raise InvalidArgumentError(f"sampling_period_ns = {sampling_period_ns}; allowed: 0 (fastest) or more")
        return _configured_rate_hz(self.rates_hz, sampling_period_ns)

    def configured_period_ns(self, sampling_period_ns: int) -> int:
        """Return the period (ns) of `configured_rate_hz`, rounded up so that asking for it again gives the same rate.

        Raises InvalidArgumentError for a negative period.
        """
        return exact_period_ns(self.configured_rate_hz(sampling_period_ns)).rounded_up()

    def sample_std(self, rate_hz: float) -> float:
        """Return the standard deviation of one sample at `rate_hz`, white noise and quantisation, sensor's unit."""
        return math.hypot(self.noise_density * math.sqrt(rate_hz), self.resolution / math.sqrt(12.0))

    @property
    def min_delay_us(self) -> int:
        """The period of the fastest rate in whole microseconds, rounded down."""
        return _min_delay_us(self.rates_hz)

    @property
    def max_delay_us(self) -> int:
        """The period of the slowest rate in whole microseconds, rounded up: truncated, 15 Hz would turn into 50."""
        return _max_delay_us(self.rates_hz)


@dataclass(frozen=True, slots=True)
class AmbientPart:
    """A part that reads one value of what surrounds the phone: pressure (hPa), light (lux) or proximity (cm).

    rates_hz: the output rates of a pressure sensor; the others tell of changes and have none. noise_density: white
    noise, unit/sqrt(Hz).
    """

    type: SensorType
    name: str
    vendor: str
    version: int
    max_range: float
    resolution: float
    power_ma: float
    rates_hz: tuple[float, ...] = ()
    noise_density: float = 0.0

    @property
    def mode(self) -> ReportingMode:
        """Whether it samples or tells of changes."""
        return ReportingMode.CONTINUOUS if self.rates_hz else ReportingMode.ON_CHANGE

    def configured_rate_hz(self, sampling_period_ns: int) -> float:
        """Return the slowest rate (Hz) that is not slower than the period asked for, else the fastest there is."""
        return _configured_rate_hz(self.rates_hz, sampling_period_ns)

    def configured_period_ns(self, sampling_period_ns: int) -> int:
        """Return the period (ns) that a request gets: of a part that tells of changes, the one asked for."""
        if not self.rates_hz:
            return sampling_period_ns
        return exact_period_ns(self.configured_rate_hz(sampling_period_ns)).rounded_up()

    def info(self) -> SensorInfo:
        """Return the sensor as Android lists it."""
        return as_listed(
            SensorInfo(
                handle=int(self.type),
                type=self.type,
                name=self.name,
                vendor=self.vendor,
                version=self.version,
                max_range=self.max_range,
                resolution=self.resolution,
                power_ma=self.power_ma,
                min_delay_us=_min_delay_us(self.rates_hz) if self.rates_hz else 0,
                max_delay_us=_max_delay_us(self.rates_hz) if self.rates_hz else 0,
                reporting_mode=self.mode,
                wake_up=self.type is SensorType.PROXIMITY,
            )
        )


@dataclass(frozen=True, slots=True)
class NoiseFigures:
    """The noise a filter should expect of a device.

    gyroscope_density: rad/s/sqrt(Hz). accelerometer_std (m/s2), magnetic_field_std (uT): one sample at the fastest
    rate, quantisation included.
    """

    gyroscope_density: float
    accelerometer_std: float
    magnetic_field_std: float


@dataclass(frozen=True)
class DeviceProfile:
    """A phone: its parts by type (accelerometer, magnetic field, gyroscope), each with its calibration."""

    name: str
    description: str
    sensors: Mapping[SensorType, SensorProfile]
    calibration: Mapping[SensorType, Calibration]
    camera_fov_deg: float = 67.0
    """Field of view of the back camera along the longer side of its image; the default is a 26 mm lens's."""
    ambient: tuple[AmbientPart, ...] = ()
    """Its pressure, light and proximity sensors, as far as it has them."""
    screen_rotation_deg: int = 0
    """How the phone is used: 0, 90, 180 or 270 from its natural orientation (Display.getRotation)."""

    def sensor_infos(self) -> tuple[SensorInfo, ...]:
        """Return the sensors as Android lists them, in handle order: three parts, each also uncalibrated.

        A sensor's handle is its type's number.
        """
        return self._infos

    def sensor(self, handle: int) -> SensorProfile:
        """Return the part behind a sensor handle, calibrated or not.

        Raises InvalidArgumentError for an unknown handle.
        """
        found = self._by_handle.get(handle)
        if found is None:
            known = ", ".join(f"{info.handle} ({info.type.name.lower()})" for info in self._infos)
            raise InvalidArgumentError(f"sensor handle {handle} is not of profile {self.name}; allowed: {known}")
        return found

    @property
    def noise(self) -> NoiseFigures:
        """The noise of the parts, as filters need it."""
        accelerometer = self.sensors[SensorType.ACCELEROMETER]
        magnetic_field = self.sensors[SensorType.MAGNETIC_FIELD]
        return NoiseFigures(
            gyroscope_density=self.sensors[SensorType.GYROSCOPE].noise_density,
            accelerometer_std=accelerometer.sample_std(accelerometer.rates_hz[-1]),
            magnetic_field_std=magnetic_field.sample_std(magnetic_field.rates_hz[-1]),
        )

    @cached_property
    def _infos(self) -> tuple[SensorInfo, ...]:
        infos = [_sensor_info(part, kind) for part in self.sensors.values() for kind in _kinds(part.type)]
        return tuple(sorted(infos, key=lambda info: info.handle))

    @cached_property
    def _by_handle(self) -> dict[int, SensorProfile]:
        return {int(kind): part for part in self.sensors.values() for kind in _kinds(part.type)}


class ExactPeriod(NamedTuple):
    """A period as a fraction of nanoseconds in lowest terms: a long run on it does not drift.

    The fractions module would do, but takes 0.6 MB of the daemon's memory.
    """

    numerator: int
    denominator: int

    def until(self, samples: int) -> int:
        """Return how long so many periods last, ns, rounded down."""
        return samples * self.numerator // self.denominator

    def samples_in(self, duration_ns: int) -> int:
        """Return how many whole periods there are in a duration."""
        return duration_ns * self.denominator // self.numerator

    def rounded_up(self) -> int:
        """Return the period in whole ns, rounded up."""
        return -(-self.numerator // self.denominator)


def exact_period_ns(rate_hz: float) -> ExactPeriod:
    """Return the exact period (ns) of a rate, kept to a millionth of a hertz: 15 Hz is 200000000/3."""
    microhertz = round(rate_hz * 1e6)
    common = math.gcd(10**15, microhertz)
    return ExactPeriod(10**15 // common, microhertz // common)


def _configured_rate_hz(rates_hz: tuple[float, ...], sampling_period_ns: int) -> float:
    for rate in rates_hz:
        if exact_period_ns(rate).samples_in(sampling_period_ns) >= 1:
            return rate
    return rates_hz[-1]


def _min_delay_us(rates_hz: tuple[float, ...]) -> int:
    return exact_period_ns(rates_hz[-1]).until(1) // 1000


def _max_delay_us(rates_hz: tuple[float, ...]) -> int:
    return -(-exact_period_ns(rates_hz[0]).rounded_up() // 1000)


def profile_names() -> tuple[str, ...]:
    """Return the names of the profiles that are shipped, sorted."""
    return tuple(sorted(file.name.removesuffix(".toml") for file in _SHIPPED.iterdir() if file.name.endswith(".toml")))


def load_profile(name_or_path: str) -> DeviceProfile:
    """Read a shipped profile by its name, or one's own by a path that ends in .toml.

    Raises InvalidArgumentError for a name that is not shipped, ProfileError for a file that is missing or malformed.
    """
    if name_or_path.endswith(".toml"):
        try:
            return _parse(name_or_path, Path(name_or_path).read_bytes())
        except OSError as error:
            raise ProfileError(f"{name_or_path}: {error.strerror}; give the path of a readable profile") from error
    if name_or_path not in profile_names():
        hint = close_match(name_or_path, profile_names())
        raise InvalidArgumentError(
            f"profile {name_or_path!r} is not shipped; allowed: {', '.join(profile_names())}, or a path ending in"
            f" .toml{hint}"
        )
    file = f"{name_or_path}.toml"
    return _parse(file, _SHIPPED.joinpath(file).read_bytes())


_SHIPPED = Path(__file__).with_name("profiles")


def _kinds(part: SensorType) -> tuple[SensorType, SensorType]:
    return part, UNCALIBRATED_TYPE[part]


def _sensor_info(part: SensorProfile, kind: SensorType) -> SensorInfo:
    return as_listed(
        SensorInfo(
            handle=int(kind),
            type=kind,
            name=part.name if kind is part.type else f"{part.name} Uncalibrated",
            vendor=part.vendor,
            version=part.version,
            max_range=part.max_range,
            resolution=part.resolution,
            power_ma=part.power_ma,
            min_delay_us=part.min_delay_us,
            max_delay_us=part.max_delay_us,
            fifo_reserved_event_count=part.fifo_reserved,
            fifo_max_event_count=part.fifo_max,
        )
    )


def _parse(file: str, content: bytes) -> DeviceProfile:
    try:
        values = parse_toml(content.decode())
    except ValueError as error:
        raise ProfileError(f"{file}: not TOML: {error}") from error
    root = TomlTable(file, "", values)
    name = root.text("name")
    description = root.text("description")
    sensors = {kind: _read_sensor(kind, root.table(kind.name.lower(), required=True)) for kind in UNCALIBRATED_TYPE}
    ambient = tuple(
        _read_ambient(kind, table) for kind in _AMBIENT if not (table := root.table(kind.name.lower())).is_empty
    )
    tables = root.table("calibration")
    calibration = {kind: _read_calibration(kind, tables.table(kind.name.lower())) for kind in UNCALIBRATED_TYPE}
    camera, screen = root.table("camera"), root.table("screen")
    fov_deg = camera.number("fov_deg", positive=True, default=DeviceProfile.camera_fov_deg)
    if fov_deg >= 180.0:
        raise camera.refusal("fov_deg", fov_deg, "more than 0 and less than 180")
    rotation_deg = screen.integer("rotation_deg", low=0, default=0)
    if rotation_deg not in (0, 90, 180, 270):
        raise screen.refusal("rotation_deg", rotation_deg, "0, 90, 180 or 270")
    for table in (tables, camera, screen, root):
        table.finish()
    return DeviceProfile(name, description, sensors, calibration, fov_deg, ambient, rotation_deg)


_AMBIENT = (SensorType.LIGHT, SensorType.PRESSURE, SensorType.PROXIMITY)


def _read_ambient(kind: SensorType, table: TomlTable) -> AmbientPart:
    samples = kind is SensorType.PRESSURE
    part = AmbientPart(
        type=kind,
        name=table.text("name"),
        vendor=table.text("vendor"),
        version=table.integer("version", low=1, default=1),
        max_range=table.number("max_range", positive=True),
        resolution=table.number("resolution", positive=True),
        power_ma=table.number("power_ma"),
        rates_hz=table.ascending("rates_hz") if samples else (),
        noise_density=table.number("noise_density", default=0.0) if samples else 0.0,
    )
    table.finish()
    if part.resolution > part.max_range:
        raise table.refusal("resolution", part.resolution, f"at most max_range, {part.max_range}")
    if samples:
        _check_rates(table, part.rates_hz)
    return part


def _read_sensor(kind: SensorType, table: TomlTable) -> SensorProfile:
    residual = table.table("residual")
    bounds = ("hard_iron", "soft_iron") if kind is SensorType.MAGNETIC_FIELD else ("bias", "scale", "misalignment")
    sensor = SensorProfile(
        type=kind,
        name=table.text("name"),
        vendor=table.text("vendor"),
        version=table.integer("version", low=1, default=1),
        max_range=table.number("max_range", positive=True),
        resolution=table.number("resolution", positive=True),
        power_ma=table.number("power_ma"),
        rates_hz=table.ascending("rates_hz"),
        noise_density=table.number("noise_density"),
        bias_walk=table.number("bias_walk", default=0.0),
        timestamp_jitter_s=table.number("timestamp_jitter_s", default=0.0),
        delay_s=table.number("delay_s", default=0.0),
        fifo_reserved=table.integer("fifo_reserved", low=0, default=0),
        fifo_max=table.integer("fifo_max", low=0, default=0),
        residual=ResidualErrors(**{bound: residual.number(bound, default=0.0) for bound in bounds}),
    )
    residual.finish()
    table.finish()
    if sensor.fifo_reserved > sensor.fifo_max:
        raise table.refusal("fifo_reserved", sensor.fifo_reserved, f"at most fifo_max, {sensor.fifo_max}")
    if sensor.delay_s > _LONGEST_DELAY_S:
        raise table.refusal("delay_s", sensor.delay_s, f"seconds up to {_LONGEST_DELAY_S}, usually thousandths")
    if sensor.resolution > sensor.max_range:
        raise table.refusal("resolution", sensor.resolution, f"at most max_range, {sensor.max_range}")
    _check_rates(table, sensor.rates_hz)
    return sensor


def _check_rates(table: TomlTable, rates_hz: tuple[float, ...]) -> None:
    if rates_hz[0] < _LOWEST_RATE_HZ or rates_hz[-1] > _HIGHEST_RATE_HZ:
        raise table.refusal("rates_hz", list(rates_hz), f"rates from {_LOWEST_RATE_HZ} up to {_HIGHEST_RATE_HZ} Hz")


_LONGEST_DELAY_S = 0.1
"""What filters make good; the low-passes of phone parts take a tenth of it."""
_LOWEST_RATE_HZ = 0.01
"""Slower than any part; a period is exact to a millionth of a hertz."""
_HIGHEST_RATE_HZ = 1000
"""Android's sensor service asks no sensor for a period below 1 ms (SensorDevice.cpp, MINIMUM_EVENTS_PERIOD)."""


def _read_calibration(kind: SensorType, table: TomlTable) -> Calibration:
    if kind is SensorType.MAGNETIC_FIELD:
        calibration = Calibration(table.vector("hard_iron", np.zeros(3)), table.matrix("soft_iron"))
    else:
        scale = table.vector("scale", np.ones(3))
        if not scale.all():
            raise table.refusal("scale", scale.tolist(), "3 numbers, none of them 0")
        calibration = Calibration(table.vector("bias", np.zeros(3)), table.matrix("misalignment") * scale)
    table.finish()
    return calibration
