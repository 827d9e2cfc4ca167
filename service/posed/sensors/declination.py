"""Where magnetic north lies from the true one, by the World Magnetic Model."""

import datetime
import importlib.util
import math
from collections.abc import Callable
from functools import lru_cache

from posed.events import Position


def declination_at(position: Position | None) -> Callable[[], float] | None:
    """Return what tells the declination there (rad, east positive), None without a position or pygeomag.

    The model (WMM 2025) is loaded when it is first asked, for the day then.
    """
    if position is None or importlib.util.find_spec("pygeomag") is None:
        return None

    @lru_cache(maxsize=1)
    def declination() -> float:
        from pygeomag import GeoMag, calculate_decimal_year

        model = GeoMag(coefficients_file="wmm/WMM_2025.COF")
        found = model.calculate(
            glat=position.latitude_deg,
            glon=position.longitude_deg,
            alt=position.height_m / 1000.0,
            time=calculate_decimal_year(datetime.datetime.now()),
            allow_date_outside_lifespan=True,
        )
        return math.radians(found.d)

    return declination
