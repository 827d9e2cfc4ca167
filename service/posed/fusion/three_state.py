"""A linear Kalman filter of three states that stand still, observed one scalar at a time: no matrix is inverted."""

from dataclasses import dataclass


@dataclass
class ThreeState:
    """The estimate (x, y, z) and its covariance, by the upper triangle; units are the user's."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    xx: float = 0.0
    xy: float = 0.0
    xz: float = 0.0
    yy: float = 0.0
    yz: float = 0.0
    zz: float = 0.0

    def start(self, variance: float) -> None:
        """Know nothing but a variance for each state."""
        self.x = self.y = self.z = 0.0
        self.xy = self.xz = self.yz = 0.0
        self.xx = self.yy = self.zz = variance

    def doubt(self, variance: float, most: float) -> None:
        """Let each variance below `most` grow by `variance`."""
        if self.xx < most:
            self.xx += variance
        if self.yy < most:
            self.yy += variance
        if self.zz < most:
            self.zz += variance

    def observe(self, hx: float, hy: float, hz: float, residual: float, noise: float) -> None:
        """Correct by a scalar that should be h (x, y, z): `residual` is how much more it is, `noise` its variance."""
        px = self.xx * hx + self.xy * hy + self.xz * hz
        py = self.xy * hx + self.yy * hy + self.yz * hz
        pz = self.xz * hx + self.yz * hy + self.zz * hz
        inverse = 1.0 / (hx * px + hy * py + hz * pz + noise)
        gain = inverse * residual
        self.x += gain * px
        self.y += gain * py
        self.z += gain * pz
        qx = inverse * px
        qy = inverse * py
        qz = inverse * pz
        self.xx -= qx * px
        self.xy -= qx * py
        self.xz -= qx * pz
        self.yy -= qy * py
        self.yz -= qy * pz
        self.zz -= qz * pz

    def variance_along(self, hx: float, hy: float, hz: float) -> float:
        """Return the variance of h (x, y, z)."""
        return (
            self.xx * hx * hx
            + self.yy * hy * hy
            + self.zz * hz * hz
            + 2.0 * (self.xy * hx * hy + self.xz * hx * hz + self.yz * hy * hz)
        )
