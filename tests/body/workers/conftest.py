from multiprocessing import forkserver

import pytest


@pytest.fixture(scope="package", autouse=True)
def two_threads():
    """Workers may have two threads each, as far as the environment goes that they are born in."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NUMBA_NUM_THREADS", "2")
        patch.setenv("OMP_WAIT_POLICY", "passive")
        forkserver._forkserver._stop()  # one that was started before has other variables
        yield
        forkserver._forkserver._stop()
