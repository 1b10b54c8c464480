"""Models that can be computed together but do not fit each other are told of by name."""

import pytest

from spume.schemes.free_surface.detection_free import DetectionFree
from spume.schemes.laplacian.higher_order import HigherOrder
from spume.schemes.laplacian.original import Original
from spume.schemes.source.density import Density
from spume.schemes.source.divergence import VelocityDivergence
from spume.schemes.source.error_compensating import ErrorCompensating
from spume.schemes.source.higher_order import HigherOrder as Rate
from spume.steps.predict_move_project import PredictMoveProject
from spume.wall_models.resting import Resting


@pytest.mark.parametrize(
    ("laplacian", "source", "said"),
    [
        (HigherOrder(form="consistent"), Rate(), ""),
        (HigherOrder(form="calibrated"), Rate(), "choose that form"),
        (HigherOrder(form="consistent", re=3.1), Rate(), "re = 2.1, the laplacian higher-order with re = 3.1"),
        (HigherOrder(form="published"), Density(), 'choose "calibrated"'),
        (HigherOrder(), Density(), ""),
        (Original(), ErrorCompensating(), "only the laplacian higher-order shares"),
        (Original(), Density(), ""),
    ],
)
def test_laplacian_and_source_of_different_sizes(laplacian, source, said):
    found = PredictMoveProject(laplacian=laplacian, source=source, wall_model=Resting()).caution()
    assert bool(found) == bool(said)
    assert said in found


def test_two_cautions_are_both_told():
    found = PredictMoveProject(
        laplacian=HigherOrder(form="published"), source=VelocityDivergence(), free_surface=DetectionFree()
    ).caution()
    assert 'choose "calibrated"' in found
    assert "gradient 'minimum' leaves out the neighbours missing" in found
    assert "choose the gradient completed or dummy-neighbour" in found
