"""Work is done once however many ask for it, in turn between people, and not for nobody."""

import asyncio
from collections import Counter

import pytest

from ico3d.recording.guiding.fair_queue import FairQueue


class Worker:
    """Work that goes on until it is let go, and is noted."""

    def __init__(self, places=1):
        self.queue = FairQueue(places)
        self.begun = []
        self._may_end = Counter()

    def ask(self, whose, key):
        async def work():
            self.begun.append(key)
            while not self._may_end[key]:
                await asyncio.sleep(0)
            if key == "wrong":
                raise ValueError(key)

        return asyncio.create_task(self.queue.done(whose, key, work))

    async def end(self, *keys):
        self._may_end.update(keys)
        await settled()


async def settled():
    for _ in range(20):
        await asyncio.sleep(0)


async def test_all_who_ask_meanwhile_share_one_piece_of_work():
    worker = Worker()
    asked = [worker.ask("Eve", "a") for _ in range(9)]
    await settled()
    asked += [worker.ask("Eve", "a") for _ in range(9)]
    await settled()
    await worker.end("a")
    assert all(one.done() for one in asked) and worker.begun == ["a"]
    await worker.ask("Eve", "a")
    assert worker.begun == ["a", "a"]


async def test_all_who_ask_learn_what_went_wrong_and_the_next_one_begins():
    worker = Worker()
    asked = [worker.ask("Eve", "wrong") for _ in range(3)]
    after = worker.ask("Bob", "b")
    await worker.end("wrong", "b")
    for one in asked:
        with pytest.raises(ValueError, match="wrong"):
            await one
    await after


async def test_people_take_turns():
    worker = Worker()
    for key in ("e1", "e2", "e3", "e4"):
        worker.ask("Eve", key)
    for key in ("b1", "b2"):
        worker.ask("Bob", key)
    await settled()
    await worker.end("e1", "e2", "e3", "e4", "b1", "b2")
    assert worker.begun == ["e1", "e2", "b1", "e3", "b2", "e4"]


async def test_what_nobody_waits_for_any_more_is_not_begun_and_what_has_begun_is_ended():
    worker = Worker()
    first, *others = [worker.ask("Eve", key) for key in ("a", "b", "c")]
    joined = worker.ask("Bob", "c")
    await settled()
    for one in (first, *others):
        one.cancel()
    await settled()
    await worker.end("a", "b", "c")
    assert worker.begun == ["a", "c"] and joined.done() and not joined.cancelled()
    again = worker.ask("Eve", "b")
    await settled()
    assert again.done() and worker.begun == ["a", "c", "b"]


async def test_as_much_is_done_at_a_time_as_there_are_places():
    worker = Worker(places=2)
    for key in "abcd":
        worker.ask(key, key)
    await settled()
    assert worker.begun == ["a", "b"]
    await worker.end("b")
    assert worker.begun == ["a", "b", "c"]
    await worker.end(*"acd")


async def test_what_follows_a_piece_needs_no_place_and_is_waited_for():
    queue, may_follow, followed = FairQueue(1), asyncio.Event(), []

    async def seven():
        return 7

    async def follow(found):
        await may_follow.wait()
        followed.append(found)
        return found + 1

    first = asyncio.create_task(queue.done("Eve", "a", seven, follow))
    await settled()
    assert await queue.done("Bob", "b", seven) == 7 and not first.done()
    joined = asyncio.create_task(queue.done("Eve", "a", seven, follow))
    await settled()
    first.cancel()
    may_follow.set()
    assert await joined == 8 and followed == [7]


async def test_what_goes_wrong_afterwards_is_told():
    async def work():
        return None

    async def wrong(_):
        raise ValueError("then")

    with pytest.raises(ValueError, match="then"):
        await FairQueue(1).done("Eve", "a", work, wrong)
