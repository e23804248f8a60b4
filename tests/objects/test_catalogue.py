import pickle

import pytest
import trimesh

from ffhnet.errors import InputFileError, ObjectError
from ffhnet.objects.catalogue import DEFAULT_COUNT, resolve_objects
from ffhnet.objects.procedural import object_name


def test_a_split_names_its_first_objects():
    sources = resolve_objects("procedural-test:3")
    assert [source.name for source in sources] == [object_name(2_000_000 + k) for k in range(3)]
    assert sources[1].load().name == sources[1].name
    assert len(resolve_objects("procedural-val")) == DEFAULT_COUNT


def test_several_specifications_are_taken_in_their_order(tmp_path):
    trimesh.creation.box(extents=[0.04, 0.05, 0.06]).export(tmp_path / "a.obj")
    sources = resolve_objects(f"varied-val:2, {tmp_path},procedural-val:1")
    assert [source.name for source in sources] == [
        object_name(4_000_000), object_name(4_000_001), "a", object_name(1_000_000)
    ]  # fmt: skip


def test_a_single_name_is_found():
    (source,) = resolve_objects(object_name(5))
    assert source.load().name == object_name(5)


def test_sources_can_be_sent_to_another_process():
    (source,) = resolve_objects(object_name(5))
    assert pickle.loads(pickle.dumps(source)).load().name == object_name(5)


def test_files_and_folders_are_found_and_not_read_before_load(tmp_path):
    trimesh.creation.box(extents=[0.04, 0.05, 0.06]).export(tmp_path / "a.obj")
    (tmp_path / "b.obj").write_text("nonsense")
    good, bad = resolve_objects(str(tmp_path))
    assert good.load().name == "a"
    with pytest.raises((InputFileError, ObjectError)):
        bad.load()
    (single,) = resolve_objects(str(tmp_path / "a.obj"))
    assert single.load().name == "a"


@pytest.mark.parametrize(
    "spec",
    [
        "procedural-tests",
        "procedural-test:",
        "procedural-test:x",
        "procedural-test:0",
        "nowhere",
        "",
        "procedural-val:1,",
    ],
)
def test_specifications_that_name_nothing_are_refused(spec):
    with pytest.raises(ObjectError, match="wanted"):
        resolve_objects(spec)
