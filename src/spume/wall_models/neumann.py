"""Walls with the inhomogeneous Neumann condition, in balance with gravity."""

from typing import ClassVar

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, PairView, pair_sum, pair_term, row_map, row_term
from spume.particles import ANY, DUMMY, FLUID, SOLID, WALL, Field, Particles
from spume.pressure.matrix import FLUX, across_densities
from spume.wall_models.base import WALL_FIELDS, WallModel


@row_term(reads=("velocity", "wall_velocity"))
def imposed_acceleration(a, dt):  # type: ignore[no-untyped-def]
    return (a.velocity - a.wall_velocity) / dt


@kernels.func
def pressure_of_image(a, b, r, dt):  # type: ignore[no-untyped-def]
    value = across_densities(a, b)
    if b.kind != FLUID:
        normal = b.to_surface.normalized(1e-30)
        change = b.velocity - b.wall_velocity + (a.velocity - b.velocity).dot(normal) * normal
        value = a.value + a.density / dt * change.dot(r)
    return value


@kernels.func
def pressure_along_normal(a, b, r, dt):  # type: ignore[no-untyped-def]
    value = across_densities(a, b)
    if b.kind != FLUID:
        normal = b.to_surface.normalized(1e-30)
        value = a.value + a.density / dt * (a.velocity - b.wall_velocity).dot(normal) * r.dot(normal)
    return value


@pair_term(reads=("pressure", "density", "wall_acceleration"))
def weighted_pressure(a, b, r, w):  # type: ignore[no-untyped-def]
    return w * (b.pressure - b.density * a.wall_acceleration.dot(r))


@pair_term(reads=("density",))
def weighted_density(a, b, r, w):  # type: ignore[no-untyped-def]
    return w * b.density


@pair_term()
def weight_of_fluid(a, b, r, w):  # type: ignore[no-untyped-def]
    return w


@row_term(reads=("weighted_pressure", "fluid_weight"))
def mean_pressure(a):  # type: ignore[no-untyped-def]
    return kernels.qd.select(a.fluid_weight > 1e-9, a.weighted_pressure / max(a.fluid_weight, 1e-9), 0.0)


class Neumann(WallModel, name="neumann"):
    """dP/dn = rho (g - a_wall) . n on solid rows (Duan 2020), and a source to which gravity gives nothing.

    Solid rows are accelerated by the predictor as if they were fluid, so the flux that gravity would drive
    through the wall is not in the source; it stands in the matrix, as the difference
    P_j - P_i = rho (u*_wall - u_wall)/dt . r_ij that a solid row j imposes on a fluid row i. Fluid at rest
    is then in balance to round-off on the regular arrangement. No solid row has an equation, so the matrix
    is smaller and symmetric; what approaches a wall is stopped by the source, in which solid rows move like
    mirror images. A solid row has the density of who looks at it, so fluids may change places along a wall. The
    pressure of a wall row is the mean over the fluid near it, P_w = sum_j W (P_j - rho_j a_w . r_wj)/sum_j W with
    a_w = (u*_wall - u_wall)/dt, that of a dummy follows its wall row.
    """

    ids: ClassVar = ("F1", "F3")
    reference: ClassVar = "duan2020"
    carriers: ClassVar = ANY
    mirror: ClassVar = True
    predicted: ClassVar = ANY
    wall_state: ClassVar = FLUX
    dummy_state: ClassVar = FLUX
    needs: ClassVar = (
        *WALL_FIELDS,
        Field("weighted_pressure", (), "Pa", "sum of W P over the fluid near a wall row", scratch="extrapolation"),
        Field("fluid_weight", (), "1", "sum of W over the fluid near a wall row", scratch="extrapolation"),
        Field("weighted_density", (), "kg/m^3", "sum of W rho over the fluid near a wall row", scratch="extrapolation"),
    )

    def neumann(self, particles: Particles, dt: float) -> None:
        """Write ``wall_acceleration`` = (u* - u_wall)/dt [m/s^2] of solid rows."""
        row_map(imposed_acceleration, particles, out="wall_acceleration", rows=SOLID, arguments=(dt,))

    def view(self, dt: float, of_normals: bool = False) -> PairView:
        """Return P_j = P_i + rho/dt [n n . (u*_i - u_wall)] . r_ij for a solid row j, to be taken along n alone.

        That is the gradient which gives a fluid row at the wall the wall's normal velocity. A gradient model that takes
        all of r_ij is given rho/dt (u*_wall - u_wall) along the wall as well, which is that of water at rest.
        """
        reads = ("value", "kind", "velocity", "wall_velocity", "to_surface", "density")
        formula = pressure_along_normal if of_normals else pressure_of_image
        return PairView(formula, reads, arguments=(dt,), of_normals=of_normals, beyond_rest=not of_normals)

    def extrapolate(self, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
        """Write the pressure of wall rows from the fluid near them, and that of dummies from their wall row."""
        pair_sum(
            (weighted_pressure, weight_of_fluid, weighted_density), particles, pairs,
            out=("weighted_pressure", "fluid_weight", "weighted_density"), weight=self.weight,
            re=self.radius(lattice), rows=WALL, over=FLUID,
        )  # fmt: skip
        row_map(mean_pressure, particles, out="pressure", rows=WALL)
        _extrapolation_kernel(particles.dimension, kernels.light(particles.active))(
            particles["kind"], particles["master"], particles["position"], particles["wall_acceleration"],
            particles["fluid_weight"], particles["weighted_density"], particles["pressure"], particles.rows_by_id(),
            particles.active,
        )  # fmt: skip


@kernels.cached
def _extrapolation_kernel(d: int, serial: bool):  # type: ignore[no-untyped-def]
    Vectors = kernels.array_type(kernels.vector(d))
    Rows, Reals = kernels.array_type(kernels.i32), kernels.array_type(kernels.runtime().real)
    qd = kernels.qd

    @kernels.kernel
    def extrapolate(
        kind: Rows, master: Rows, position: Vectors, acceleration: Vectors, weight: Reals, density: Reals,
        pressure: Reals, row_of_id: Rows, count: kernels.i32,
    ):  # fmt: skip
        qd.loop_config(serialize=serial)
        for i in range(count):
            if kind[i] == DUMMY:
                j = row_of_id[master[i]]
                # Behind a wall row that no fluid touches there is no pressure.
                mean = density[j] / qd.max(weight[j], 1e-9)
                behind = pressure[j] + mean * acceleration[i].dot(position[i] - position[j])
                pressure[i] = qd.select(weight[j] > 1e-9, behind, 0.0)

    return extrapolate
