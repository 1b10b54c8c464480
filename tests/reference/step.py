"""Steps of the whole fluid, without walls and gravity."""

import numpy as np

from reference.cloud import DT
from reference.divergence import original
from reference.gradient import corrected, sum_
from reference.viscosity import explicit

SOUND = 20.0
"""Speed of sound [m/s]."""


def density_at_start(cloud):
    """Relative density of the rows, some of it below one."""
    return 1.0 + 0.02 * (cloud.share - 0.4)


def weakly_compressible(cloud, exponent=7.0, diffusion=0.1):
    """Rate (s' - s)/dt of the relative density s over a step.

    P = rho c^2/gamma (s^gamma - 1);  u' = u + dt [div(mu grad u)/rho - grad P/rho], grad P in the sum form;
    (s' - s)/dt = -s div u' + delta l0/(rho c) 2 d/n0 sum_j [P_j - P_i - (grad P_i + grad P_j) . r_ij/2] W/r^2,
    here with the corrected gradient. Rows with less than 0.4 of the neighbours of a corner of the lattice have s' = 1,
    and those with up to 0.7 of them something in between.
    """
    s = density_at_start(cloud)
    P = cloud.rho * SOUND**2 / exponent * (s**exponent - 1)
    pressed = cloud.moved(cloud.x)
    pressed.phi = P
    slope = sum_(pressed)
    rate = -s * original(cloud.moved(cloud.x, cloud.u + DT * (explicit(cloud) - slope / cloud.rho[:, None])))
    slope = corrected(pressed)
    for i in range(len(cloud)):
        for j, r, apart, w in cloud.neighbours(i):
            jump = P[j] - P[i] - (slope[i] + slope[j]) @ r / 2
            share = diffusion * cloud.l0 / (cloud.rho[i] * SOUND) * 2 * cloud.d / cloud.n0
            rate[i] += share * jump * w / apart**2
    reach = round(cloud.re / cloud.l0, 9)
    corner = sum(0 < np.linalg.norm(k) < reach for k in np.ndindex(*[int(reach) + 1] * cloud.d))
    near = np.array([len(list(cloud.neighbours(i))) for i in range(len(cloud))])
    inside = np.clip((near / corner - 0.4) / 0.3, 0.0, 1.0)
    return (1 + inside * (s + DT * rate - 1) - s) / DT
