"""The stress of a turbulent layer with a velocity profile of the seventh root."""

from typing import ClassVar

from spume.schemes.wall_function.base import WallFunction


def power_law(u, y, nu):  # type: ignore[no-untyped-def]
    """tau/rho of u+ = 8.3 (y+)^(1/7), at least the nu u/y of a laminar layer."""
    laminar = nu * u / y
    v = u / 8.3
    turbulent = v * v**0.5 * ((v * nu / y) ** 0.5) ** 0.5  # powers of 7/4 and 1/4, which some devices do not have
    return laminar + 0.5 * (turbulent - laminar + abs(turbulent - laminar))


class PowerLaw(WallFunction, name="power-law"):
    """u+ = y+ up to y+ = 11.81, u+ = 8.3 (y+)^(1/7) above (Werner & Wengle 1993): a smooth wall.

    With u+ = u/u_tau, y+ = u_tau y/nu and the stress tau = rho u_tau^2 this can be solved for the stress,

        tau/rho = max[nu u/y, (u/8.3)^(7/4) (nu/y)^(1/4)],

    so that nothing is iterated and there is no constant to choose. From y+ = 30 to 1000 it is within 2 % of the
    logarithmic law u+ = ln(y+)/0.41 + 5. The laminar branch is the stress of a layer that the particles resolve: slow
    and viscous flows are left as they are. The layer must have had the time to become turbulent; in waves, whose flow
    turns back each period, it is thinner than this law takes it for.
    """

    ids: ClassVar = ("A6",)
    reference: ClassVar = "werner1993"
    formula: ClassVar = staticmethod(power_law)
