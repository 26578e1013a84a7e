"""Other sites' pages: who may load what, with which tokens, and that nobody else may."""

import re
from dataclasses import replace
from urllib.parse import quote

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from starlette.responses import PlainTextResponse

from ico3d.chat.serving import tokens
from ico3d.chat.serving.guard import Guard
from ico3d.chat.serving.sites import Sites, open_sites, own_key, shown_key
from ico3d.chat.settings.embedding import Embedding
from ico3d.chat.wire.protocol import Answer, End, Error, Say
from ico3d.cli import main
from ico3d.errors import SettingsError
from ico3d.measure.talking.page import open_page
from support.chat.serving import TYPED, serving, visiting

KEY = "a key that is long enough"
SITE, OTHER = "https://site.example", "https://other.example"
NOW = 1_000_000.0
ORIGINS = st.sampled_from([SITE, OTHER, ""])


def sites(key="", now=NOW):
    return Sites(Embedding((SITE,), token_minutes=10), key, lambda: now)


async def status(given_sites, path, origin=None, token=None, host="127.0.0.1:8765"):
    """The answer of a guarded server that has everything."""
    app = Guard(PlainTextResponse("here"), "127.0.0.1", given_sites)
    headers = {"Host": host} | ({"Origin": origin} if origin else {})
    transport = httpx.ASGITransport(app=app)
    async with httpx.AsyncClient(transport=transport, base_url="http://server") as client:
        params = {"token": token} if token is not None else None
        return await client.get(path, headers=headers, params=params)


@given(ORIGINS, st.integers(0, 2**40), st.floats(0, 2**40))
def test_a_token_admits_its_site_until_it_expires(origin, expires, now):
    token = tokens.sign(KEY, origin, expires)
    assert tokens.is_valid(token, KEY, origin, now) is (now < expires)
    assert quote(token, safe="") == token  # goes into an address as it is


@given(ORIGINS, ORIGINS, st.integers(1, 2**40), st.data())
def test_no_other_token_does(origin, other, expires, data):
    token = tokens.sign(KEY, origin, expires)
    assert not tokens.is_valid(token, KEY + "!", origin, 0)
    assert tokens.is_valid(token, KEY, other, 0) is (origin == other)
    at = data.draw(st.integers(0, len(token) - 1))
    letter = data.draw(st.characters().filter(lambda c: c != token[at]))
    assert not tokens.is_valid(token[:at] + letter + token[at + 1 :], KEY, origin, 0)


@given(st.text(max_size=60))
def test_no_text_is_a_token_by_chance(text):
    assert not tokens.is_valid(text, KEY, "", 0)


@pytest.mark.parametrize("path", ["/embed.js", "/assets/x.js", "/bundle/manifest.json", "/ws"])
async def test_a_listed_site_may_load_what_it_embeds(path):
    answer = await status(sites(), path, SITE)
    assert answer.status_code == 200
    assert answer.headers["access-control-allow-origin"] == SITE
    assert answer.headers["cross-origin-resource-policy"] == "cross-origin"
    assert "Origin" in answer.headers["vary"]
    own = await status(sites(), path)
    assert own.status_code == 200 and "access-control-allow-origin" not in own.headers
    assert own.headers["cross-origin-resource-policy"] == "same-origin"
    assert "Origin" in own.headers["vary"]  # a cache keeps them apart
    policy = answer.headers["content-security-policy"]
    assert policy.endswith(f"frame-ancestors {SITE}")


@pytest.mark.parametrize(
    ("path", "origin", "host"),
    [
        ("/embed.js", OTHER, None),
        ("/embed.js", SITE + ".evil.example", None),
        ("/embed.js", "http://site.example", None),
        ("/embed.js", "null", None),
        ("/embed.js", SITE, "evil.example:8765"),  # a name that was pointed here
        ("/embed.jsx", SITE, None),
        ("/metrics", SITE, None),
        ("/health", SITE, None),
        ("/token", SITE, None),
        ("/", SITE, None),
    ],
)
async def test_everybody_and_everything_else_is_refused(path, origin, host):
    answer = await status(sites(), path, origin, host=host or "127.0.0.1:8765")
    assert answer.status_code == 403
    assert "access-control-allow-origin" not in answer.headers


