"""Who begins TLS handshakes and ends none holds few connections, and not for long."""

import asyncio
import contextlib
import ssl

import pytest

from ico3d.chat.serving import crowd
from ico3d.chat.serving.network import prompt
from support.chat.serving import visiting
from support.chat.waiting import until


async def is_closed(reader, seconds):
    with contextlib.suppress(ConnectionResetError):
        return await asyncio.wait_for(reader.read(), seconds) is not None
    return True


async def health(port, trust):
    async with visiting(verify=trust) as client:
        return (await client.get(f"https://127.0.0.1:{port}/health")).status_code


async def test_handshakes_count_as_connections_of_their_machine(secured, monkeypatch):
    port, trust = secured
    monkeypatch.setattr(prompt, "MOST_OPEN", 3)
    monkeypatch.setattr(crowd, "machine_of", lambda client: client and "10.0.0.7")
    lines = [await asyncio.open_connection("127.0.0.1", port) for _ in range(5)]
    assert await is_closed(lines[3][0], 5) and await is_closed(lines[4][0], 5)
    for _, writer in lines[:2]:
        writer.close()
    await until(lambda: prompt._open["10.0.0.7"] == 1)
    assert await health(port, trust) == 200  # in a place that has become free
    lines[2][1].close()
    await until(lambda: prompt._open["10.0.0.7"] == 0)


async def test_a_connection_with_tls_arrives_once(secured, monkeypatch):
    port, trust = secured
    monkeypatch.setattr(prompt, "_arrivals", crowd.Meters(0.0, 2.0, lambda: 0.0))
    monkeypatch.setattr(crowd, "machine_of", lambda client: client and "10.0.0.7")
    assert [await health(port, trust) for _ in range(2)] == [200, 200]
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    assert await is_closed(reader, 5)
    writer.close()


@pytest.mark.parametrize("sent", [b"", b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc"])
async def test_a_handshake_that_does_not_end_is_given_up(secured, monkeypatch, sent):
    monkeypatch.setattr(prompt, "HEAD", 1.0)
    reader, writer = await asyncio.open_connection("127.0.0.1", secured[0])
    writer.write(sent)
    assert await is_closed(reader, 5)
    writer.close()


async def test_what_is_no_handshake_is_closed_and_others_are_served(secured):
    port, trust = secured
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(b"GET /health HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
    assert await is_closed(reader, 5)
    writer.close()
    assert await asyncio.gather(*(health(port, trust) for _ in range(30))) == [200] * 30


@pytest.mark.parametrize("version", [ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_3])
async def test_clients_as_they_are_come_in_and_those_with_costly_keys_alone_do_not(
    secured, version
):
    """OpenSSL's own choice of groups has some that take 91 ms of the loop for a hello."""
    port, trust = secured
    trust.minimum_version = trust.maximum_version = version
    _, writer = await asyncio.open_connection("127.0.0.1", port, ssl=trust)
    writer.close()
    trust.set_ecdh_curve("secp384r1")
    if version == ssl.TLSVersion.TLSv1_2:
        trust.set_ciphers("ECDHE+AESGCM")
    with pytest.raises((ssl.SSLError, ConnectionError)):
        await asyncio.open_connection("127.0.0.1", port, ssl=trust)
