"""What a program says of itself when it binds, as an Android app's manifest does."""

import sys
from dataclasses import dataclass, field
from pathlib import Path

ACTIVITY_RECOGNITION = "android.permission.ACTIVITY_RECOGNITION"
"""Needed for step detector and step counter."""
HIGH_SAMPLING_RATE_SENSORS = "android.permission.HIGH_SAMPLING_RATE_SENSORS"
"""Lets a package sample accelerometer, gyroscope and magnetometer faster than 200 Hz."""

_CAPPING_SDK = 31


def _program_name() -> str:
    name = Path(sys.argv[0] if sys.argv else "").stem
    return "python" if name in ("", "-c", "__main__") else name


@dataclass(frozen=True, slots=True)
class Package:
    """One program. The user and process that it is, the daemon learns from the kernel.

    target_sdk: the Android API level it is written for. permissions: Android's names of those it declares. debuggable:
    True has it told by an exception, not by silence, that it asks for more than it may.
    """

    name: str = field(default_factory=_program_name)
    target_sdk: int = 35
    permissions: tuple[str, ...] = ()
    debuggable: bool = False

    @property
    def is_rate_capped(self) -> bool:
        """True if 200 Hz is the most it gets of accelerometer, gyroscope and magnetometer."""
        return self.target_sdk >= _CAPPING_SDK and HIGH_SAMPLING_RATE_SENSORS not in self.permissions
