"""A real server in the test's own event loop, on a random bundle."""

import asyncio
import contextlib
import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
import soxr
from loguru import logger

logger.remove()  # before pipecat is imported: it logs its start

from ico3d.bundle.format import Bundle  # noqa: E402
from ico3d.chat.serving import server  # noqa: E402
from ico3d.chat.serving.sessions import Sessions  # noqa: E402
from ico3d.chat.settings.conversation import ChatSettings, Choice  # noqa: E402
from ico3d.common.espeak import synthesize  # noqa: E402

OFFLINE = ChatSettings(language=Choice("persona-notes"))
RANDOM_BUNDLE = Path(__file__).parents[1] / "support" / "bundles" / "random_bundle.py"


def random_bundle_module(name="random_bundle"):
    spec = importlib.util.spec_from_file_location(name, RANDOM_BUNDLE.with_stem(name))
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def bundle_path(tmp_path_factory):
    path = tmp_path_factory.mktemp("bundle") / "random.ico3d"
    random_bundle_module().write_random_bundle(path)
    return path


@pytest.fixture(scope="session")
def bundle(bundle_path):
    return Bundle.open(bundle_path)


@pytest.fixture(scope="session")
def body(tmp_path_factory):
    """A bundle of a body alone."""
    random_bundle_module()
    path = tmp_path_factory.mktemp("bundle") / "body.ico3d"
    random_bundle_module("random_body").write_random_body(path)
    return Bundle.open(path)


@pytest.fixture(scope="session")
def person(tmp_path_factory):
    """A bundle of a head on a body."""
    for name in ("random_bundle", "random_body"):
        random_bundle_module(name)
    path = tmp_path_factory.mktemp("bundle") / "person.ico3d"
    random_bundle_module("random_whole").write_random_whole(path)
    return Bundle.open(path)


@pytest.fixture(scope="session")
def question():
    """ "Who are you?" as (S,) int16 at 16 kHz, without the silence around it."""
    speech = synthesize("What is your name?", voice="en-us", rate=150)
    samples = soxr.resample(speech.samples, speech.rate, 16000)
    loud = np.nonzero(np.abs(samples) > 0.02 * np.abs(samples).max())[0]
    return (samples[loud[0] : loud[-1]] * 32767).astype(np.int16)


def free_port():
    """A port that nobody listens on."""
    with server.bind("127.0.0.1", 0) as listener:
        return listener.getsockname()[1]


@contextlib.asynccontextmanager
async def serving(
    bundle, settings=None, resume_seconds=30.0, persona=None, adapt=lambda avatar: avatar
):
    """Yields the URL and the sessions of a running server; by default the offline one.

    `adapt` changes what its sessions share.
    """
    listener = server.bind("127.0.0.1", 0)
    avatar, sessions = None, None
    if bundle.manifest.head:
        avatar = adapt(server.open_avatar(bundle, settings or OFFLINE, persona))
        sessions = Sessions(avatar, resume_seconds)
    running = server.make_server(server.make_app(bundle, avatar, "127.0.0.1", sessions))
    task = asyncio.create_task(running.serve(sockets=[listener]))
    while not running.started:
        await asyncio.sleep(0.01)
    try:
        yield server.address(listener), sessions
    finally:
        running.should_exit = True
        await task


@pytest.fixture
async def served(bundle):
    async with serving(bundle) as (url, sessions):
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
