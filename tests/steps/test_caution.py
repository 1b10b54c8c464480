"""Models that can be computed together but do not fit each other are told of by name."""

import numpy as np
import pytest
from typer.testing import CliRunner

import asked
from conftest import initialized
from reference.cloud import cloud_for
from spume import named
from spume.cli import app
from spume.pressure.bicgstab import StabilisedBiconjugateGradient
from spume.pressure.conjugate_gradient import ConjugateGradient
from spume.pressure.multigrid import Multigrid
from spume.problems import CaseError
from spume.schemes.divergence.original import Original as OriginalDivergence
from spume.schemes.free_surface.blended import Blended
from spume.schemes.free_surface.detection_free import DetectionFree
from spume.schemes.gradient.corrected import Corrected
from spume.schemes.laplacian.corrected_vector import CorrectedVector
from spume.schemes.laplacian.distance import Distance
from spume.schemes.laplacian.dummy_neighbour import DummyNeighbour
from spume.schemes.laplacian.higher_order import HigherOrder
from spume.schemes.laplacian.least_squares import LeastSquares
from spume.schemes.laplacian.original import Original
from spume.schemes.laplacian.second_order import SecondOrder
from spume.schemes.number_density.base import Original as NumberDensity
from spume.schemes.source.density import Density
from spume.schemes.source.divergence import VelocityDivergence
from spume.schemes.source.error_compensating import ErrorCompensating
from spume.schemes.source.higher_order import HigherOrder as Rate
from spume.schemes.weight.gaussian import Gaussian
from spume.schemes.weight.inverse import Inverse
from spume.schemes.weight.isochoric import Isochoric
from spume.steps.predict_move_project import PredictMoveProject
from spume.steps.project_in_place import ProjectInPlace
from spume.wall_models.resting import Resting
from tanks import column


@pytest.mark.parametrize(
    ("laplacian", "source", "said"),
    [
        (HigherOrder(form="consistent"), Rate(), ""),
        (HigherOrder(form="calibrated"), Rate(), "choose that form"),
        (HigherOrder(form="consistent", re=3.1), Rate(), "re = 2.1, the laplacian higher-order with re = 3.1"),
        (HigherOrder(form="published"), Density(), 'choose "calibrated" or "consistent"'),
        (HigherOrder(form="consistent"), Density(), ""),
        (HigherOrder(form="consistent"), VelocityDivergence(), 'choose "calibrated"'),
        (HigherOrder(form="calibrated"), VelocityDivergence(), ""),
        (HigherOrder(), Density(), ""),
        (HigherOrder(form="published"), Rate(), "the pressure is 2/3 of the projection's in 2D"),
        (HigherOrder(form="published"), ErrorCompensating(), "choose that form"),
        (Original(), ErrorCompensating(), "only the laplacian higher-order shares"),
        (Original(), Density(), ""),
    ],
)
def test_laplacian_and_source_of_different_sizes(laplacian, source, said):
    found = PredictMoveProject(laplacian=laplacian, source=source, wall_model=Resting()).caution()
    assert bool(found) == bool(said)
    assert said in found


@pytest.mark.parametrize("source", [Rate(), ErrorCompensating()], ids=lambda s: s.key)
def test_a_source_of_another_weight_has_another_size(source):
    """The factor of the Laplacian is that of re/r - 1."""
    for weight, other in ((Inverse(), False), (Gaussian(), True), (Isochoric(), True)):
        step = PredictMoveProject(
            laplacian=HigherOrder(form="consistent"), source=source, number_density=NumberDensity(weight=weight)
        )
        said = f'choose "inverse" for number_density, not "{weight.key}"'
        assert (said in step.caution()) == other
        assert bool(step.caution()) == other


