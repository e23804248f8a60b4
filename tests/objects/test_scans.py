from pathlib import Path

import numpy as np
import pytest
import trimesh

from ffhnet.errors import InputFileError, MissingExtraError, ObjectError
from ffhnet.objects import decompose
from ffhnet.objects.inertia import inertia
from ffhnet.objects.scans import load_scan

KIT_TEST = Path(__file__).parents[2] / "../shared/data/meshes/kit_test"


def box(scale: float = 1.0) -> trimesh.Trimesh:
    return trimesh.creation.box(extents=np.array([0.04, 0.06, 0.1]) * scale)


def bracket() -> trimesh.Trimesh:
    """An L, closed but far from convex."""
    outline = [[0, 0], [0.08, 0], [0.08, 0.03], [0.03, 0.03], [0.03, 0.1], [0, 0.1]]
    flat = np.array(outline)
    low = np.column_stack([flat[:, 0], np.zeros(6), flat[:, 1]])
    fan = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    side = [[k, (k + 1) % 6, 6 + k] for k in range(6)] + [
        [(k + 1) % 6, 6 + (k + 1) % 6, 6 + k] for k in range(6)
    ]
    faces = np.vstack([fan, fan[:, ::-1] + 6, np.array(side)[:, ::-1]])
    return trimesh.Trimesh(np.vstack([low, low + np.array([0, 0.05, 0])]), faces)


def write(mesh: trimesh.Trimesh, path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    mesh.export(path)
    return path


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl", ".glb"])
def test_a_box_loads_from_every_file_type(tmp_path, suffix):
    obj = load_scan(write(box(), tmp_path / f"tea{suffix}"), tmp_path / "cache")
    assert (obj.name, obj.family, len(obj.pieces)) == ("tea", "scan", 1)
    np.testing.assert_allclose(sorted(obj.visual.extents), [0.04, 0.06, 0.1], rtol=1e-5)
    assert obj.visual.bounds[0, 2] == pytest.approx(0, abs=1e-9)
    assert obj.mass == pytest.approx(0.12, rel=1e-4)
    assert obj.pose_names == ("standing", "lying_0", "lying_1")
    assert not (tmp_path / "cache").exists(), "a convex mesh needs no decomposition"


def test_millimetres_are_refused_and_read_with_a_scale(tmp_path):
    path = write(box(1000), tmp_path / "box.stl")
    with pytest.raises(ObjectError, match="millimetres"):
        load_scan(path)
    np.testing.assert_allclose(load_scan(path, scale=1e-3).visual.extents, [0.04, 0.06, 0.1], rtol=1e-5)


def test_an_l_is_split_into_pieces_and_cached(tmp_path, monkeypatch):
    pytest.importorskip("coacd", reason="the extra `sim` is not installed")
    path = write(bracket(), tmp_path / "bracket.obj")
    first = load_scan(path, tmp_path / "cache")
    assert len(first.pieces) >= 2
    assert sum(piece.volume for piece in first.pieces) == pytest.approx(first.visual.volume, rel=0.05)
    assert inertia(first).mass == first.mass
    (stored,) = (tmp_path / "cache").iterdir()

    def forbidden(mesh):
        raise AssertionError("decomposed again")

    monkeypatch.setattr(decompose, "_decompose", forbidden)
    again = load_scan(path, tmp_path / "cache")
    for a, b in zip(first.pieces, again.pieces, strict=True):
        np.testing.assert_allclose(a.bounds, b.bounds)
        assert a.volume == pytest.approx(b.volume)
    monkeypatch.undo()

    stored.write_bytes(stored.read_bytes()[:100])
    assert len(load_scan(path, tmp_path / "cache").pieces) == len(first.pieces)
    assert len(list((tmp_path / "cache").iterdir())) == 1, "no temporary files are left"


def test_a_can_with_recessed_ends_is_one_piece_and_a_glass_is_not(tmp_path, monkeypatch):
    monkeypatch.setattr(decompose, "_decompose", lambda mesh: (mesh.convex_hull,) * 2)
    for recess, pieces in [(0.005, 1), (0.02, 2), (0.096, 2)]:
        profile = [[0, 0], [0.033, 0], [0.033, 0.1], [0.03, 0.1], [0.03, 0.1 - recess], [0, 0.1 - recess]]
        path = write(trimesh.creation.revolve(profile, sections=32), tmp_path / f"can_{recess}.obj")
        assert len(load_scan(path, tmp_path / "cache").pieces) == pieces


def test_a_changed_mesh_is_not_served_from_the_cache(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(decompose, "_decompose", lambda mesh: asked.append(1) or (mesh.convex_hull,))
    mesh = bracket()
    load_scan(write(mesh, tmp_path / "bracket.obj"), tmp_path / "cache")
    mesh.apply_scale(1.01)
    load_scan(write(mesh, tmp_path / "bracket.obj"), tmp_path / "cache")
    assert len(asked) == 2


def test_a_cache_that_cannot_be_written_only_warns(tmp_path, monkeypatch):
    monkeypatch.setattr(decompose, "_decompose", lambda mesh: (mesh.convex_hull,))
    (tmp_path / "cache").write_text("a file where the folder should be")
    with pytest.warns(UserWarning, match="not cached"):
        load_scan(write(bracket(), tmp_path / "bracket.obj"), tmp_path / "cache")


def test_without_coacd_the_error_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "coacd", None)
    with pytest.raises(MissingExtraError, match=r"ffhnet\[sim\]"):
        load_scan(write(bracket(), tmp_path / "bracket.obj"), tmp_path / "cache")


def test_a_small_hole_and_flipped_faces_are_repaired(tmp_path):
    mesh = box()
    mesh.update_faces(np.arange(len(mesh.faces)) != 3)
    mesh.faces[5] = mesh.faces[5][::-1]
    obj = load_scan(write(mesh, tmp_path / "box.obj"))
    assert obj.visual.is_watertight
    assert obj.visual.volume == pytest.approx(0.04 * 0.06 * 0.1, rel=1e-5)


def test_inside_out_meshes_are_turned(tmp_path):
    mesh = box()
    mesh.invert()
    assert load_scan(write(mesh, tmp_path / "box.obj")).visual.volume > 0


def half_open() -> trimesh.Trimesh:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.04)
    ball.update_faces(ball.triangles_center[:, 2] < 0)
    return ball


