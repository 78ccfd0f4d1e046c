"""The notebook runs from its first cell to its last, and is stored without outputs."""

from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("matplotlib")

PLACE = Path(__file__).resolve().parents[1] / "examples" / "recording_to_figure.ipynb"


def test_the_notebook_runs(tmp_path):
    notebook = nbformat.read(PLACE, as_version=4)
    nbformat.validate(notebook)
    assert len(notebook.cells) == 10
    for cell in notebook.cells:
        assert not cell.get("outputs") and cell.get("execution_count") is None
    client = nbclient.NotebookClient(notebook, timeout=120, resources={"metadata": {"path": tmp_path}})
    client.execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    pictures = [output.data for output in outputs if "image/png" in output.get("data", {})]
    assert len(pictures) == 5
    assert not any(output.get("name") == "stderr" for output in outputs)
