"""An event loop whose clock jumps over every wait: minutes of conversation in seconds, exactly.

Time stands still while anything runs, in the loop or in its threads. What a test measures is what
the code waits for, whatever else the machine does.

A folder whose tests run in such loops imports `pytest_asyncio_loop_factories` and `outside` into
its conftest.
"""

import asyncio
import contextlib
import functools
import selectors
import time
from unittest import mock

import pytest
from anyio import to_thread

from ico3d.common.sphinx import SphinxProcess

CALENDAR = 1.7e9  # s: what `time.time` shows at 0
TICK = 1e-6  # s that every wait takes: what is shorter than a number's last digit would never end
DELIVERY = 0.0005  # s of real time within which what one socket sent has reached another


class JumpingSelector(selectors.DefaultSelector):
    """Looks for events without waiting; where there are none, time moves on."""

    loop: "VirtualLoop"

    def select(self, timeout=None):
        events = super().select(0)
        if events or (timeout is not None and timeout <= 0):
            return events
        if self.loop.jobs or timeout is None:  # a thread or a process works: its end is an event
            return super().select(10)
        if len(self.get_map()) > 1 and (events := super().select(DELIVERY)):
            return events
        self.loop.now += timeout
        return []


class VirtualLoop(asyncio.SelectorEventLoop):
    """Runs on virtual seconds; `time` shows them too as long as it runs."""

    def __init__(self):
        self.now, self.jobs = 1000.0, 0
        selector = JumpingSelector()
        selector.loop = self
        super().__init__(selector)
        self._clock_resolution = 1e-9

    def time(self):
        return self.now

    def call_later(self, delay, callback, *args, context=None):
        return super().call_later(max(delay, TICK), callback, *args, context=context)

    def run_forever(self):
        clocks = {
            "monotonic": self.time,
            "perf_counter": self.time,
            "monotonic_ns": lambda: int(self.now * 1e9),
            "time": lambda: CALENDAR + self.now,
        }
        with mock.patch.multiple(time, **clocks):
            super().run_forever()

    def run_in_executor(self, executor, func, *args):
        future = super().run_in_executor(executor, func, *args)
        self.jobs += 1
        future.add_done_callback(self._ended)
        return future

    def _ended(self, _):
        self.jobs -= 1


@contextlib.contextmanager
def standing_still():
    """Within, virtual time stands still: what is awaited happens outside of the loop."""
    loop = asyncio.get_running_loop()
    if not isinstance(loop, VirtualLoop):
        yield
        return
    loop.jobs += 1
    try:
        yield
    finally:
        loop.jobs -= 1


def timeless(call):
    """A coroutine function for which virtual time stands still."""

    @functools.wraps(call)
    async def called(*args, **options):
        with standing_still():
            return await call(*args, **options)

    return called


def run(coroutine):
    """Runs a coroutine in virtual time."""
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        return runner.run(coroutine)


def pytest_asyncio_loop_factories(item):
    """Tests run in virtual time, but for those that are marked as `real_time`."""
    real = item.get_closest_marker("real_time")
    return {"real time": asyncio.new_event_loop} if real else {"virtual time": VirtualLoop}


@pytest.fixture(autouse=True)
def outside(monkeypatch):
    """Virtual time stands still for what happens in processes and in threads of anyio's."""
    for place, name in ((SphinxProcess, "_ask"), (SphinxProcess, "close"), (to_thread, "run_sync")):
        monkeypatch.setattr(place, name, timeless(getattr(place, name)))
