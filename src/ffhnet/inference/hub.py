"""Weights from a repository of a model hub. Needs the extra `hub`."""

from __future__ import annotations

import re
from pathlib import Path

from ffhnet.errors import MissingExtraError, WeightsError
from ffhnet.inference.weights_calibration import CALIBRATION_FILE
from ffhnet.model.checkpoint import CONFIG_FILE, EVALUATOR_FILE, GENERATOR_FILE

_FILES = [CONFIG_FILE, GENERATOR_FILE, EVALUATOR_FILE, CALIBRATION_FILE]
_REPOSITORY = re.compile(r"(\w[\w.-]*/\w[\w.-]*)(?:@(\w[\w./-]*))?")


def is_repository(name: str) -> bool:
    """Whether a name looks like that of a repository: "org/name" or "org/name@revision"."""
    return _REPOSITORY.fullmatch(name) is not None


def download(name: str) -> Path:
    """The folder in the hub's cache with a repository's weights, brought there first if need be.

    Of a repository only numbers and their description are taken: safetensors and JSON. Nothing in it is run.
    Without a network, what is in the cache is taken.

    Args:
        name: "org/name", or "org/name@revision" for a branch, a tag or a commit.

    Raises:
        MissingExtraError: huggingface_hub is not installed.
        WeightsError: no such repository or revision, or neither a network nor a copy in the cache.
    """
    matched = _REPOSITORY.fullmatch(name)
    if matched is None:
        raise WeightsError(f"wanted a repository such as org/name or org/name@revision, got {name!r}")
    try:
        from huggingface_hub import snapshot_download
    except ImportError as error:
        raise MissingExtraError(
            f"no folder {name!r}; to take it from a model hub: pip install 'ffhnet[hub]'"
        ) from error
    repository, revision = matched.groups()
    try:
        return Path(snapshot_download(repository, revision=revision, allow_patterns=_FILES))
    # The hub's errors have no common base, and not the same one in all its versions.
    except Exception as error:
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise WeightsError(f"no folder {name!r}, and nothing from a model hub: {reason}") from error
