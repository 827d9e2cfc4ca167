"""The direction cosine matrix as nine scalars, and what is done to it."""

from dataclasses import dataclass
from math import cos, sin, sqrt


@dataclass
class DirectionCosines:
    """The rotation matrix from device to world (ENU) by rows: east, north and up in device axes."""

    east_x: float = 1.0
    east_y: float = 0.0
    east_z: float = 0.0
    north_x: float = 0.0
    north_y: float = 1.0
    north_z: float = 0.0
    up_x: float = 0.0
    up_y: float = 0.0
    up_z: float = 1.0

    def rotate(self, x: float, y: float, z: float) -> None:
        """Turn the device by a rotation vector in its own axes (rad): C <- C exp([x y z]x), exactly (Rodrigues).

        Patonis 2018, Eq. 3, which is its first order. Rows 2 and 3 are turned, row 1 is their product.
        """
        angle2 = x * x + y * y + z * z
        if angle2 < 1e-3:
            # Below 0.03 rad the series are exact to the last bit, cheaper, and free of the cancellation in 1 - cos.
            a = 1.0 - angle2 * (1.0 - angle2 * (1.0 - angle2 / 42.0) / 20.0) / 6.0
            b = 0.5 - angle2 * (1.0 - angle2 * (1.0 - angle2 / 56.0) / 30.0) / 24.0
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
        ux = r00 * x + r01 * y + r02 * z
        uy = r10 * x + r11 * y + r12 * z
        uz = r20 * x + r21 * y + r22 * z
        x = self.north_x
        y = self.north_y
        z = self.north_z
        nx = r00 * x + r01 * y + r02 * z
        ny = r10 * x + r11 * y + r12 * z
        nz = r20 * x + r21 * y + r22 * z
        # Only rounding is to be undone here, so one step of Newton's iteration stands in for the square root.
        scale = 1.5 - 0.5 * (ux * ux + uy * uy + uz * uz)
        ux *= scale
        uy *= scale
        uz *= scale
        lean = nx * ux + ny * uy + nz * uz
        nx -= lean * ux
        ny -= lean * uy
        nz -= lean * uz
        scale = 1.5 - 0.5 * (nx * nx + ny * ny + nz * nz)
        nx *= scale
        ny *= scale
        nz *= scale
        self.up_x = ux
        self.up_y = uy
        self.up_z = uz
        self.north_x = nx
        self.north_y = ny
        self.north_z = nz
        self.east_x = ny * uz - nz * uy
        self.east_y = nz * ux - nx * uz
        self.east_z = nx * uy - ny * ux

    def rebuild(self, gain: float, north_x: float, north_y: float, north_z: float) -> None:
        """Correct the heading column towards a measured north (device axes) by `gain`, and build C from it and row 3.

        The column follows the axis that is most nearly vertical, cyclically: z up takes x, x up takes y, y up takes z
        (Patonis 2018, Fig. 1), so its axis is never further than 45 degrees from the horizon. With p that axis and u
        row 3, v = e_p - C[2, p] u and w = u x e_p span the horizon and are equally long; rows 1 and 2 are the
        combinations that reproduce the column: Eq. 1 without its angles.
        """
        ux = self.up_x
        uy = self.up_y
        uz = self.up_z
        across_x = abs(ux)
        across_y = abs(uy)
        across_z = abs(uz)
        if across_z >= across_x and across_z >= across_y:
            east = self.east_x + gain * (north_y * uz - north_z * uy - self.east_x)
            north = self.north_x + gain * (north_x - self.north_x)
            vx = 1.0 - ux * ux
            vy = -ux * uy
            vz = -ux * uz
            wx = 0.0
            wy = uz
            wz = -uy
            length2 = vx
        elif across_x >= across_y:
            east = self.east_y + gain * (north_z * ux - north_x * uz - self.east_y)
            north = self.north_y + gain * (north_y - self.north_y)
            vx = -ux * uy
            vy = 1.0 - uy * uy
            vz = -uy * uz
            wx = -uz
            wy = 0.0
            wz = ux
            length2 = vy
        else:
            east = self.east_z + gain * (north_x * uy - north_y * ux - self.east_z)
            north = self.north_z + gain * (north_z - self.north_z)
            vx = -ux * uz
            vy = -uy * uz
            vz = 1.0 - uz * uz
            wx = uy
            wy = -ux
            wz = 0.0
            length2 = vz
        column2 = east * east + north * north
        if column2 < 1e-12:
            # Row 3 was just set afresh and the axis stood upright before: any heading will do, none is known.
            east = 0.0
            north = column2 = 1.0
        length = sqrt(length2 * column2)
        east /= length
        north /= length
        self.east_x = east * vx - north * wx
        self.east_y = east * vy - north * wy
        self.east_z = east * vz - north * wz
        self.north_x = north * vx + east * wx
        self.north_y = north * vy + east * wy
        self.north_z = north * vz + east * wz

    def quaternion(self) -> tuple[float, float, float, float]:
        """Return the rotation as (x, y, z, w), device to world, w >= 0.

        The largest of the four elements is found first and divides the others (Shepperd 1978), so none loses digits.
        """
        xx = self.east_x
        yy = self.north_y
        zz = self.up_z
        trace = xx + yy + zz
        x = self.up_y - self.north_z
        y = self.east_z - self.up_x
        z = self.north_x - self.east_y
        w = 1.0 + trace
        if trace < xx or trace < yy or trace < zz:
            if xx >= yy and xx >= zz:
                x, y, z, w = 1.0 + xx - yy - zz, self.north_x + self.east_y, self.up_x + self.east_z, x
            elif yy >= zz:
                x, y, z, w = self.north_x + self.east_y, 1.0 - xx + yy - zz, self.up_y + self.north_z, y
            else:
                x, y, z, w = self.up_x + self.east_z, self.up_y + self.north_z, 1.0 - xx - yy + zz, z
        norm = sqrt(x * x + y * y + z * z + w * w)
        if w < 0.0:
            norm = -norm
        return x / norm, y / norm, z / norm, w / norm
