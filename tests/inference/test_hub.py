"""Weights of a model hub: found in a local cache, by revision; refused in one line where there is no way."""

import sys

import pytest

from ffhnet.errors import MissingExtraError, WeightsError
from ffhnet.inference import FFHNet, hub
from ffhnet.model import CheckpointInfo, FFHEvaluator, FFHGenerator, ModelConfig, save_checkpoint

MODEL = ModelConfig(num_joints=2, bps_size=32, pca_components=4, inner_width=16, width=24, generator="cvae")
NEEDS_HUB = "weights of a hub need the extra `hub`"
COMMITS = {"main": "a" * 40, "v1": "b" * 40}


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """A hub's cache with two revisions of one repository, and no network."""
    constants = pytest.importorskip(
        "huggingface_hub.constants", reason="weights of a hub need the extra `hub`"
    )
    monkeypatch.setattr(constants, "HF_HUB_CACHE", str(tmp_path))
    monkeypatch.setattr(constants, "HF_HUB_OFFLINE", True)
    repository = tmp_path / "models--lab--hand-weights"
    (repository / "refs").mkdir(parents=True)
    for revision, commit in COMMITS.items():
        (repository / "refs" / revision).write_text(commit)
        info = CheckpointInfo(f"hand_of_{revision}", ("a", "b"), (0.0, 0.0), (1.0, 1.0), MODEL)
        save_checkpoint(repository / "snapshots" / commit, info, FFHGenerator(MODEL), FFHEvaluator(MODEL))
    return repository


@pytest.mark.parametrize(
    ("name", "hand"),
    [
        ("lab/hand-weights", "hand_of_main"),
        ("lab/hand-weights@v1", "hand_of_v1"),
        (f"lab/hand-weights@{COMMITS['v1']}", "hand_of_v1"),
    ],
)
def test_from_pretrained_takes_a_repository(cache, name, hand):
    assert FFHNet.from_pretrained(name, device="cpu").info.hand == hand


def test_a_folder_goes_before_a_repository(cache, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    info = CheckpointInfo("hand_here", ("a", "b"), (0.0, 0.0), (1.0, 1.0), MODEL)
    save_checkpoint(tmp_path / "lab/hand-weights", info, FFHGenerator(MODEL), FFHEvaluator(MODEL))
    assert FFHNet.from_pretrained("lab/hand-weights", device="cpu").info.hand == "hand_here"


@pytest.mark.parametrize("name", ["lab/other", "lab/hand-weights@v2"])
def test_what_is_not_in_the_cache_is_refused_in_one_line(cache, name):
    with pytest.raises(WeightsError, match=f"no folder '{name}'") as refused:
        FFHNet.from_pretrained(name)
    assert "\n" not in str(refused.value)


def test_without_a_network_the_cache_is_taken_and_nothing_else(cache, monkeypatch):
    from huggingface_hub import constants

    monkeypatch.setattr(constants, "HF_HUB_OFFLINE", False)
    # Nobody answers at port 9 of this machine.
    monkeypatch.setattr(constants, "ENDPOINT", "http://127.0.0.1:9")
    monkeypatch.setattr(constants, "HUGGINGFACE_CO_URL_TEMPLATE", "http://127.0.0.1:9/{repo_id}/{filename}")
    assert hub.download("lab/hand-weights@v1").name == COMMITS["v1"]
    with pytest.raises(WeightsError, match="nothing from a model hub"):
        hub.download("lab/other")


def test_only_numbers_and_their_description_are_asked_for(monkeypatch, tmp_path):
    huggingface_hub = pytest.importorskip("huggingface_hub", reason=NEEDS_HUB)
    asked = {}

    def snapshot_download(repository, **options):
        asked.update(options, repository=repository)
        return str(tmp_path)

    monkeypatch.setattr(huggingface_hub, "snapshot_download", snapshot_download)
    assert hub.download("lab/hand-weights@v1") == tmp_path
    assert (asked["repository"], asked["revision"]) == ("lab/hand-weights", "v1")
    assert all(
        name.endswith((".safetensors", ".json")) and "*" not in name for name in asked["allow_patterns"]
    )


def test_pickled_weights_are_no_weights(cache):
    snapshot = cache / "snapshots" / COMMITS["main"]
    (snapshot / "generator.safetensors").rename(snapshot / "generator.bin")
    with pytest.raises(WeightsError, match=r"generator\.safetensors is missing"):
        FFHNet.from_pretrained("lab/hand-weights")


def test_without_the_extra_its_name_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "huggingface_hub", None)
    with pytest.raises(MissingExtraError, match=r"ffhnet\[hub\]"):
        FFHNet.from_pretrained("lab/hand-weights")


@pytest.mark.parametrize(
    "name", ["weights", "a/b/c", "../none", "./weights", "/a/b", "a/b@", "a b/c", "@v/1"]
)
def test_other_names_never_ask_the_hub(name):
    assert not hub.is_repository(name)
    with pytest.raises(WeightsError, match="no folder"):
        FFHNet.from_pretrained(name)