@pytest.mark.parametrize(
    ("d", "form", "weight", "expected"),
    [
        (2, "consistent", Inverse(), 1.0),
        (3, "consistent", Inverse(), 1.0),
        (2, "published", Inverse(), 2 / 3),
        (3, "published", Inverse(), 1.0),
        (2, "consistent", Gaussian(), 2.293 / 1.417),
        (3, "consistent", Gaussian(), 1.697 / 1.073),
    ],
)
def test_the_sizes_that_cautions_tell(device, d, form, weight, expected):
    """Source of a uniform compression over Laplacian of |x|^2/(2 d), both on the lattice."""
    initialized(device, 1, "double")
    cloud = cloud_for(d, disturbance=0.0, cells=8)
    rows = asked.Rows(Rate(), cloud, velocity=-cloud.x)
    inside = np.abs(cloud.x).max(axis=1) < (cloud.cells / 2) * cloud.l0 - cloud.re
    Rate()(*rows.handles, asked.DT, OriginalDivergence(), NumberDensity(weight=weight), False)
    of_source = rows.get("source") * asked.DT / -d
    of_laplacian = asked.laplacian(HigherOrder(form=form), cloud, (cloud.x**2).sum(axis=1) / (2 * d))
    assert inside.any()
    assert (of_source / of_laplacian)[inside] == pytest.approx(expected, rel=2e-3)


def test_the_printed_normalisation_of_the_corrected_gradient_is_told_of():
    assert ProjectInPlace(gradient=Corrected(), free_surface=Blended()).caution() == ""
    said = ProjectInPlace(gradient=Corrected(form="published"), free_surface=Blended()).caution()
    assert (
        said == 'gradient \'corrected\' in the form "published" gives d times the gradient: choose form = "consistent"'
    )


def test_two_cautions_are_both_told():
    named.load_all()
    found = PredictMoveProject(
        laplacian=HigherOrder(form="published"), source=VelocityDivergence(), free_surface=DetectionFree()
    ).caution()
    assert 'choose "calibrated"' in found
    assert "gradient 'minimum' leaves out the neighbours missing" in found
    assert "choose the gradient completed or dummy-neighbour" in found


@pytest.mark.parametrize("step", [PredictMoveProject, ProjectInPlace])
def test_a_symmetric_solver_refuses_a_matrix_that_is_not(step):
    with pytest.raises(CaseError, match="solver 'cg' needs a symmetric matrix") as caught:
        step(solver=ConjugateGradient(), laplacian=SecondOrder())
    assert "which the laplacian 'second-order' does not give: choose multigrid or bicgstab" in str(caught.value)
    for solver in (Multigrid(), StabilisedBiconjugateGradient()):
        step(solver=solver, laplacian=SecondOrder())
    step(solver=ConjugateGradient(), laplacian=Original())


ANOTHER_RADIUS = (
    "source 'higher-order' is summed with re = 2.1, the laplacian higher-order with re = 2.9: choose the same"
)


def test_a_case_with_models_that_do_not_fit_says_so_and_goes_on(caplog):
    """The higher-order Laplacian with a source of another radius."""
    step = PredictMoveProject(laplacian=HigherOrder(form="consistent", re=2.9), source=Rate())
    with caplog.at_level("WARNING", logger="spume"):
        column(step=step, cells=(4, 4)).build(threads=1)
    assert caplog.messages == [f"step: {ANOTHER_RADIUS}"]


def test_check_says_so_too(tmp_path, monkeypatch, caplog):
    monkeypatch.chdir(tmp_path)
    laplacian = '{name = "higher-order", form = "consistent", re = 2.9}'
    step = f'{{name = "predict-move-project", source = "higher-order", laplacian = {laplacian}}}'
    result = CliRunner().invoke(app, ["check", "dam-break", "--set", "spacing=0.05", "--set", f"step={step}"])
    assert result.exit_code == 0, result.output
    assert ANOTHER_RADIUS in " ".join((caplog.text + result.output).split())


@pytest.mark.parametrize(
    ("laplacian", "told"),
    [
        (CorrectedVector(base="distance"), True),
        (CorrectedVector(base="distance", correction="lagged"), False),
        (DummyNeighbour(), True),
        (SecondOrder(), True),
        (LeastSquares(), True),
        (Distance(), False),
    ],
)
def test_what_is_missing_at_the_surface_is_not_made_up_for_twice(laplacian, told):
    found = ProjectInPlace(laplacian=laplacian).caution()
    assert bool(found) == told
    assert not told or "choose distance, or corrected-vector with correction = 'lagged'" in found
    assert ProjectInPlace(laplacian=laplacian, free_surface=Blended()).caution() == ""
