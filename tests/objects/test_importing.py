import numpy as np
import pytest
import trimesh

from ffhnet.apps.cli import main
from ffhnet.errors import ObjectError
from ffhnet.objects import decompose
from ffhnet.objects.catalogue import resolve_objects
from ffhnet.objects.importing import BrokenMesh, UsableMesh, check_any_usable, import_mesh, write_object
from ffhnet.objects.layouts import find_meshes


def box(*sides: float) -> trimesh.Trimesh:
    return trimesh.creation.box(extents=sides or (0.04, 0.06, 0.1))


def open_shell() -> trimesh.Trimesh:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.04)
    ball.update_faces(ball.triangles_center[:, 2] < 0)
    return ball


def doubled_sheet() -> trimesh.Trimesh:
    """A tilted closed sheet without volume: all its vertices lie in one plane."""
    corners = np.array([[0, 0, 0], [0.1, 0, 0.1], [0.1, 0.1, 0.1], [0, 0.1, 0]])
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3], [1, 0, 3], [1, 3, 2]], process=False)


@pytest.fixture
def import_all(tmp_path):
    def run(scale=1.0):
        found = find_meshes(tmp_path / "in")
        return {mesh.name: import_mesh(mesh, scale, tmp_path / "cache") for mesh in found}

    (tmp_path / "in").mkdir()
    return run


