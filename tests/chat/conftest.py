"""Random bundles, a question, a server that serves them; all of it in virtual time."""

import numpy as np
import pytest
import soxr
from loguru import logger

logger.remove()  # before pipecat is imported: it logs its start

from ico3d.bundle.format import Bundle  # noqa: E402
from ico3d.common.espeak.speech import synthesize  # noqa: E402
from support.bundles.random_body import write_random_body  # noqa: E402
from support.bundles.random_bundle import write_random_bundle  # noqa: E402
from support.bundles.random_whole import write_random_whole  # noqa: E402
from support.chat.serving import TYPED, serving  # noqa: E402
from support.chat.virtual_time import outside, pytest_asyncio_loop_factories  # noqa: E402, F401


@pytest.fixture(scope="session")
def bundle_path(tmp_path_factory):
    path = tmp_path_factory.mktemp("bundle") / "random.ico3d"
    write_random_bundle(path)
    return path


@pytest.fixture(scope="session")
def bundle(bundle_path):
    return Bundle.open(bundle_path)


@pytest.fixture(scope="session")
def body(tmp_path_factory):
    """A bundle of a body alone."""
    path = tmp_path_factory.mktemp("bundle") / "body.ico3d"
    write_random_body(path)
    return Bundle.open(path)


@pytest.fixture(scope="session")
def person(tmp_path_factory):
    """A bundle of a head on a body."""
    path = tmp_path_factory.mktemp("bundle") / "person.ico3d"
    write_random_whole(path)
    return Bundle.open(path)


@pytest.fixture(scope="session")
def question():
    """ "Who are you?" as (S,) int16 at 16 kHz, without the silence around it."""
    speech = synthesize("What is your name?", voice="en-us", rate=150)
    samples = soxr.resample(speech.samples, speech.rate, 16000)
    loud = np.nonzero(np.abs(samples) > 0.02 * np.abs(samples).max())[0]
    return (samples[loud[0] : loud[-1]] * 32767).astype(np.int16)


@pytest.fixture
async def served(bundle):
    async with serving(bundle) as (url, sessions):
        yield url, sessions


@pytest.fixture
async def typed(bundle):
    """The same for visitors who type."""
    async with serving(bundle, TYPED) as (url, sessions):
        yield url, sessions


@pytest.fixture
def given_up(monkeypatch):
    """The turns that pipecat ended because nothing was heard of them any more."""
    from pipecat.processors.aggregators.llm_response_universal import LLMUserAggregator

    turns, told = [], LLMUserAggregator._on_user_turn_stop_timeout

    async def give_up(self, controller):
        turns.append(controller)
        await told(self, controller)

    monkeypatch.setattr(LLMUserAggregator, "_on_user_turn_stop_timeout", give_up)
    return turns
