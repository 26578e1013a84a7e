"""An event loop whose clock jumps over every wait: minutes of conversation in seconds, exactly.

Time stands still while anything runs, in the loop or in its threads. What a test measures is what
the code waits for, whatever else the machine does.
"""

import asyncio
import selectors
import time

CALENDAR = 1.7e9  # s: what `time.time` shows at 0


class JumpingSelector(selectors.DefaultSelector):
    """Looks for events without waiting; where there are none, time moves on."""

    loop = None

    def select(self, timeout=None):
        events = super().select(0)
        if events or (timeout is not None and timeout <= 0):
            return events
        if self.loop.jobs or timeout is None:  # a thread works: its end is an event
            return super().select(10)
        self.loop.now += timeout
        return []


class VirtualLoop(asyncio.SelectorEventLoop):
    """Runs on virtual seconds."""

    def __init__(self):
        self.now, self.jobs = 1000.0, 0
        selector = JumpingSelector()
        selector.loop = self
        super().__init__(selector)
        self._clock_resolution = 1e-9

    def time(self):
        return self.now

    def run_in_executor(self, executor, func, *args):
        future = super().run_in_executor(executor, func, *args)
        self.jobs += 1
        future.add_done_callback(self._ended)
        return future

    def _ended(self, _):
        self.jobs -= 1


def run(monkeypatch, coroutine):
    """Runs a coroutine in virtual time, with `time` showing it too."""
    loop = VirtualLoop()
    monkeypatch.setattr(time, "monotonic", loop.time)
    monkeypatch.setattr(time, "perf_counter", loop.time)
    monkeypatch.setattr(time, "monotonic_ns", lambda: int(loop.now * 1e9))
    monkeypatch.setattr(time, "time", lambda: CALENDAR + loop.now)
    with asyncio.Runner(loop_factory=lambda: loop) as runner:
        return runner.run(coroutine)
