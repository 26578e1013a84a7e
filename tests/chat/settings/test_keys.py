"""A key goes to the server that it belongs to: real servers say what reached them."""

import asyncio
import contextlib
import ipaddress
from urllib.parse import urlsplit

import httpx
import numpy as np
import pytest
from fastapi import FastAPI, Request
from fastapi.responses import RedirectResponse, Response
from hypothesis import example, given
from hypothesis import strategies as st
from pipecat.frames.frames import LLMContextFrame
from pipecat.processors.aggregators.llm_context import LLMContext

from ico3d.bundle.persona import Persona
from ico3d.chat.remote.headless import run
from ico3d.chat.remote.recognition import heard
from ico3d.chat.services import chosen
from ico3d.chat.services.language import PROVIDERS as LANGUAGE
from ico3d.chat.services.provider import Context
from ico3d.chat.services.recognition import PROVIDERS as RECOGNITION
from ico3d.chat.services.voice import PROVIDERS as VOICE
from ico3d.chat.settings.conversation import Choice, Expression
from ico3d.errors import Ico3dError, SettingsError
from support.chat.scripted_server import running

TABLES = {"recognition": RECOGNITION, "language": LANGUAGE, "voice": VOICE}
KINDS = list(TABLES)
ADA = Context(Persona("Ada"), None, None)


def service(kind, url, **options):
    if kind == "language":
        options["model"] = "any"
    return chosen(TABLES[kind], Choice("openai", {"url": url, **options}), kind)


async def asked(kind, url, **options):
    """Lets a service ask its server for something, whatever comes of it."""
    made = await asyncio.to_thread(service(kind, url, **options).make, ADA)
    with contextlib.suppress(Ico3dError, TimeoutError):
        if kind == "recognition":
            frames = heard(np.zeros(4000, np.int16))
        elif kind == "language":
            frames = [LLMContextFrame(LLMContext([{"role": "user", "content": "hi"}]))]
        else:
            async for _ in made.run_tts("Hello.", "1"):
                pass
            return
        async for _ in run(made, frames, 20):
            pass


def recorder(requests, answer=lambda: Response(status_code=404)):
    app = FastAPI()

    @app.api_route("/{path:path}", methods=["GET", "POST"])
    async def anything(request: Request):
        requests.append(dict(request.headers))
        return answer()

    return app


@pytest.fixture(autouse=True)
def environment(monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", "openais")
    monkeypatch.setenv("OPENAI_ORG_ID", "org-1")
    monkeypatch.setenv("OPENAI_PROJECT_ID", "proj-1")
    monkeypatch.setenv("OPENAI_CUSTOM_HEADERS", "X-Secret: custom\nAuthorization: Bearer openais")
    monkeypatch.setenv("BOX_KEY", "boxes")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("variable", "sent"), [("", "none"), ("BOX_KEY", "boxes")])
async def test_a_server_gets_its_own_key_and_nothing_of_openais(kind, variable, sent):
    requests = []
    async with running(recorder(requests)) as port:
        await asked(kind, f"http://127.0.0.1:{port}/v1", key_variable=variable)
    assert requests
    for headers in requests:
        assert headers["authorization"] == f"Bearer {sent}"
        assert not {"openai-organization", "openai-project", "x-secret"} & set(headers)


@pytest.mark.parametrize("kind", KINDS)
async def test_neither_key_nor_words_follow_a_redirect(kind):
    here, elsewhere = [], []
    async with running(recorder(elsewhere)) as other:
        away = f"http://127.0.0.1:{other}/v1"
        app = recorder(here, lambda: RedirectResponse(away, 307))
        async with running(app) as port:
            await asked(kind, f"http://localhost:{port}/v1", key_variable="BOX_KEY")
    assert here and not elsewhere


