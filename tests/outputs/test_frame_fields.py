"""What a model shows of itself stands in the frames unless the case names its fields."""

import numpy as np

from spume.outputs import vtkhdf
from spume.outputs.output import OutputSettings
from spume.run import run
from spume.schemes.shifting.optimised import Optimised
from spume.steps.project_in_place import ProjectInPlace
from spume.steps.weakly_compressible import WeaklyCompressible
from tanks import dam_break


def test_classes_of_optimised_shifting_are_in_the_frames(tmp_path):
    """A falling column: rows inside, in the vicinity, on the surface; and its pictures may show them."""
    output = OutputSettings(colour="surface_class", animation="none", interval=0.002)
    case = dam_break(step=ProjectInPlace(shifting=Optimised()))
    case = case.model_validate({**dict(case), "output": output, "time": case.time.model_copy(update={"end": 0.006})})
    run(case, tmp_path / "run", threads=1)
    frame = vtkhdf.read(tmp_path / "run" / "run.vtkhdf")
    fluid = frame["kind"] == 1
    assert {0, 1, 2} <= set(np.unique(frame["surface_class"][fluid]).tolist())
    assert (frame["free_surface"][fluid] == (frame["surface_class"][fluid] >= 2)).all()


def test_a_case_that_names_its_fields_gets_these_alone():
    fields = {field.name: field for field in WeaklyCompressible().needed_fields()}
    assert "relative_density" in OutputSettings().of_frame(fields)
    assert OutputSettings(fields=("velocity",)).of_frame(fields) == ("velocity",)
    fields = {field.name: field for field in ProjectInPlace().needed_fields()}
    assert OutputSettings().of_frame(fields) == vtkhdf.DEFAULT_FIELDS, "nothing more by default"
