"""A server with HTTPS, and the socket by which visitors check their way to it."""

import ssl
from datetime import UTC, datetime

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from ico3d.chat.serving.network.certificates import own_certificate
from support.chat.serving import serving, visiting


async def test_page_and_socket_come_by_https(body, tmp_path):
    certificate = own_certificate(tmp_path, ["127.0.0.1"], datetime.now(UTC))
    trust = ssl.create_default_context(cafile=certificate.file)
    async with serving(body, certificate=certificate) as (url, _):
        assert url.startswith("https://127.0.0.1:")
        async with visiting(verify=trust) as client:
            assert (await client.get(f"{url}health")).json() == {"ok": True}
        socket = connect(url.replace("https", "wss") + "echo", ssl=trust)
        async with socket as wire:
            await wire.send("12.5")
            assert await wire.recv() == "12.5"


@pytest.mark.parametrize("sent", ["x" * 65, b"bytes"])
async def test_the_echo_is_for_short_texts(body, sent):
    async with serving(body) as (url, _), connect(url.replace("http", "ws") + "echo") as wire:
        await wire.send(sent)
        with pytest.raises(ConnectionClosed):
            await wire.recv()


async def test_the_echo_has_an_end(body):
    async with serving(body) as (url, _), connect(url.replace("http", "ws") + "echo") as wire:
        for number in range(32):
            await wire.send(str(number))
            assert await wire.recv() == str(number)
        with pytest.raises(ConnectionClosed):
            await wire.recv()