async def test_without_sites_nothing_is_shared():
    answer = await status(Sites(), "/embed.js")
    assert "vary" not in answer.headers
    assert answer.headers["content-security-policy"].endswith("frame-ancestors 'none'")
    assert (await status(Sites(), "/embed.js", SITE)).status_code == 403


@pytest.mark.parametrize(
    ("path", "origin", "signed_for", "age", "code"),
    [
        ("/bundle/manifest.json", SITE, SITE, 0, 200),
        ("/bundle/manifest.json", SITE, SITE, 601, 401),
        ("/bundle/manifest.json", SITE, "", 0, 401),
        ("/bundle/manifest.json", None, "", 0, 200),
        ("/bundle/manifest.json", None, SITE, 0, 401),
        ("/bundle/manifest.json", None, None, 0, 401),
        ("/ws", "http://127.0.0.1:8765", "", 0, 200),
        ("/ws", "http://127.0.0.1:8765", None, 0, 401),
        ("/ws", OTHER, SITE, 0, 403),
        ("/embed.js", SITE, None, 0, 200),  # it is no secret
    ],
)
async def test_with_a_key_only_tokens_admit(path, origin, signed_for, age, code):
    keyed = sites(KEY)
    token = None if signed_for is None else keyed.token(signed_for)[0]
    answer = await status(sites(KEY, NOW + age), path, origin, token)
    assert answer.status_code == code
    if code == 401:  # the site's script may read why
        assert answer.headers.get("access-control-allow-origin") == (
            origin if origin == SITE else None
        )


@pytest.mark.parametrize("origin", ["https://example.org", "http://localhost:3000"])
def test_origins_are_as_browsers_write_them(origin):
    assert Embedding(origins=(origin,)).origins == (origin,)


@pytest.mark.parametrize(
    "origin",
    [
        *("*", "", "null", "example.org", "https://example.org/", "https://Example.org"),
        *("https://example.org:443", "http://a.b:80", "https://*.b.c", "https://a.b; sandbox"),
        *("ftp://a.b", "https://a.b\n", "https://u@a.b", "http://[::1]:80000", "http://a.b:0"),
    ],
)
def test_what_is_no_origin_is_one_sentence(origin):
    with pytest.raises(SettingsError, match="is no site"):
        Embedding(origins=(origin,))


def test_keys_and_times_are_checked(monkeypatch):
    settings = Embedding((SITE,), key_variable="EMBED_KEY")
    monkeypatch.setenv("EMBED_KEY", "short")
    with pytest.raises(SettingsError, match="16 characters"):
        open_sites(settings)
    monkeypatch.setenv("EMBED_KEY", KEY)
    opened = open_sites(settings)
    assert opened.is_key(KEY) and not opened.is_key(KEY[:-1]) and not Sites().is_key("")
    with pytest.raises(SettingsError, match="not among"):
        opened.token(OTHER)
    with pytest.raises(SettingsError, match="no tokens"):
        Sites(settings).token("")
    for minutes in (0, 1441):
        with pytest.raises(SettingsError, match="token_minutes"):
            replace(settings, token_minutes=minutes)


def test_the_command_prints_a_token(tmp_path, monkeypatch, capsys):
    file = tmp_path / "chat.toml"
    file.write_text('[embedding]\nkey_variable = "EMBED_KEY"\n')
    monkeypatch.setenv("EMBED_KEY", KEY)
    assert main(["token", str(file), "--origin", SITE, "--allow-origin", SITE]) == 0
    token = capsys.readouterr().out.strip()
    assert tokens.is_valid(token, KEY, SITE, 0)
    assert main(["token", str(file), "--origin", SITE]) != 0


