"""Servers that put each byte into a record of TLS of its own are read as others are."""

import asyncio
import ssl
from datetime import UTC, datetime

import httpx2
import pytest
from aiohttp.resolver import DefaultResolver
from httpcore2._backends.anyio import AnyIOStream

from ico3d.chat.services import client
from ico3d.chat.services.tls import client_context
from ico3d.chat.serving.network.certificates import own_certificate
from ico3d.chat.tools.bounded_http import BoundedTransport
from ico3d.chat.tools.http import BoundedConnector

BODY = b'{"object": "list", "data": []}'
HEAD = (
    b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: %d\r\n" % len(BODY)
    + b"X-Long: "
    + b"a" * 20_000
    + b"\r\n\r\n"
)


@pytest.fixture
def certificate(tmp_path, monkeypatch):
    made = own_certificate(tmp_path, ["127.0.0.1"], datetime.now(UTC))
    monkeypatch.setenv("SSL_CERT_FILE", str(made.file))
    return made


@pytest.fixture
async def crumbs(certificate):
    """Address of a server whose answer comes in records of one byte."""
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(certificate.file, certificate.key)

    async def answer(reader, writer):
        await reader.readuntil(b"\r\n\r\n")
        for byte in HEAD + BODY:
            writer.write(bytes([byte]))
        await writer.drain()
        writer.close()

    async with await asyncio.start_server(answer, "127.0.0.1", 0, ssl=context) as server:
        yield f"https://127.0.0.1:{server.sockets[0].getsockname()[1]}"


@pytest.fixture
def reads(monkeypatch):
    """Counts reads of the network."""
    counted, read = [], AnyIOStream.read

    async def counting(self, *args, **options):
        piece = await read(self, *args, **options)
        counted.append(len(piece))
        return piece

    monkeypatch.setattr(AnyIOStream, "read", counting)
    return counted


async def test_records_of_one_byte_are_read_together(crumbs, reads):
    async with httpx2.AsyncClient(verify=client_context()) as http:
        assert (await http.get(crumbs)).content == BODY
    assert sum(reads) >= len(HEAD + BODY) and len(reads) < 300


async def test_clients_of_services_and_of_mcp_servers_do_so(crumbs, reads, monkeypatch):
    monkeypatch.setenv("A_KEY", "secret-of-sixteen-letters")
    # Of this machine's own servers no certificate is trusted that the environment names.
    monkeypatch.setattr(client, "client_context", lambda _: client_context())
    own = client.client_options(crumbs + "/v1", "A_KEY", "language")["http_client"]
    async with own, httpx2.AsyncClient(transport=BoundedTransport(5.0)) as mcp:
        for http in (own, mcp):
            reads.clear()
            assert (await http.get(crumbs)).content == BODY
            assert 0 < len(reads) < 300


def pair(certificate):
    """A client's and a server's end, joined by nothing but their buffers."""
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(certificate.file, certificate.key)
    there, back = ssl.MemoryBIO(), ssl.MemoryBIO()
    client = client_context().wrap_bio(back, there, server_hostname="127.0.0.1")
    server = context.wrap_bio(there, back, server_side=True)
    for _ in range(4):
        for end in (client, server):
            try:
                end.do_handshake()
            except ssl.SSLWantReadError:
                continue
    return client, server


def test_what_came_before_an_end_is_handed_over_first(certificate):
    near, server = pair(certificate)
    for byte in b"abcdef":
        server.write(bytes([byte]))
    assert near.read(4) == b"abcd" and near.read(99) == b"ef"
    with pytest.raises(ssl.SSLWantReadError):
        near.read(99)
    server.write(b"g")
    with pytest.raises(ssl.SSLWantReadError):  # it waits for the other end's goodbye
        server.unwrap()
    assert near.read(99) == b"g"
    assert near.read(99) == b""


def test_what_is_read_into_a_buffer_is_as_ever(certificate):
    near, server = pair(certificate)
    server.write(b"abc")
    room = bytearray(8)
    assert near.read(8, room) == 3 and room[:3] == b"abc"


def test_no_server_names_the_numbers_of_an_exchange():
    """A prime of 10,000 bits kept a client, and with it everybody, for 0.6 s."""
    session = aiohttp_context()
    for context in (client_context(), session):
        names = [cipher["name"] for cipher in context.get_ciphers()]
        assert names and all(name.startswith(("TLS_", "ECDHE-")) for name in names)
        assert context.verify_mode == ssl.CERT_REQUIRED and context.check_hostname


def test_certificates_are_read_once(monkeypatch, certificate):
    """A question may call 32 functions, and reading certificates held everybody up."""
    first = aiohttp_context(), client_context()
    assert aiohttp_context() is first[0] and client_context() is first[1]
    assert client_context(trust_env=False) is not first[1]
    monkeypatch.delenv("SSL_CERT_FILE")
    assert aiohttp_context() is not first[0] and client_context() is not first[1]


def aiohttp_context() -> ssl.SSLContext:
    """What calls of tools are made with."""

    async def made():
        connector = BoundedConnector(DefaultResolver())
        context = connector._ssl
        await connector.close()
        return context

    return asyncio.run(made())
