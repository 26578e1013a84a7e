"""Records of TLS that are too many, or begin another handshake, end their connection."""

import asyncio
import contextlib
import ssl
from itertools import pairwise
from types import SimpleNamespace
from unittest import mock

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ico3d.chat.serving.crowd import Meters, peer_of
from ico3d.chat.serving.network import prompt, records
from ico3d.chat.serving.network.handshakes import Handshake
from ico3d.chat.serving.network.records import CHANGE_CIPHER, HANDSHAKE, CountedRecords

DATA = 23
REQUEST = b"GET /health HTTP/1.1\r\nHost: 127.0.0.1\r\n"


class Line:
    """A connection, and what deciphers it, which takes eleven bytes at a time."""

    def __init__(self, machine=""):
        self.came, self.closed, self.room = bytearray(), False, bytearray(11)
        transport = SimpleNamespace(is_closing=lambda: self.closed, abort=self.abort)
        self.counted = CountedRecords(transport, self, machine)  # type: ignore[arg-type]

    def abort(self):
        self.closed = True

    def get_buffer(self, hint):
        assert hint > 0
        return self.room

    def buffer_updated(self, size):
        self.came += self.room[:size]


def record(kind, size):
    return bytes([kind, 3, 3]) + size.to_bytes(2, "big") + bytes(size)


async def fed(data, *cuts, machine=""):
    """A line of a machine that has got the data, cut at these places."""
    line, places = Line(machine), [0, *sorted(cuts), len(data)]
    for begin, end in pairwise(places):
        line.counted.data_received(data[begin:end])
    return line


@given(st.data())
def test_what_comes_is_handed_on_however_it_is_cut(data):
    sizes = data.draw(st.lists(st.integers(0, 40), max_size=12))
    whole = b"".join(record(DATA, size) for size in sizes)
    cuts = data.draw(st.lists(st.integers(0, len(whole)), max_size=12))
    line = asyncio.run(fed(whole, *cuts))
    assert line.came == whole and not line.closed
    assert line.counted._left == 0 and line.counted._head == b""


@pytest.mark.parametrize("cut", [1, 4, 5, 6, 4000])
async def test_small_records_are_counted_wherever_they_are_cut(monkeypatch, cut):
    monkeypatch.setattr(records, "AT_ONCE", 700.0)
    monkeypatch.setattr(records, "RATE", 0.0)
    small = record(DATA, 0)
    good = await fed(small * 700, *range(cut, 700 * len(small), cut))
    assert not good.closed
    line = await fed(small * 701, *range(cut, 701 * len(small), cut))
    assert line.closed


async def test_lines_of_one_machine_count_together(monkeypatch):
    """Each within its own limit, some hundred lines would hold up everybody for seconds."""
    monkeypatch.setattr(records, "_machines", Meters(0.0, records.MACHINE_AT_ONCE, lambda: 0.0))
    whole = record(DATA, 0) * int(records.AT_ONCE)
    lines = [await fed(whole, machine="203.0.113.7") for _ in range(188)]
    each = records.AT_ONCE - records.STEADY_AT_ONCE
    most = int(records.MACHINE_AT_ONCE / each)
    assert [line.closed for line in lines[: most + 2]] == [False] * most + [True] * 2
    assert sum(len(line.came) for line in lines) <= len(whole) * (most + 1)
    assert not (await fed(whole, machine="203.0.113.8")).closed
    assert not any([(await fed(whole)).closed for _ in range(9)])  # this machine's own
    # who speaks and no more is not cut off by others at the same address
    assert not (await fed(record(DATA, 0) * 60, machine="203.0.113.7")).closed


async def test_lines_through_a_stated_proxy_do_not_count_together():
    app = SimpleNamespace(trusted_hosts={"203.0.113.9"})
    assert peer_of(("203.0.113.9", 4), app) == ""
    assert peer_of(("203.0.113.7", 4), app) == "203.0.113.7"
    config = SimpleNamespace(loaded_app=app)
    line, transport = Handshake(config=config), mock.Mock()
    transport.get_extra_info.return_value = ("203.0.113.9", 4)
    with mock.patch.object(prompt, "count_in", return_value=False) as counted:
        line.connection_made(transport)
    counted.assert_called_once_with("")


async def test_large_records_cost_nothing(monkeypatch):
    monkeypatch.setattr(records, "AT_ONCE", 1.0)
    assert not (await fed(record(DATA, records.LARGE) * 500)).closed


async def test_nobody_begins_a_second_handshake():
    first = record(HANDSHAKE, 300) + record(HANDSHAKE, 70) + record(CHANGE_CIPHER, 1)
    line = await fed(first + record(HANDSHAKE, 40) + record(DATA, 99))
    assert not line.closed
    line.counted.data_received(record(HANDSHAKE, 40))
    assert line.closed
    assert (await fed(record(HANDSHAKE, 4) * (records.MOST_HANDSHAKE + 1))).closed


async def test_a_hello_is_as_long_as_those_of_browsers_and_no_longer():
    """OpenSSL looks for each key in a hello through all of its groups."""
    half = record(HANDSHAKE, records.LONGEST_HANDSHAKE // 2)
    assert not (await fed(half * 2)).closed
    assert (await fed(half * 2 + record(HANDSHAKE, 1))).closed
    assert (await fed(record(HANDSHAKE, 16_384))).closed


@pytest.mark.parametrize("version", [ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_3])
async def test_a_server_ends_who_sends_crumbs_in_records(secured, monkeypatch, version):
    monkeypatch.setattr(records, "AT_ONCE", 300.0)
    port, trust = secured
    trust.minimum_version = trust.maximum_version = version
    reader, writer = await asyncio.open_connection("127.0.0.1", port, ssl=trust)
    for letter in REQUEST + b"\r\n":
        writer.write(bytes([letter]))  # a record each
    assert (await reader.readuntil(b"}")).startswith(b"HTTP/1.1 200")
    with contextlib.suppress(ConnectionError):
        for _ in range(100):
            for letter in REQUEST:
                writer.write(bytes([letter]))
            await writer.drain()
            await asyncio.sleep(0)
        assert await asyncio.wait_for(reader.read(), 5) == b""
    writer.transport.abort()
