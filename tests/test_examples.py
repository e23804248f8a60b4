"""Every numbered example is short, says how it is started, and runs; the notebook draws its pictures."""

import ast
import runpy
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "examples"
EXAMPLES = sorted(FOLDER.glob("[0-9][0-9]_*.py"))
LONGEST = 60


def test_there_are_examples():
    numbers = [path.name[:2] for path in EXAMPLES]
    assert len(numbers) >= 4
    assert len(set(numbers)) == len(numbers)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_is_short_and_says_how_to_start_it(path):
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= LONGEST
    assert f"python examples/{path.name}" in (ast.get_docstring(ast.parse(text)) or "")


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(path, capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", [str(path)])
    runpy.run_path(str(path), run_name="__main__")
    assert len(capsys.readouterr().out.splitlines()) >= 5


def test_notebook_draws_its_pictures():
    nbclient = pytest.importorskip("nbclient", reason="running the notebook needs the extra `dev`")
    nbformat = pytest.importorskip("nbformat", reason="running the notebook needs the extra `dev`")
    pytest.importorskip("ipykernel", reason="running the notebook needs the extra `dev`")
    notebook = nbformat.read(FOLDER / "pictures.ipynb", as_version=4)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not any(cell.outputs or cell.execution_count for cell in code), "stored without outputs"
    # A busy machine brings outputs late; by default those of more than four seconds are lost.
    nbclient.NotebookClient(
        notebook,
        timeout=600,
        iopub_timeout=600,
        kernel_name="python3",
        resources={"metadata": {"path": str(FOLDER)}},
    ).execute()
    kinds = [kind for cell in code for output in cell.outputs for kind in output.get("data", ())]
    assert kinds.count("image/png") == 4
    assert kinds.count("text/html") == 2
