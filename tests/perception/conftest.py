from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def captures():
    """Folder of real captures, which are not part of the repository."""
    folder = Path(__file__).parents[2].parent / "shared" / "data" / "captures"
    if not folder.is_dir():
        pytest.skip("needs the real captures in ../shared/data/captures, which the repository does not ship")
    return folder