def with_nan() -> str:
    return "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 nan\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 1 3 4\n"


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        (half_open(), "closed mesh"),
        (box(30), "centimetres, give --scale 0.01"),
        (box(1e-3), "in which unit"),
        (box(9000), "in which unit"),
        (trimesh.creation.box(extents=[0.1, 0.1, 1e-5]), "in every direction"),
    ],
)
def test_unusable_meshes_say_why(tmp_path, mesh, message):
    with pytest.raises(ObjectError, match=message):
        load_scan(write(mesh, tmp_path / "bad.ply"))


def test_too_many_faces_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("ffhnet.objects.mesh_files.MAX_FACES", 10)
    with pytest.raises(ObjectError, match="at most 10 faces"):
        load_scan(write(box(), tmp_path / "box.obj"))


@pytest.mark.parametrize(
    ("name", "content", "error"),
    [
        ("nan.obj", with_nan(), ObjectError),
        ("empty.obj", "", (InputFileError, ObjectError)),
        ("cloud.obj", "v 0 0 0\nv 1 0 0\n", (InputFileError, ObjectError)),
        ("index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", (InputFileError, ObjectError)),
        ("noise.ply", "ply\nformat ascii 1.0\nelement vertex 9\n", InputFileError),
        ("noise.glb", "not a glb", InputFileError),
        ("mesh.txt", "v 0 0 0\n", InputFileError),
    ],
)
def test_broken_files_raise_typed_errors(tmp_path, name, content, error):
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(error, match="wanted"):
        load_scan(path)


def test_an_absent_file_raises_a_typed_error(tmp_path):
    with pytest.raises(InputFileError, match="there is none"):
        load_scan(tmp_path / "none.obj")


@pytest.mark.skipif(not KIT_TEST.is_dir(), reason="the shared KIT meshes (../shared/data) are not here")
def test_a_real_scan_loads(tmp_path):
    obj = load_scan(KIT_TEST / "kit_CoughDropsLemon.obj", tmp_path)
    assert obj.pose_names[0] == "standing"
    np.testing.assert_allclose(obj.visual.extents, [0.0553, 0.0865, 0.1153], atol=2e-4)


@pytest.mark.skipif(not KIT_TEST.is_dir(), reason="the shared KIT meshes (../shared/data) are not here")
def test_a_real_scan_with_a_neck_is_split(tmp_path):
    pytest.importorskip("coacd", reason="the extra `sim` is not installed")
    obj = load_scan(KIT_TEST / "kit_BathDetergent.obj", tmp_path)
    assert 2 <= len(obj.pieces) <= 16
    assert sum(piece.volume for piece in obj.pieces) == pytest.approx(obj.visual.volume, rel=0.06)
    assert obj.pose_names[0] == "standing"
