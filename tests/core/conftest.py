import oncue_core
import pytest

from .geometry import room_with_a_bench, sit_on_the_bench


@pytest.fixture(scope="session")
def bench_scene() -> oncue_core.SceneIndex:
    """A bench in an empty room."""
    return oncue_core.index_scene(*room_with_a_bench()).result()


@pytest.fixture
def bench_task() -> dict:
    return sit_on_the_bench()
