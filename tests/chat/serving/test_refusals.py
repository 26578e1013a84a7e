"""Whoever runs a server hears which sites were refused; strangers cannot fill the log."""

import httpx
import pytest
from loguru import logger

from ico3d.chat.serving.refusals import MOST
from ico3d.chat.serving.server import make_app


@pytest.fixture
def lines():
    told: list[str] = []
    sink = logger.add(told.append, level="WARNING", format="{message}")
    yield told
    logger.remove(sink)


@pytest.fixture
def ask(bundle):
    """Asks a served avatar for what sites embed, as their pages' browsers do."""
    transport = httpx.ASGITransport(app=make_app(bundle, None, "127.0.0.1"))

    async def ask(origin, path="embed.js", host="127.0.0.1:8765"):
        async with httpx.AsyncClient(transport=transport, base_url="http://server") as client:
            answer = await client.get(f"/{path}", headers={"Origin": origin, "Host": host})
            return answer.status_code

    return ask


async def test_a_refused_site_is_told_once_with_what_allows_it(ask, lines):
    assert [await ask("https://site.example") for _ in range(3)] == [403] * 3
    assert await ask("https://site.example", "bundle/manifest.json") == 403
    assert ["--allow-origin https://site.example" in line for line in lines] == [True]


async def test_a_page_that_was_opened_as_a_file_is_told_so(ask, lines):
    assert await ask("null") == 403
    assert len(lines) == 1 and "opened as a file" in lines[0]


async def test_nobody_fills_the_log(ask, lines):
    assert await ask("https://site.example`; rm -rf /") == 403  # no browser sends this
    assert await ask("https://site.example", "health") == 403  # what no site embeds
    assert (
        await ask("https://site.example", host="evil.example") == 403
    )  # a name that was pointed here
    assert lines == []
    for site in range(2 * MOST):
        await ask(f"https://site{site}.example")
    assert len(lines) == MOST and "not told of" in lines[-1]
