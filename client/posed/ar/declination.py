"""Magnetic declination where nobody states it: from the World Magnetic Model."""

import datetime
from functools import lru_cache

from pygeomag import GeoMag


def wmm_declination_deg(latitude_deg: float, longitude_deg: float, date: datetime.date) -> float:
    """Return the declination of WMM 2025 at sea level, degrees, east positive.

    The model is made for 2025 to 2029 and goes on beyond with its last rates. Heights are left out: ten kilometres
    change the declination by less than a tenth of a degree where it is of any use.
    """
    year_days = (datetime.date(date.year + 1, 1, 1) - datetime.date(date.year, 1, 1)).days
    year = date.year + (date - datetime.date(date.year, 1, 1)).days / year_days
    # Two decimals are a kilometre: a phone that moves about does not ask for the model anew.
    return _declination_deg(round(latitude_deg, 2), round(longitude_deg, 2), round(year, 2))


@lru_cache(maxsize=64)
def _declination_deg(latitude_deg: float, longitude_deg: float, year: float) -> float:
    model = GeoMag(coefficients_file="wmm/WMM_2025.COF")
    found = model.calculate(glat=latitude_deg, glon=longitude_deg, alt=0, time=year, allow_date_outside_lifespan=True)
    return round(float(found.d), 3)
