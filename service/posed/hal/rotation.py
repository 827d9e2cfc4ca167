"""Rotations of many instants at once: unit quaternions (x, y, z, w) that map the device frame to the world."""

import numpy as np

from posed.events import Float64Array


def multiply(left: Float64Array, right: Float64Array) -> Float64Array:
    """Return the product left * right (float64[n, 4]): first `right`, then `left`."""
    ax, ay, az, aw = left.T
    bx, by, bz, bw = right.T
    product = np.empty((max(len(left), len(right)), 4))
    product[:, 0] = aw * bx + ax * bw + ay * bz - az * by
    product[:, 1] = aw * by - ax * bz + ay * bw + az * bx
    product[:, 2] = aw * bz + ax * by - ay * bx + az * bw
    product[:, 3] = aw * bw - ax * bx - ay * by - az * bz
    return product


def to_device(attitude: Float64Array, world: Float64Array) -> Float64Array:
    """Return world vectors (float64[n, 3] or float64[3]) as seen in device axes (float64[n, 3]): transpose(R) v."""
    x, y, z, w = attitude.T
    vx, vy, vz = world.T
    # v' = v - w t + u x t with t = 2 u x v, u the quaternion's vector part: half the work of a matrix.
    tx = 2.0 * (y * vz - z * vy)
    ty = 2.0 * (z * vx - x * vz)
    tz = 2.0 * (x * vy - y * vx)
    device = np.empty((len(attitude), 3))
    device[:, 0] = vx - w * tx + y * tz - z * ty
    device[:, 1] = vy - w * ty + z * tx - x * tz
    device[:, 2] = vz - w * tz + x * ty - y * tx
    return device


def increments(attitude: Float64Array) -> Float64Array:
    """Return the rotation vectors from each attitude (float64[n, 4]) to the next: rad, device frame, float64[n - 1, 3].

    The shorter way round is taken: a turn between neighbours must stay below pi.
    """
    backward = attitude[:-1] * np.array([-1.0, -1.0, -1.0, 1.0])
    step = multiply(backward, attitude[1:])
    vector, scalar = step[:, :3], step[:, 3]
    sine = np.sqrt(np.einsum("ij,ij->i", vector, vector))
    half_angle = np.arctan2(sine, np.abs(scalar))
    # 2 asin(s)/s is 2 within one unit of the last place for s below 1e-8.
    factor = 2.0 * np.divide(half_angle, sine, out=np.ones_like(sine), where=sine > 1e-8)
    rotation_vector: Float64Array = vector * np.copysign(factor, scalar)[:, np.newaxis]
    return rotation_vector


def from_rotation_vector(vector: Float64Array) -> Float64Array:
    """Return the quaternions (float64[n, 4]) of rotation vectors (rad, float64[n, 3])."""
    half_angle = 0.5 * np.sqrt(np.einsum("ij,ij->i", vector, vector))
    quaternion = np.empty((len(vector), 4))
    # np.sinc(x) is sin(pi x) / (pi x), whole at 0.
    quaternion[:, :3] = vector * (0.5 * np.sinc(half_angle / np.pi))[:, np.newaxis]
    quaternion[:, 3] = np.cos(half_angle)
    return quaternion
