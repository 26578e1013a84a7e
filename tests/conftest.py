"""What holds for all tests."""

import gc
import os
from multiprocessing import forkserver

import pytest
from hypothesis import HealthCheck, settings

# A busy machine makes examples slow, not wrong.
settings.register_profile("tests", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("tests")

# Threads of tiny kernels wait for one another far longer than they work. Whatever computes reads
# this once, when it is imported; what tests start inherits it.
for _threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")

# What is imported stays: looking for garbage in it takes a fifth of the time of collecting tests.
gc.disable()


@pytest.fixture(scope="module")
def two_threads():
    """Processes that are started may have two threads each, as far as their environment goes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NUMBA_NUM_THREADS", "2")
        patch.setenv("OMP_WAIT_POLICY", "passive")
        forkserver._forkserver._stop()  # one that was started before has other variables
        yield
        forkserver._forkserver._stop()


@pytest.fixture
def cuda(monkeypatch):
    """A CUDA device; where there is none, one as far as errors of devices go."""
    from support.pretended_cuda import cuda_or_pretended

    with cuda_or_pretended(monkeypatch) as device:
        yield device


def pytest_collection_finish() -> None:
    """From here on there is garbage; what was imported is none, and is not looked at again."""
    gc.freeze()
    gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files with slow tests come first: begun last, they would keep one process long alone."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


TOGETHER = {
    "capture/portrait/test_clip.py": "transformers",
    "capture/portrait/test_photometric_poses.py": "transformers",
    "chat/services/language/test_qwen.py": "transformers",
    "chat/services/recognition/test_whisper.py": "transformers",
    "chat/test_pipecat_internals.py": "transformers",
    "common/unpacking/test_weights.py": "transformers",
    "head/test_encoders.py": "transformers",
    "measure/test_expression.py": "transformers",
    "motion/recorded/test_cutting.py": "gestures",
    "motion/test_composing.py": "gestures",
    "motion/test_gestures.py": "gestures",
    "scripts/test_fuzz.py": "transformers",
    "speech/test_hubert.py": "transformers",
    "speech/test_training.py": "transformers",
    "splat/test_files_fuzz.py": "transformers",
    "splat/test_files_other.py": "transformers",
    "splat/test_files_ply.py": "transformers",
    "splat/test_primitive.py": "transformers",
    "training/test_acceleration.py": "transformers",
    "training/test_optimiser.py": "transformers",
}
"""Files that one process runs, because of what they share.

That is transformers, or the compiler of torch which transformers, torch.optim and gsply import:
both take seconds; or all gestures of a person, which take a second to be made.
"""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Processes take whole files, as `--dist loadfile` has it, and those in `TOGETHER` at once."""
    if config.getoption("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    class Scheduling(LoadFileScheduling):
        def _split_scope(self, nodeid):
            file = super()._split_scope(nodeid)
            shared = (group for end, group in TOGETHER.items() if file.endswith(end))
            return next(shared, file)

    return Scheduling(config, log)


def pytest_make_parametrize_id(val: object) -> str | None:
    """Names bytes by their length: names made of content differ where content does.

    Two processes that share the tests must collect the same names, and compressed files hold
    the time they were made at.
    """
    return f"{len(val)}-bytes" if isinstance(val, bytes) else None
