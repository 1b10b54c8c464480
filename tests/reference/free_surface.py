"""Shares of rows in the free surface, 0 inside to 1 on it."""

from reference.number_density import original as density_of


def number_density_(cloud, beta=0.95):
    """1 where n < beta n0."""
    return 1.0 * (density_of(cloud) < beta * cloud.n0)


def blended(cloud, upper=0.9, lower=0.75):
    """(upper - n/n0)/(upper - lower), limited to 0 ... 1."""
    share = (upper - density_of(cloud) / cloud.n0) / (upper - lower)
    return share.clip(0.0, 1.0)
