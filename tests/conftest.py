"""What all tests share."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real motion capture and rooms, which the repository does not hold; the test is skipped where they are absent."""
    folder = Path(os.environ.get("ONCUE_SHARED", ROOT.parent / "shared")) / "data"
    if not folder.is_dir():
        pytest.skip(f"{folder} is absent: set ONCUE_SHARED to the folder with the motion capture and the rooms")
    return folder
