"""Ask a scheme of any family for its numbers on a ``Cloud`` of ``tests/reference``, in the order of its rows."""

import numpy as np

from arrangements import table
from reference.air import SQUEEZED, hollow
from reference.cloud import DT, DT_BEFORE
from reference.collision import walls
from reference.step import SOUND, density_at_start
from reference.viscosity import slipping
from reference.wall_function import thin
from spume.domain import Domain
from spume.gravity import Constant
from spume.particles import FLUID, WALL
from spume.pressure.matrix import SYSTEM_FIELDS, UNKNOWN, LinearSystem
from spume.schemes.divergence.original import Original as OriginalDivergence
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.laplacian.original import Original as OriginalLaplacian
from spume.schemes.number_density.base import Original as NumberDensity
from spume.schemes.source.base import DIVERGENCE, SOURCE
from spume.schemes.surface_images import AIR_PRESSURE
from spume.schemes.viscosity.explicit import Explicit
from spume.steps.base import nested
from spume.voids import Voids
from spume.wall_models.base import WALL_FIELDS

FIELDS = (*SYSTEM_FIELDS, *WALL_FIELDS, SURFACE_SHARE, SOURCE, DIVERGENCE)


REACH = 3.2
"""Search radius, as a multiple of l0: at least that of any scheme that is asked."""


class Rows:
    """The rows of a cloud in Spume's table, which sorts them: fields go in and come out in the cloud's order.

    Making a table takes longer than most sums over it, so each cloud has one, whose fields start anew for each scheme.
    """

    def __new__(cls, scheme, cloud, share=None, **fields):
        self = cloud.__dict__.get("_rows") or super().__new__(cls)
        if "_rows" not in cloud.__dict__:
            cloud._rows = self
            period = getattr(cloud, "period", None)
            self.lattice, self.particles, self.pairs = table(
                cloud.x, spacing=cloud.l0, fields=FIELDS, reach=max(REACH, cloud.re / cloud.l0), skin=0.05,
                region=None if period is None else ([-period / 2] * cloud.d, [period / 2] * cloud.d),
                periodic=[period is not None] * cloud.d,
            )  # fmt: skip
            self.order = self.particles.numpy("id")
        self.particles.declare(field for part in nested(scheme) for field in getattr(part, "needs", ()))
        self.particles.declare(getattr(scheme, "fields", ()))
        given = {"position": cloud.x, "velocity": cloud.u, "density": cloud.rho, "kinematic_viscosity": cloud.nu}
        if share is not None:
            given |= {"surface_share": share, "free_surface": share > 0.5}
        given |= fields | {"kind": np.full(len(cloud), FLUID)}
        for name, field in self.particles.fields.items():
            if name != "id":
                shape = (len(cloud), *field.value_shape(cloud.d))
                values = np.asarray(given[name])[self.order] if name in given else np.full(shape, field.initial)
                self.particles.set(name, values)
        self.list_again()
        return self

    @property
    def handles(self):
        return self.lattice, self.particles, self.pairs

    def put(self, **fields):
        for name, values in fields.items():
            self.particles.set(name, np.asarray(values)[self.order])
        self.list_again()

    def list_again(self):
        """Make the lists anew where kinds have changed: fluid neighbours come first."""
        kind = self.particles.numpy("kind")
        if not np.array_equal(kind, self.__dict__.get("kind", np.full(len(kind), FLUID))):
            self.particles.changed = True
            self.pairs.update(self.particles)
            assert np.array_equal(self.particles.numpy("id"), self.order)
        self.kind = kind

    def get(self, name):
        values = self.particles.numpy(name)
        found = np.empty_like(values)
        found[self.order] = values
        return found


def number_density(scheme, cloud, share=None):
    rows = Rows(scheme, cloud, share)
    scheme(*rows.handles)
    return rows.get("number_density")


def gradient(scheme, cloud, phi=None, share=None, dt=0.0, **fields):
    rows = Rows(scheme, cloud, share, scalar=cloud.phi if phi is None else phi, **fields)
    scheme(*rows.handles, phi="scalar", out="vector", dt=dt)
    return rows.get("vector")


def divergence(scheme, cloud, u=None, share=None):
    rows = Rows(scheme, cloud, share, velocity=cloud.u if u is None else u)
    scheme(*rows.handles, out="answer")
    return rows.get("answer")


def stretched(scheme, cloud, share=None):
    """Return the divergence of rows drawn apart along x by the half."""
    return divergence(scheme, cloud.moved(cloud.x * (1.0 + 0.5 * np.eye(cloud.d)[0])), share=share)


def system(scheme, cloud, slope=None, share=None):
    """Return the matrix M and the right side b, of the laplacian s = b - M phi."""
    n = len(cloud)
    before = np.zeros((n, cloud.d)) if slope is None else slope
    rows = Rows(scheme, cloud, share, row_state=np.full(n, UNKNOWN), pressure_gradient=before, density=np.ones(n))
    linear = LinearSystem()
    linear.assemble(scheme, *rows.handles)
    matrix = linear.sparse(rows.particles).toarray()
    back = np.argsort(rows.order)
    return matrix[np.ix_(back, back)], rows.get("rhs")


def laplacian(scheme, cloud, phi=None, slope=None, share=None):
    matrix, right = system(scheme, cloud, cloud.slope if slope is None else slope, share)
    return right - matrix @ (cloud.phi if phi is None else phi)


