"""Displacements by particle shifting."""


def none(cloud):
    """No displacement."""
    return cloud.vectors()


def fickian(cloud, strength=0.1, largest=0.1):
    """-A l0^2 d/n0 sum_j W r_ij/r^2, its normal part times 1 - theta, at most ``largest`` l0 long."""
    shift = cloud.vectors()
    for i in range(len(cloud)):
        for _, r, s, w in cloud.neighbours(i):
            shift[i] -= strength * cloud.l0**2 * cloud.d / cloud.n0 * w * r / s**2
        shift[i] *= 1 - cloud.share[i]  # all of it is normal: the normal of the surface is its own direction
        length = (shift[i] @ shift[i]) ** 0.5
        if length > largest * cloud.l0:
            shift[i] *= largest * cloud.l0 / length
    return shift