async def test_a_sites_backend_gets_tokens_for_the_key(bundle):
    keyed = Sites(Embedding((SITE,)), KEY)
    bearer, manifest = {"Authorization": f"Bearer {KEY}"}, "bundle/manifest.json"
    async with (
        serving(bundle, TYPED, sites=keyed) as (url, sessions),
        visiting() as client,
    ):
        assert not sessions.at_home  # strangers may come
        assert (await client.post(f"{url}token")).status_code == 401
        given = await client.post(f"{url}token", params={"origin": SITE}, headers=bearer)
        refused = await client.post(f"{url}token", params={"origin": OTHER}, headers=bearer)
        assert refused.status_code == 400 and OTHER in refused.json()["error"]
        asked = {"token": given.json()["token"]}
        found = await client.get(url + manifest, params=asked, headers={"Origin": SITE})
        assert found.status_code == 200
        assert (await client.get(url + manifest)).status_code == 401


async def test_texts_are_said_where_the_settings_allow_it(bundle):
    allowing = replace(TYPED, embedding=Embedding(say=True))
    async with serving(bundle, allowing) as (url, _):
        page, _ = await open_page(url, microphone=False)
        await page.wait(End)  # of the greeting
        await page.send(Say("The train is late."))
        _, answer = await page.wait(Answer, where=lambda message: message.utterance == 1)
        assert answer.text == "The train is late."
        await page.close()


async def test_texts_are_not_said_elsewhere(typed):
    url, _ = typed
    page, _ = await open_page(url, microphone=False)
    await page.send(Say("The train is late."))
    _, error = await page.wait(Error)
    assert not error.fatal and "settings do not allow" in error.message
    await page.close()


async def test_keys_are_not_guessed(bundle):
    machine, other = ({"X-Forwarded-For": f"203.0.113.{number}"} for number in (7, 8))
    right = {"Authorization": f"Bearer {KEY}"}
    proxied = serving(bundle, TYPED, sites=Sites(key=KEY), proxies=["127.0.0.1"])
    async with proxied as (url, _), visiting() as client:

        async def status(*headers):
            sent = {name: value for part in headers for name, value in part.items()}
            return (await client.post(f"{url}token", headers=sent)).status_code

        assert [await status(machine) for _ in range(11)] == 10 * [401] + [429]
        assert await status(machine, right) == 429  # or guessing would go on
        assert await status(other) == 401 and await status(other, right) == 200


async def test_nobody_says_where_he_comes_from_but_a_proxy_that_was_named(bundle):
    async with (
        serving(bundle, TYPED, sites=Sites(key=KEY), proxies=["203.0.113.0/24"]) as (url, _),
        visiting(headers={"X-Forwarded-For": "198.51.100.7"}) as client,
    ):
        asked = [await client.post(f"{url}token") for _ in range(12)]
    assert {answer.status_code for answer in asked} == {401}  # this machine's, uncounted


def test_own_keys_are_long_and_can_be_read_aloud():
    keys = {own_key() for _ in range(100)}
    assert len(keys) == 100
    assert all(re.fullmatch(r"[a-z2-7]{4}(-[a-z2-7]{4}){3}", key) for key in keys)


@pytest.mark.parametrize(
    ("is_public", "is_open", "variable", "shown"),
    [
        (False, False, "", None),
        (False, True, "", None),
        (True, True, "", None),
        (False, False, "KEY", ""),
        (True, False, "KEY", ""),
    ],
)
def test_a_key_is_shown_where_the_operator_has_none(is_public, is_open, variable, shown):
    assert shown_key(is_public, is_open, Embedding(key_variable=variable)) == shown
    made = shown_key(True, False, Embedding())
    assert made is not None and len(made) == 19 and open_sites(Embedding(), made).is_key(made)


def test_everybody_and_only_those_with_a_key_is_a_contradiction():
    with pytest.raises(SettingsError, match="leave out one of them"):
        shown_key(True, True, Embedding(key_variable="KEY"))