@pytest.fixture
def meshes(tmp_path, import_all):
    """A folder with one good mesh and one of each broken kind."""
    folder = tmp_path / "in"
    box().export(folder / "good.obj")
    open_shell().export(folder / "open.ply")
    doubled_sheet().export(folder / "sheet.obj")
    box(40, 60, 100).export(folder / "millimetres.stl")
    (folder / "nan.obj").write_text(
        "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 nan\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 1 3 4\n"
    )
    (folder / "huge.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "f 1 2 3\n" * 2_000_000)
    (folder / "noise.glb").write_bytes(np.random.default_rng(0).bytes(3000))
    (folder / "truncated.stl").write_bytes(box().export(file_type="stl")[:300])
    return folder


REASONS = {
    "huge": "at most 200000 faces",
    "millimetres": "in millimetres, give --scale 0.001",
    "nan": "finite vertices",
    "noise": "readable mesh",
    "open": "closed mesh",
    "sheet": "wanted a solid",
    "truncated": "wanted",
}


def test_broken_meshes_are_named_and_the_good_one_is_kept(meshes, import_all):
    results = import_all()
    assert [name for name, result in results.items() if isinstance(result, UsableMesh)] == ["good"]
    assert set(results) == {"good", *REASONS}
    for name, reason in REASONS.items():
        assert reason in results[name].reason, name
        assert f"{name}." in results[name].reason
        assert "\n" not in results[name].reason
    check_any_usable(list(results.values()))


def test_the_command_prints_what_is_usable_and_what_is_not(meshes, tmp_path, capsys):
    main(["objects", "import", str(meshes), "--out", str(tmp_path / "out")])
    text = capsys.readouterr().out
    assert "1 usable objects, 1 of them graspable" in text
    assert "40 × 60 × 100" in text
    assert "7 of 8 meshes skipped" in text
    for name, reason in REASONS.items():
        assert any(line.startswith(f"  {name}: ") and reason in line for line in text.splitlines())
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["good.obj"]


def test_auto_scale_is_reported_per_object(tmp_path, import_all, capsys):
    box().export(tmp_path / "in" / "a.obj")
    box(4, 6, 10).export(tmp_path / "in" / "b.obj")
    box(40, 60, 100).export(tmp_path / "in" / "c.obj")
    results = import_all("auto")
    assert [result.scale for result in results.values()] == [1.0, 0.01, 0.001]
    for result in results.values():
        np.testing.assert_allclose(result.obj.visual.extents, [0.04, 0.06, 0.1])
    main(["objects", "import", str(tmp_path / "in"), "--scale", "auto"])
    assert "scale" in capsys.readouterr().out


def test_a_folder_all_in_millimetres_is_refused_with_the_option_to_give(tmp_path, import_all, capsys):
    for name in "abc":
        box(40, 60, 100).export(tmp_path / "in" / f"{name}.obj")
    with pytest.raises(ObjectError, match=r"all 3 seem to be in millimetres: give --scale 0.001"):
        check_any_usable(list(import_all().values()))
    with pytest.raises(SystemExit) as stop:
        main(["objects", "import", str(tmp_path / "in")])
    assert stop.value.code == 2
    assert "--scale 0.001" in capsys.readouterr().err
    main(["objects", "import", str(tmp_path / "in"), "--scale", "0.001"])
    assert "3 usable objects" in capsys.readouterr().out


def test_broken_for_several_reasons_names_no_unit(tmp_path, import_all):
    box(40, 60, 100).export(tmp_path / "in" / "a.obj")
    open_shell().export(tmp_path / "in" / "b.obj")
    with pytest.raises(ObjectError, match="all 2 are broken"):
        check_any_usable(list(import_all().values()))


def test_what_is_written_is_read_back_bit_by_bit(tmp_path, import_all, monkeypatch):
    # A notch makes it need decomposition; odd numbers make every digit count.
    cup = trimesh.creation.revolve([[0, 0], [0.03, 0], [0.03, 0.1], [0.025, 0.1], [0.025, 0.01], [0, 0.01]])
    cup.apply_scale(1000 / 3)
    cup.export(tmp_path / "in" / "cup.ply")
    monkeypatch.setattr(decompose, "_decompose", lambda mesh: (mesh.convex_hull,) * 2)
    first = import_all(0.003)["cup"]
    assert isinstance(first, UsableMesh)
    write_object(first.obj, tmp_path)

    def forbidden(mesh):
        raise AssertionError("decomposed again")

    monkeypatch.setattr(decompose, "_decompose", forbidden)
    (source,) = resolve_objects(str(tmp_path / "cup.obj"), tmp_path / "cache")
    again = source.load()
    np.testing.assert_array_equal(again.visual.vertices, first.obj.visual.vertices)
    np.testing.assert_array_equal(again.visual.faces, first.obj.visual.faces)
    np.testing.assert_allclose(again.resting_poses, first.obj.resting_poses, atol=1e-12)
    assert again.name == "cup"


def test_objects_that_the_hand_cannot_grasp_are_written_only_on_request(tmp_path, import_all, capsys):
    box(0.2, 0.2, 0.2).export(tmp_path / "in" / "cube.obj")
    source, out = str(tmp_path / "in"), str(tmp_path / "out")
    with pytest.raises(SystemExit) as stop:
        main(["objects", "import", source, "--out", out])
    assert stop.value.code == 2
    captured = capsys.readouterr()
    assert "too big: 200 mm" in captured.out
    assert "--keep-all" in captured.err
    main(["objects", "import", source, "--out", out, "--keep-all"])
    assert [mesh.name for mesh in find_meshes(out)] == ["cube"]


@pytest.mark.parametrize("target", ["in/out", "full"])
def test_targets_that_would_mix_meshes_are_refused_before_any_work(tmp_path, import_all, capsys, target):
    box().export(tmp_path / "in" / "a.obj")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "other.obj").write_text("")
    with pytest.raises(SystemExit) as stop:
        main(["objects", "import", str(tmp_path / "in"), "--out", str(tmp_path / target)])
    assert stop.value.code == 2
    captured = capsys.readouterr()
    assert "wanted a" in captured.err
    assert captured.out == ""


@pytest.mark.parametrize("scale", ["0", "-1", "nan"])
def test_a_senseless_scale_is_refused(tmp_path, import_all, capsys, scale):
    box().export(tmp_path / "in" / "a.obj")
    with pytest.raises(SystemExit) as stop:
        main(["objects", "import", str(tmp_path / "in"), "--scale", scale])
    assert stop.value.code == 2
    assert "positive number" in capsys.readouterr().err


def test_a_broken_mesh_is_a_value_and_not_an_exception(tmp_path, import_all):
    (tmp_path / "in" / "a.obj").write_text("nonsense")
    assert isinstance(import_all()["a"], BrokenMesh)
