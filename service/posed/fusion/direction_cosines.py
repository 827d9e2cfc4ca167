"""The direction cosine matrix as nine scalars, and what is done to it."""

from dataclasses import dataclass
from math import cos, sin, sqrt

_TURNS_TO_ROUNDING = 16
"""Turns after which rounding is undone. It costs a fifth of a turn, and a turn loses 2e-16 at most."""


@dataclass
class DirectionCosines:
    """The rotation matrix from device to world (ENU) by rows: north and up in device axes; east is their product."""

    north_x: float = 0.0
    north_y: float = 1.0
    north_z: float = 0.0
    up_x: float = 0.0
    up_y: float = 0.0
    up_z: float = 1.0
    turns: int = 0
    """Since rounding was last undone."""

    @property
    def east_x(self) -> float:
        return self.north_y * self.up_z - self.north_z * self.up_y

    @property
    def east_y(self) -> float:
        return self.north_z * self.up_x - self.north_x * self.up_z

    @property
    def east_z(self) -> float:
        return self.north_x * self.up_y - self.north_y * self.up_x

    def rotate(self, x: float, y: float, z: float) -> None:
        """Turn the device by a rotation vector in its own axes (rad): C <- C exp([x y z]x), exactly (Rodrigues).

        Patonis 2018, Eq. 3, which is its first order.
        """
        angle2 = x * x + y * y + z * z
        if angle2 < 1e-3:
            # Below 0.03 rad the series are exact to the last bit, cheaper, and free of the cancellation in 1 - cos.
            # The points matter: compiled, 1 / 6 would be a division of integers.
            a = 1.0 - angle2 * (1.0 / 6.0 - angle2 * (1.0 / 120.0 - angle2 * (1.0 / 5040.0)))
            b = 0.5 - angle2 * (1.0 / 24.0 - angle2 * (1.0 / 720.0 - angle2 * (1.0 / 40320.0)))
        else:
            angle = sqrt(angle2)
            a = sin(angle) / angle
            b = (1.0 - cos(angle)) / angle2
        bx = b * x
        by = b * y
        xx = bx * x
        xy = bx * y
        xz = bx * z
        yy = by * y
        yz = by * z
        zz = b * z * z
        x *= a
        y *= a
        z *= a
        r00 = 1.0 - yy - zz
        r11 = 1.0 - xx - zz
        r22 = 1.0 - xx - yy
        r01 = xy + z
        r10 = xy - z
        r02 = xz - y
        r20 = xz + y
        r12 = yz + x
        r21 = yz - x
        x = self.up_x
        y = self.up_y
        z = self.up_z
        self.up_x = r00 * x + r01 * y + r02 * z
        self.up_y = r10 * x + r11 * y + r12 * z
        self.up_z = r20 * x + r21 * y + r22 * z
        x = self.north_x
        y = self.north_y
        z = self.north_z
        self.north_x = r00 * x + r01 * y + r02 * z
        self.north_y = r10 * x + r11 * y + r12 * z
        self.north_z = r20 * x + r21 * y + r22 * z
        self.turns += 1
        if self.turns == _TURNS_TO_ROUNDING:
            self._undo_rounding()

    def rebuild(
        self, ux: float, uy: float, uz: float, gain: float, north_x: float, north_y: float, north_z: float
    ) -> None:
        """Build C from a new row 3 (unit vector u) and the heading column, corrected by `gain` towards a measured
        north (device axes, unit vector, square to u; not looked at if `gain` is 0).

        The column follows the axis that is most nearly vertical, cyclically: z up takes x, x up takes y, y up takes z
        (Patonis 2018, Fig. 1), so its axis is never further than 45 degrees from the horizon. With p that axis,
        v = e_p - C[2, p] u and w = u x e_p span the horizon and are equally long; rows 1 and 2 are the combinations
        that reproduce the column: Eq. 1 without its angles.
        """
        across_x = abs(ux)
        across_y = abs(uy)
        across_z = abs(uz)
        if across_z >= across_x and across_z >= across_y:
            north = self.north_x
            east = self.north_y * self.up_z - self.north_z * self.up_y
            if gain > 0.0:
                north += gain * (north_x - north)
                east += gain * (north_y * uz - north_z * uy - east)
            length2 = 1.0 - ux * ux
        elif across_x >= across_y:
            north = self.north_y
            east = self.north_z * self.up_x - self.north_x * self.up_z
            if gain > 0.0:
                north += gain * (north_y - north)
                east += gain * (north_z * ux - north_x * uz - east)
            length2 = 1.0 - uy * uy
        else:
            north = self.north_z
            east = self.north_x * self.up_y - self.north_y * self.up_x
            if gain > 0.0:
                north += gain * (north_z - north)
                east += gain * (north_x * uy - north_y * ux - east)
            length2 = 1.0 - uz * uz
        column2 = east * east + north * north
        if column2 < 1e-12:
            # Row 3 was just set afresh and the axis stood upright before: any heading will do, none is known.
            east = 0.0
            north = column2 = 1.0
        length = sqrt(length2 * column2)
        east /= length
        north /= length
        self.up_x = ux
        self.up_y = uy
        self.up_z = uz
        if across_z >= across_x and across_z >= across_y:
            self.north_x = north * length2
            self.north_y = east * uz - north * ux * uy
            self.north_z = -east * uy - north * ux * uz
        elif across_x >= across_y:
            self.north_x = -east * uz - north * ux * uy
            self.north_y = north * length2
            self.north_z = east * ux - north * uy * uz
        else:
            self.north_x = east * uy - north * ux * uz
            self.north_y = -east * ux - north * uy * uz
            self.north_z = north * length2

    def face(self, ux: float, uy: float, uz: float) -> None:
        """Take a unit vector (device axes) as up, and as north what is square to it along the most level device axis.

        Of x and y the more level one counts first, so a phone held upright or flat faces along an edge.
        """
        across_x = abs(ux)
        across_y = abs(uy)
        if across_y <= across_x:
            x, y, z = -uy * ux, 1.0 - uy * uy, -uy * uz
        else:
            x, y, z = 1.0 - ux * ux, -ux * uy, -ux * uz
        norm = sqrt(x * x + y * y + z * z)
        self.north_x = x / norm
        self.north_y = y / norm
        self.north_z = z / norm
        self.up_x = ux
        self.up_y = uy
        self.up_z = uz

    def tilt(self, x: float, y: float, z: float) -> None:
        """Make the world direction (x, y, z) (unit vector, not down) the new vertical by the smallest rotation."""
        ux = self.up_x
        uy = self.up_y
        uz = self.up_z
        north_x = self.north_x
        north_y = self.north_y
        north_z = self.north_z
        self.up_x = vx = x * (north_y * uz - north_z * uy) + y * north_x + z * ux
        self.up_y = vy = x * (north_z * ux - north_x * uz) + y * north_y + z * uy
        self.up_z = vz = x * (north_x * uy - north_y * ux) + y * north_z + z * uz
        fold = y / (1.0 + z)
        self.north_x = north_x - fold * (ux + vx)
        self.north_y = north_y - fold * (uy + vy)
        self.north_z = north_z - fold * (uz + vz)
        self.turns += 1
        if self.turns == _TURNS_TO_ROUNDING:
            self._undo_rounding()

    def quaternion(self) -> tuple[float, float, float, float]:
        """Return the rotation as (x, y, z, w), device to world, w >= 0.

        The largest of the four elements is found first and divides the others (Shepperd 1978), so none loses digits.
        """
        xx = self.north_y * self.up_z - self.north_z * self.up_y
        yy = self.north_y
        zz = self.up_z
        east_y = self.north_z * self.up_x - self.north_x * self.up_z
        east_z = self.north_x * self.up_y - self.north_y * self.up_x
        trace = xx + yy + zz
        x = self.up_y - self.north_z
        y = east_z - self.up_x
        z = self.north_x - east_y
        w = 1.0 + trace
        if trace < xx or trace < yy or trace < zz:
            if xx >= yy and xx >= zz:
                x, y, z, w = 1.0 + xx - yy - zz, self.north_x + east_y, self.up_x + east_z, x
            elif yy >= zz:
                x, y, z, w = self.north_x + east_y, 1.0 - xx + yy - zz, self.up_y + self.north_z, y
            else:
                x, y, z, w = self.up_x + east_z, self.up_y + self.north_z, 1.0 - xx - yy + zz, z
        norm = sqrt(x * x + y * y + z * z + w * w)
        if w < 0.0:
            norm = -norm
        return x / norm, y / norm, z / norm, w / norm

    def _undo_rounding(self) -> None:
        """Make the rows unit vectors square to each other again.

        So little is to be undone that one step of Newton's iteration stands in for the square root.
        """
        self.turns = 0
        ux = self.up_x
        uy = self.up_y
        uz = self.up_z
        scale = 1.5 - 0.5 * (ux * ux + uy * uy + uz * uz)
        self.up_x = ux = scale * ux
        self.up_y = uy = scale * uy
        self.up_z = uz = scale * uz
        lean = self.north_x * ux + self.north_y * uy + self.north_z * uz
        x = self.north_x - lean * ux
        y = self.north_y - lean * uy
        z = self.north_z - lean * uz
        scale = 1.5 - 0.5 * (x * x + y * y + z * z)
        self.north_x = scale * x
        self.north_y = scale * y
        self.north_z = scale * z
