"""One machine takes neither all connections and places of a server nor all of its queue."""

import asyncio
import contextlib
from collections import Counter

import pytest

from ico3d.chat.serving import crowd as crowds
from ico3d.chat.serving.crowd import (
    MOST_REQUESTS,
    MOST_SOCKETS,
    UNKNOWN,
    Crowd,
    Meters,
    machine_of,
)
from ico3d.chat.serving.guard import Guard
from ico3d.chat.serving.waiting import MOST_WAITING, FullError, WaitingLine


@pytest.mark.parametrize(
    ("address", "machine"),
    [
        ("192.168.1.20", "192.168.1.20"),
        ("::ffff:192.168.1.20", "192.168.1.20"),
        ("2001:db8:1:2:3::4", "2001:db8:1:2::/64"),
        ("2001:db8:1:2:ffff::", "2001:db8:1:2::/64"),
        ("fe80::1", "fe80::1"),  # all neighbours have one prefix
        ("127.0.0.1", ""),
        ("::1", ""),
        ("::ffff:127.0.0.1", ""),
        ("_hidden", UNKNOWN),  # as proxies may put it
        ("[2001:db8::1]:80", UNKNOWN),
        ("", ""),
    ],
)
def test_a_machine_is_known_by_its_address_or_its_network(address, machine):
    assert machine_of((address, 50_000)) == machine


def test_nobody_is_nobody():
    assert machine_of(None) == ""


def test_closed_sockets_no_longer_count():
    crowd = Crowd(most=1)
    for _ in range(3):
        with contextlib.ExitStack() as held:
            machines = ["10.0.0.7", "10.0.0.7", "10.0.0.8", "", ""]
            may = [held.enter_context(crowd.one_more(machine)) for machine in machines]
        assert may == [True, False, True, True, True]


async def sent_to(guard, address, kind, received, told):
    """A request or handshake of an address that waits for the application, and what is answered.

    Of messages that come back, the entry `told` is kept.
    """
    sent = []

    async def send(message):
        sent.append(message.get(told))

    async def receive():
        return {"type": received}

    headers = [(b"host", b"10.0.0.1:8765")]
    scope = {"type": kind, "path": "/ws", "query_string": b"", "headers": headers}
    task = asyncio.create_task(guard(scope | {"client": (address, 1)}, receive, send))
    await asyncio.sleep(0)
    return task, sent


async def test_silent_sockets_of_one_machine_leave_room_for_others():
    held = asyncio.Event()

    async def app(scope, receive, send):
        await send({"type": "websocket.accept"})
        await held.wait()

    guard = Guard(app, "0.0.0.0")

    async def come(address):
        return await sent_to(guard, address, "websocket", "websocket.connect", "type")

    many = [await come("10.0.0.7") for _ in range(MOST_SOCKETS)]
    refused = await come("10.0.0.7")
    neighbour = await come("10.0.0.8")
    assert all(sent == ["websocket.accept"] for _, sent in [*many, neighbour])
    assert refused[1] == ["websocket.close"]
    held.set()
    await asyncio.gather(*(task for task, _ in [*many, refused, neighbour]))
    _, again = await come("10.0.0.7")
    assert again == ["websocket.accept"]


async def test_requests_of_one_machine_that_are_worked_on_are_counted():
    held = asyncio.Event()

    async def app(scope, receive, send):
        await held.wait()
        await send({"type": "http.response.start", "status": 200, "headers": []})

    guard = Guard(app, "0.0.0.0")

    async def ask(address):
        return await sent_to(guard, address, "http", "http.disconnect", "status")

    many = [await ask("10.0.0.7") for _ in range(MOST_REQUESTS)]
    refused, neighbour = await ask("10.0.0.7"), await ask("10.0.0.8")
    await refused[0]
    assert refused[1][0] == 429
    held.set()
    await asyncio.gather(*(task for task, _ in [*many, neighbour]))
    assert all(sent == [200] for _, sent in [*many, neighbour])
    again, sent = await ask("10.0.0.7")
    await again
    assert sent == [200]


async def test_dropped_pages_of_one_machine_leave_half_of_the_queue():
    line = WaitingLine(lambda: 0)
    for _ in range(MOST_WAITING // 2):
        line.leave(line.join(None, "10.0.0.7"), for_good=False)
    with pytest.raises(FullError):
        line.join(None, "10.0.0.7")
    for number in range(MOST_WAITING // 2):
        line.join(None, f"10.0.1.{number}")
    with pytest.raises(FullError):
        line.join(None, "")


def test_machines_do_not_use_up_each_others_share():
    now = 0.0
    meters = Meters(1.0, 2.0, lambda: now)
    assert [meters.take("10.0.0.7") for _ in range(3)] == [True, True, False]
    assert meters.take("10.0.0.8")
    assert all(meters.take("") for _ in range(9))  # nobody knows who that is
    now = 1.0
    assert meters.take("10.0.0.7") and not meters.take("10.0.0.7")


def test_who_used_nothing_lately_is_forgotten(monkeypatch):
    monkeypatch.setattr(crowds, "REMEMBERED", 3)
    meters = Meters(1.0, 1.0, lambda: 0.0)
    assert all(meters.take(f"10.0.0.{number}") for number in (1, 2, 3))
    assert not meters.take("10.0.0.1")  # and was the last to come
    assert meters.take("10.0.0.4")
    assert [meters.take(f"10.0.0.{number}") for number in (1, 3, 4)] == [False] * 3
    assert meters.take("10.0.0.2")
    for number in range(9):
        meters.take(f"10.0.1.{number}")
    assert len(meters._buckets) == 3


def test_thousands_of_networks_make_none_dearer():
    asked = []

    def now():
        asked.append(1)
        return 0.0

    meters = Meters(0.0, 2.0, now)  # nobody's bucket is ever full again
    for number in range(crowds.REMEMBERED + 10):
        meters.take(f"2001:db8:{number:x}::/64")
    asked.clear()
    for number in range(100):
        meters.take(f"2001:db9:{number:x}::/64")
    assert len(asked) <= 200  # as a bucket is made, and taken from


def has_half(held):
    return lambda machine, kept: machine == "" or held[machine] + kept < 2


async def test_one_machine_leaves_half_of_the_places():
    held, free = Counter(), 4
    line = WaitingLine(lambda: free, has_share=has_half(held))
    first, second, third = [line.join(None, "10.0.0.7") for _ in range(3)]
    assert [ticket.admitted for ticket in (first, second, third)] == [True, True, False]
    neighbour, unknown = line.join(None, "10.0.0.8"), line.join(None, "")
    assert neighbour.admitted and unknown.admitted  # before the third
    line.leave(first)
    assert third.admitted


async def test_who_has_his_share_may_still_wait():
    held = Counter({"10.0.0.7": 2})
    line = WaitingLine(lambda: 2, has_share=has_half(held))
    waiting = [line.join(None, "10.0.0.7") for _ in range(MOST_WAITING // 2)]
    assert not any(ticket.admitted for ticket in waiting)
    with pytest.raises(FullError):
        line.join(None, "10.0.0.7")
    assert line.join(None, "10.0.0.8").admitted
