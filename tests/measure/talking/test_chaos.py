"""Faults amid a talk and many visits, in virtual time: talks go on, and nothing stays behind."""

import asyncio
from dataclasses import replace
from random import Random

import psutil
import pytest

from ico3d.bundle.format import Bundle
from ico3d.measure.talking.chaos import CASES, SCRIPT, Stage, suffer
from ico3d.measure.talking.visits import VISITS, come_and_go
from support.bundles.random_bundle import write_random_bundle
from support.chat.serving import TYPED, serving

pytestmark = pytest.mark.slow

SHORT = [case for case in CASES if case.happens in ("ask", "drop")]


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    path = tmp_path_factory.mktemp("bundle") / "random.ico3d"
    write_random_bundle(path)
    return Bundle.open(path)


def scripted(avatar):
    return replace(avatar, services=SCRIPT.services())


async def emptied(sessions):
    async with asyncio.timeout(100):
        while len(sessions) or sessions._closing:
            await asyncio.sleep(0.1)


async def test_services_that_fail_and_connections_that_break(bundle):
    settings = replace(TYPED, max_sessions=2 * len(SHORT))
    async with serving(bundle, settings, adapt=scripted) as (url, sessions):
        outcomes = await asyncio.gather(*(suffer(case, Stage(url)) for case in SHORT))
        await emptied(sessions)
    for case, outcome in zip(SHORT, outcomes, strict=True):
        assert outcome.holds(case), (case.name, outcome)


async def test_visitors_who_come_and_go_leave_nothing_behind(bundle):
    """The first visits start what serves all; after as many again there is not more."""
    came, process = [], psutil.Process()

    def held():
        return len(asyncio.all_tasks()), process.num_fds()

    async def come(url, visits):
        def going_on():
            return len(came) < visits

        randoms = (Random(seed) for seed in range(3))
        await asyncio.gather(*(come_and_go(url, r, going_on, came.append) for r in randoms))

    async with serving(bundle, replace(TYPED, max_sessions=40), adapt=scripted) as (url, sessions):
        levels = []
        for visits in (6, 16):
            await come(url, visits)
            await emptied(sessions)
            await asyncio.sleep(1)
            levels.append(held())
    assert set(came) == {visit.__name__ for visit in VISITS}
    assert levels[1] == levels[0]