def source(scheme, cloud, u=None, share=None):
    """Two steps, for sources that remember; number density and divergence are the original ones."""
    rows = Rows(scheme, cloud, share)
    model, divergence = NumberDensity(re=cloud.re / cloud.l0), OriginalDivergence(re=cloud.re / cloud.l0)
    rows.put(position=cloud.before[0], velocity=cloud.u_before)
    scheme.remember(*rows.handles, model, False)
    scheme(*rows.handles, DT_BEFORE, divergence, model, False)
    rows.put(position=cloud.before[1])
    scheme.remember(*rows.handles, model, False)
    rows.put(position=cloud.x, velocity=cloud.u if u is None else u)
    model(*rows.handles)
    scheme(*rows.handles, DT, divergence, model, False)
    return rows.get("source")


def viscosity(scheme, cloud, u=None, dt=DT, share=None):
    rows = Rows(scheme, cloud, share, slip_velocity=cloud.u if u is None else u)
    scheme(*rows.handles, dt)
    return rows.get("acceleration")


def implicit_at_wall(scheme, cloud, share=None):
    """Return the viscous acceleration of the fluid rows, where some rows are solid."""
    solid, to_surface = walls(cloud)
    slip = (solid & slipping(cloud)).astype(int)
    rows = Rows(scheme, cloud, share, to_surface=to_surface, slip=slip, wall_velocity=cloud.u_before)
    rows.put(kind=np.where(solid, WALL, FLUID))
    scheme(*rows.handles, DT)
    return np.where(solid[:, None], 0.0, rows.get("acceleration"))


def shifting(scheme, cloud, share=None):
    rows = Rows(scheme, cloud, share, pressure=cloud.phi, pressure_gradient=cloud.slope)
    model = NumberDensity(re=cloud.re / cloud.l0)
    model(*rows.handles)
    scheme(*rows.handles, model, DT)
    return rows.get("position") - cloud.x


def free_surface(scheme, cloud, share=None):
    rows = Rows(scheme, cloud, share)
    model = NumberDensity()
    model(*rows.handles)
    scheme(*rows.handles, model)
    return rows.get("surface_share")


def step(scheme, cloud, share=None):
    """Return the rate of the relative density over one weakly compressible step."""
    before = density_at_start(cloud)
    rows = Rows(scheme, cloud, share, relative_density=before, speed_of_sound=np.full(len(cloud), SOUND))
    scheme(Domain(*rows.handles, bodies=(), gravity=Constant(vector=(0.0,) * cloud.d)), 0.0, DT, 0.0)
    return (rows.get("relative_density") - before) / DT


def carried(scheme, cloud, share=None):
    """Return velocity and pressure [kPa] after the shift."""
    rows = Rows(scheme, cloud, share, pressure=cloud.phi, pressure_gradient=cloud.slope)
    model = NumberDensity(re=cloud.re / cloud.l0)
    model(*rows.handles)
    scheme(*rows.handles, model, DT)
    return np.column_stack([rows.get("velocity"), rows.get("pressure") / 1000])


def drawn(scheme, cloud, share=None):
    """Return the flag of the free surface, the addition to the matrix, and the pressure it draws to [kPa]."""
    rows = Rows(scheme, cloud, share, surface_value=cloud.phi)
    model = NumberDensity()
    model(*rows.handles)
    scheme(*rows.handles, model)
    scheme.draw(rows.lattice, rows.particles, OriginalLaplacian(), model)
    found = rows.get("free_surface"), rows.get("surface_diagonal"), rows.get("surface_value") / 1000
    return np.stack(found, axis=1)


def collision(scheme, cloud, share=None):
    rows = Rows(scheme, cloud, share)
    scheme(*rows.handles, DT)
    return rows.get("velocity") - cloud.u


def collision_at_wall(scheme, cloud, share=None):
    """Return the changes of velocity and of position over dt, and the number of collisions; some rows are solid."""
    solid, to_surface = walls(cloud)
    rows = Rows(scheme, cloud, share, to_surface=to_surface)
    rows.put(kind=np.where(solid, WALL, FLUID))
    scheme(*rows.handles, DT)
    moved = (rows.get("position") - cloud.x) / DT
    count = np.where(solid, 0, rows.get("collisions"))
    return np.column_stack([rows.get("velocity") - cloud.u, moved, count])


def turbulence(scheme, cloud, share=None):
    rows = Rows(scheme, cloud, share, slip_velocity=cloud.u)
    return rows.get(scheme(*rows.handles))


def wall_function(scheme, cloud, share=None):
    """Return the viscous acceleration of the fluid rows, where some rows are solid."""
    solid, to_surface = walls(cloud)
    slip = (solid & slipping(cloud)).astype(int)
    model = Explicit(wall_function=scheme)
    rows = Rows(
        model, cloud, share, to_surface=to_surface, slip=slip, wall_velocity=cloud.u_before, slip_velocity=cloud.u,
        kinematic_viscosity=thin(cloud),
    )  # fmt: skip
    rows.put(kind=np.where(solid, WALL, FLUID))
    model(*rows.handles, DT)
    return np.where(solid[:, None], 0.0, rows.get("acceleration"))


def air(scheme, cloud, share=None):
    """Return the pressure of the air in a hollow block that has been squeezed, in P_0."""
    x = hollow(cloud)
    lattice, particles, _ = table(x, cloud.l0, fields=[AIR_PRESSURE])
    voids, order = Voids(), particles.numpy("id")
    for squeezed in (1.0, SQUEEZED):
        particles.set("position", squeezed * x[order])
        scheme(lattice, particles, voids, {})
    result = np.empty(len(x))
    result[order] = particles.numpy("air_pressure") / getattr(scheme, "pressure", 1.0)
    return result


ASK = {
    "air": air, "collision": collision, "divergence": divergence, "free_surface": free_surface, "gradient": gradient,
    "laplacian": laplacian, "number_density": number_density, "shifting": shifting, "source": source,
    "step": step, "turbulence": turbulence, "viscosity": viscosity,
    "wall_function": wall_function,
}  # fmt: skip
