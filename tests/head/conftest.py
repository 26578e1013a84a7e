"""What tests of heads share."""

import sys
from pathlib import Path

import numba
import pytest
import torch

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "capture"))

from tiny_capture import TinyCapture


@pytest.fixture(autouse=True, scope="module")
def one_thread():
    """On busy cores, threads of tiny kernels wait for one another far longer than they work."""
    threads = numba.get_num_threads(), torch.get_num_threads()
    numba.set_num_threads(1)
    torch.set_num_threads(1)
    yield
    numba.set_num_threads(threads[0])
    torch.set_num_threads(threads[1])


@pytest.fixture
def tiny(tmp_path) -> TinyCapture:
    return TinyCapture(tmp_path / "tiny")
