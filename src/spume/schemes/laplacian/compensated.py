"""The original Laplacian, corrected for the irregular arrangement with the gradient of the step before."""

from typing import ClassVar

from spume.schemes.laplacian.original import Original


class Compensated(Original, name="compensated"):
    """<lap phi>_i = 2 d/(lambda n0) sum_j (phi_j - phi_i - r_ij . grad phi) W (review Eq. 23).

    The corrected vector of Duan 2018. The correction is exact for linear fields on any arrangement. In the pressure
    matrix it is taken from the gradient of the step before and stands on the right side, so the matrix stays
    symmetric; it fades out towards the free surface. Outside the pressure matrix it is the original model.
    """

    ids: ClassVar[tuple[str, ...]] = ()
    reference: ClassVar = "duan2018"
    order: ClassVar = 0
    conserves: ClassVar = frozenset()
    compensated: ClassVar = True
