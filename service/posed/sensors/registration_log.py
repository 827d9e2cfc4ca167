"""The last registrations, as `dumpsys sensorservice` shows them (SensorRegistrationInfo.h)."""

from collections import deque
from dataclasses import dataclass

from posed.sensors.client import Client

_SIZE = 500


@dataclass(frozen=True, slots=True)
class RegistrationRecord:
    """One enable, or one disable: then the periods are not of interest."""

    boot_ns: int
    activated: bool
    handle: int
    client: Client
    sampling_period_us: int = 0
    max_report_latency_us: int = 0


class RegistrationLog:
    """A ring of records."""

    def __init__(self) -> None:
        self._records: deque[RegistrationRecord] = deque(maxlen=_SIZE)

    def add(self, record: RegistrationRecord) -> None:
        """Note a record; the oldest goes."""
        self._records.append(record)

    def newest_first(self) -> list[RegistrationRecord]:
        """Return the records, the newest first."""
        return list(reversed(self._records))
