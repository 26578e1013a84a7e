"""A wrong address: browsers get a page in plain words, programs JSON."""

import re
from urllib.parse import urljoin

import httpx
import pytest

from ico3d.chat.serving.missing import WORDS
from ico3d.chat.serving.server import make_app

BROWSER = "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8"


@pytest.fixture
def get(bundle):
    """Asks a served avatar for a path."""
    transport = httpx.ASGITransport(app=make_app(bundle, None, "127.0.0.1"))

    async def get(path, accept=BROWSER, language=""):
        headers = {"Host": "127.0.0.1:8765", "Accept": accept, "Accept-Language": language}
        async with httpx.AsyncClient(transport=transport, base_url="http://server") as client:
            return await client.get(path, headers=headers)

    return get


@pytest.mark.parametrize("path", ["/nowhere", "/a/b/c", "/x/", "/" + "a/" * 9])
async def test_a_browser_reads_it_in_plain_words_and_finds_the_start(get, path):
    answer = await get(path)
    assert answer.status_code == 404
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert "There is nothing here" in answer.text and "detail" not in answer.text
    link = re.search(r'<a href="([^"]+)"', answer.text)[1]
    assert urljoin(f"http://server/folder{path}", link) == "http://server/folder/"


async def test_its_headers_protect_as_those_of_other_pages(get):
    own = {"date", "content-length", "content-type", "vary", "cache-control", "etag"}
    missing, health = [dict((await get(path)).headers) for path in ("/nowhere", "/health")]
    names = health.keys() - own
    assert "content-security-policy" in names
    assert {name: missing[name] for name in names} == {name: health[name] for name in names}
    assert "Accept" in missing["vary"]  # none of the two forms is kept for the other


@pytest.mark.parametrize("accept", ["*/*", "application/json", "", "text/plain", "text/htmlx"])
async def test_a_program_gets_json(get, accept):
    answer = await get("/nowhere", accept)
    assert (answer.status_code, answer.json()) == (404, {"detail": "Not Found"})


@pytest.mark.parametrize(
    ("accepted", "language"),
    [
        ("de-AT,de;q=0.9,en;q=0.8", "de"),
        ("FR", "fr"),
        ("pt, es;q=0.5", "es"),
        ("zh-Hant-TW", "zh"),
        ("ja;q=0.9", "ja"),
        ("pt-BR", "en"),
        (";;q=,,-", "en"),
        ("", "en"),
    ],
)
async def test_it_speaks_the_visitors_language(get, accepted, language):
    answer = await get("/nowhere", language=accepted)
    assert f'<html lang="{language}">' in answer.text
    assert all(words in answer.text for words in WORDS[language])


async def test_nothing_of_the_address_is_in_the_page(get):
    assert "script" not in (await get("/<script>alert(1)</script>")).text