@pytest.mark.parametrize("kind", KINDS)
async def test_this_machine_is_not_asked_through_a_proxy(kind, monkeypatch):
    requests, proxied = [], []
    async with running(recorder(requests)) as port, running(recorder(proxied)) as proxy:
        for name in ("http_proxy", "HTTP_PROXY", "all_proxy"):
            monkeypatch.setenv(name, f"http://127.0.0.1:{proxy}")
        await asked(kind, f"http://127.0.0.1:{port}/v1", key_variable="BOX_KEY")
    assert requests and not proxied


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "url",
    [
        "http://192.168.1.5:8000/v1",
        "http://localhost.evil.com/v1",
        "http://127.0.0.1.evil.com/v1",
        "http://[2001:db8::1]/v1",
        "http://api.openai.com/v1",
    ],
)
def test_a_named_key_is_not_sent_unencrypted_to_another_machine(kind, url):
    with pytest.raises(SettingsError, match=r"BOX_KEY would be sent unencrypted to .*: use https"):
        service(kind, url, key_variable="BOX_KEY")
    assert service(kind, url).options.url == url  # without a key it may be asked


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "url",
    [
        "http://user:secret@localhost/v1",
        "http://localhost@evil.com/v1",
        "http://evil.com\\@localhost/v1",
        "http://local\thost/v1",
        "ftp://localhost/v1",
        "localhost:8000",
        "http://",
    ],
)
def test_what_is_no_plain_address_is_refused(kind, url):
    with pytest.raises(SettingsError, match="url must be an address"):
        service(kind, url)


@pytest.mark.parametrize("kind", KINDS)
def test_a_key_that_is_not_here_is_missed_at_once(kind, monkeypatch):
    named = service(kind, "https://box.example/v1", key_variable="NO_KEY")
    assert "needs its key in the environment as NO_KEY" in named.provider.hindrance(named.options)
    with pytest.raises(SettingsError, match="needs its key in the environment as NO_KEY"):
        named.make(ADA)
    monkeypatch.delenv("OPENAI_API_KEY")
    with pytest.raises(SettingsError, match="needs its key in the environment as OPENAI_API_KEY"):
        service(kind, "").make(ADA)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("url", ["", "https://api.openai.com/v1", "https://eu.api.openai.com/v1/"])
def test_openais_key_goes_to_openai_whatever_the_sdk_is_told_elsewhere(kind, url, monkeypatch):
    monkeypatch.setenv("OPENAI_BASE_URL", "https://evil.com/v1")
    made = service(kind, url).make(ADA)
    assert made._client.api_key == "openais"
    assert made._client.base_url.host.endswith("api.openai.com")


def test_a_remote_face_keeps_the_same_rule():
    with pytest.raises(SettingsError, match="would be sent unencrypted to"):
        Expression("remote", "http://192.168.1.5:9004", "BOX_KEY")
    Expression("remote", "http://localhost:9004", "BOX_KEY")


HOSTS = st.one_of(
    st.sampled_from(["localhost", "127.0.0.1", "[::1]", "api.openai.com", "LOCALHOST", "0.0.0.0"]),
    st.ip_addresses(v=4).map(str),
    st.ip_addresses(v=6).map(lambda ip: f"[{ip}]"),
    st.from_regex(r"[a-z0-9.\-]{1,20}", fullmatch=True),
    st.text(max_size=12),
)
URLS = st.builds(
    lambda scheme, user, host, port, path: f"{scheme}://{user}{host}{port}{path}",
    st.sampled_from(["http", "https", "HTTP", "ws"]),
    st.sampled_from(["", "", "", "localhost@", "a:b@", "\\@", "localhost#@"]),
    HOSTS,
    st.sampled_from(["", ":80", ":443", ":99999", ":x"]),
    st.sampled_from(["", "/v1", "/@localhost", "?x=@localhost", "#@localhost", "\\v1"]),
)


@given(url=URLS, named=st.booleans())
@example("http://localhost#@evil.com/v1", True)
@example("http://[::ffff:127.0.0.1]/v1", True)
@example("https://api.openai.com.evil.com/v1", False)
@example("https://api.openai.com:8443/v1", False)
def test_whoever_reads_the_address_finds_a_host_that_may_have_the_key(url, named):
    from ico3d.chat.settings.keys import key_for

    try:
        key = key_for(url, "BOX_KEY" if named else "", "here")
    except SettingsError:
        return
    if not key:
        return
    assert key == ("boxes" if named else "openais")
    for scheme, host in hosts(url):
        if not named:
            assert scheme == "https"
            assert host == "api.openai.com" or host.endswith(".api.openai.com")
        elif scheme != "https":
            assert host == "localhost" or is_loopback(host)


def hosts(url):
    """As the libraries that connect read it."""
    with contextlib.suppress(httpx.InvalidURL):
        read = httpx.URL(url)
        yield read.scheme, read.host
    with contextlib.suppress(ValueError):
        parts = urlsplit(url)
        yield parts.scheme, parts.hostname


def is_loopback(host):
    ip = ipaddress.ip_address(host)
    return ip.is_loopback or bool(ip.version == 6 and ip.ipv4_mapped and ip.ipv4_mapped.is_loopback)
