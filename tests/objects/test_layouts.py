from pathlib import Path

import pytest

from ffhnet.errors import InputFileError, ObjectError
from ffhnet.objects.layouts import find_meshes


def make_files(folder: Path, *names: str) -> Path:
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    return folder


def found_in(folder: Path, layout: str | None = None) -> dict[str, tuple[str, str]]:
    meshes = find_meshes(folder, layout)
    assert [mesh.name for mesh in meshes] == sorted({mesh.name for mesh in meshes})
    return {mesh.name: (mesh.path.relative_to(folder).as_posix(), mesh.layout) for mesh in meshes}


def test_ycb(tmp_path):
    make_files(
        tmp_path,
        "003_cracker_box/google_16k/nontextured.ply",
        "003_cracker_box/google_16k/nontextured.stl",
        "003_cracker_box/google_16k/textured.obj",
        "003_cracker_box/google_512k/nontextured.ply",
        "003_cracker_box/clouds/merged_cloud.ply",
        "003_cracker_box/poisson/nontextured.ply",
        "041_small_marker/tsdf/textured.obj",
        "notes.txt",
    )
    assert found_in(tmp_path) == {
        "003_cracker_box": ("003_cracker_box/google_16k/nontextured.ply", "ycb"),
        "041_small_marker": ("041_small_marker/tsdf/textured.obj", "ycb"),
    }


def test_google_scanned_objects(tmp_path):
    make_files(
        tmp_path, "Mug/meshes/model.obj", "Mug/meshes/model.mtl", "Mug/model.sdf", "Mug/thumbnails/0.jpg"
    )
    assert found_in(tmp_path) == {"Mug": ("Mug/meshes/model.obj", "gso")}


@pytest.mark.parametrize("folder", ["textured_meshes/", ""])
def test_bigbird_prefers_the_closed_poisson_surface(tmp_path, folder):
    poisson, tsdf = (
        f"advil/{folder}optimized_{kind}_texture_mapped_mesh.obj" for kind in ("poisson", "tsdf")
    )
    make_files(tmp_path, tsdf, "advil/clouds/NP1_0.ply")
    assert found_in(tmp_path) == {"advil": (tsdf, "bigbird")}
    make_files(tmp_path, poisson)
    assert found_in(tmp_path) == {"advil": (poisson, "bigbird")}


def test_kit_as_folders_of_the_web_download(tmp_path):
    make_files(
        tmp_path,
        *(
            f"191_OrangeMarmelade/meshes/OrangeMarmelade_{kind}.obj"
            for kind in ("25k_tex", "800_tex", "Orig_tex")
        ),
        *(f"Curry/Curry_{kind}.obj" for kind in ("25k_tex", "5k_tex", "800_tex", "5k", "250_collision")),
        "Dog/Dog_Orig.obj",
    )
    assert found_in(tmp_path) == {
        "191_OrangeMarmelade": ("191_OrangeMarmelade/meshes/OrangeMarmelade_25k_tex.obj", "kit"),
        "Curry": ("Curry/Curry_5k_tex.obj", "kit"),
        "Dog": ("Dog/Dog_Orig.obj", "kit"),
    }


def test_kit_as_a_flat_folder_gives_each_object_once(tmp_path):
    make_files(
        tmp_path, "Curry_25k_tex.obj", "Curry_800_tex.obj", "Curry_5k_tex.obj", "Soup_800.obj", "Dog.obj"
    )
    assert found_in(tmp_path) == {
        "Curry": ("Curry_5k_tex.obj", "kit"),
        "Dog": ("Dog.obj", "bare"),
        "Soup": ("Soup_800.obj", "kit"),
    }
    assert list(found_in(tmp_path, "bare")) == [
        "Curry_25k_tex",
        "Curry_5k_tex",
        "Curry_800_tex",
        "Dog",
        "Soup_800",
    ]


def test_hope_as_folders_and_flat(tmp_path):
    make_files(tmp_path, "Corn/google_16k/textured.obj", "Milk/textured.obj", "Tuna.obj")
    assert found_in(tmp_path, "hope") == {
        "Corn": ("Corn/google_16k/textured.obj", "hope"),
        "Milk": ("Milk/textured.obj", "hope"),
        "Tuna": ("Tuna.obj", "hope"),
    }


def test_a_bare_folder(tmp_path):
    make_files(tmp_path, "a.obj", "B.STL", "c.glb", "c.ply", "readme.md", "empty/readme.md")
    (tmp_path / "d").mkdir()
    (tmp_path / "d" / "large.obj").write_text("much more text")
    (tmp_path / "d" / "small.ply").write_text("text")
    assert found_in(tmp_path) == {
        "B": ("B.STL", "bare"),
        "a": ("a.obj", "bare"),
        "c": ("c.ply", "bare"),
        "d": ("d/small.ply", "bare"),
    }


def test_a_named_layout_leaves_out_what_does_not_fit(tmp_path):
    make_files(tmp_path, "Mug/meshes/model.obj", "Cup/cup.obj", "003_box/google_16k/textured.obj", "flat.obj")
    assert list(found_in(tmp_path)) == ["003_box", "Cup", "Mug", "flat"]
    assert list(found_in(tmp_path, "gso")) == ["Mug"]
    assert list(found_in(tmp_path, "ycb")) == ["003_box"]
    with pytest.raises(InputFileError, match="as in BigBIRD"):
        find_meshes(tmp_path, "bigbird")


def test_absent_and_empty_folders_and_unknown_layouts_are_refused(tmp_path):
    with pytest.raises(InputFileError, match="there is none"):
        find_meshes(tmp_path / "none")
    with pytest.raises(InputFileError, match="found none"):
        find_meshes(tmp_path)
    with pytest.raises(ObjectError, match="layout out of ycb"):
        find_meshes(tmp_path, "shapenet")
