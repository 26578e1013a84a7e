"""Who needs a result soonest is served first, and nobody's place is lost."""

import asyncio
import threading

import pytest

from ico3d.chat.workers import Workers

pytestmark = pytest.mark.real_time  # threads wait for what happens in the loop

PATIENCE = 5.0  # s


class Gate:
    """Work that waits until it may go on, and notes when it began."""

    def __init__(self):
        self.begun, self.open = [], threading.Event()

    def work(self, name):
        self.begun.append(name)
        assert self.open.wait(PATIENCE)
        return name

    async def wait(self, count):
        async with asyncio.timeout(PATIENCE):
            while len(self.begun) < count:
                await asyncio.sleep(0.001)


async def test_the_earliest_comes_first():
    gate, workers = Gate(), Workers(threads=1)
    first = asyncio.create_task(workers.run(9.0, gate.work, "first"))
    await gate.wait(1)
    dues = {"late": 3.0, "early": 1.0, "soon": 2.0, "soon, asked later": 2.0}
    tasks = [asyncio.create_task(workers.run(due, gate.work, name)) for name, due in dues.items()]
    await asyncio.sleep(0)
    gate.open.set()
    assert await asyncio.gather(first, *tasks) == ["first", *dues]
    assert gate.begun == ["first", "early", "soon", "soon, asked later", "late"]


async def test_no_more_run_than_there_are_threads():
    gate, workers = Gate(), Workers(threads=2)
    tasks = [asyncio.create_task(workers.run(0.0, gate.work, n)) for n in range(5)]
    await gate.wait(2)
    await asyncio.sleep(0.02)
    assert gate.begun == [0, 1]
    gate.open.set()
    assert await asyncio.gather(*tasks) == [0, 1, 2, 3, 4]


async def test_who_no_longer_waits_keeps_nobody_waiting():
    workers, begun = Workers(threads=1), []
    async with workers.turn(0.0):
        tasks = [asyncio.create_task(workers.run(n, begun.append, n)) for n in range(3)]
        await asyncio.sleep(0)
        tasks[0].cancel()
        await asyncio.sleep(0)
    tasks[1].cancel()  # it has just been told that it is its turn
    await tasks[2]
    await workers.run(0.0, begun.append, "after")
    assert begun == [2, "after"]


async def test_what_fails_gives_its_thread_back():
    workers = Workers(threads=1)

    def fail():
        raise ZeroDivisionError

    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            await workers.run(0.0, fail)
    assert await workers.run(0.0, abs, -1) == 1


def test_there_is_a_thread_wherever_it_runs():
    assert 1 <= Workers()._free <= 4
