import oncue_core
import pytest

from .geometry import room_with_a_bench


@pytest.fixture(scope="session")
def bench_scene() -> oncue_core.SceneIndex:
    """A bench in an empty room."""
    return oncue_core.index_scene(*room_with_a_bench()).result()


@pytest.fixture
def bench_task() -> dict:
    """From the room's middle round to the bench, to sit facing away from it."""
    return {
        "start": {"name": "Start", "position": [0.0, -1.5, 0.0], "yaw": 3.0},
        "cue": {"name": "Sit", "action_type": "sit", "position": [0.0, 1.95, 0.53], "yaw": 0.0},
    }
