"""The notebooks of examples/ run from the first to the last cell, and are stored without outputs that go stale."""

import json
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))

pytestmark = pytest.mark.skipif(not NOTEBOOKS, reason="no examples beside the tests")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_without_outputs(path):
    cells = [c for c in json.loads(path.read_text(encoding="utf-8"))["cells"] if c["cell_type"] == "code"]
    assert cells
    assert [c for c in cells if c["outputs"] or c["execution_count"]] == []


@pytest.mark.slow
def test_the_dam_break_runs_and_is_compared_with_the_experiment(tmp_path, monkeypatch):
    nbclient = pytest.importorskip("nbclient")
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    book = nbformat.read(EXAMPLES / "dam_break.ipynb", as_version=4)
    monkeypatch.delenv("MPLBACKEND", raising=False)  # a notebook shows its figures with a backend of its own
    # A cell that raises ends the execution with an error.
    nbclient.NotebookClient(book, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in book.cells if cell.cell_type == "code" for output in cell.outputs]
    pictures = [output for output in outputs if "image/png" in output.get("data", {})]
    assert len(pictures) == 5
    text = "".join(output.text for output in outputs if output.output_type == "stream")
    assert "pressure-2: arrives at" in text
    assert "level-2: arrives at" in text
    assert "@misc{spume," in text
    assert "Graphical" not in text
