"""What there is to choose from: told at the start, on the page, and heeded."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from websockets.asyncio.client import connect

from ico3d.chat.commands import described
from ico3d.chat.services import TABLES, choose
from ico3d.chat.services.offers import offers, wished
from ico3d.chat.services.provider import Provider
from ico3d.chat.services.voice import espeak
from ico3d.chat.serving import server
from ico3d.chat.serving.sessions import Sessions
from ico3d.chat.settings.conversation import ChatSettings, Choice
from ico3d.chat.wire.codec import decode_server, encode
from ico3d.chat.wire.protocol import VERSION, Hello, Offer, Welcome
from support.chat.serving import serving

TEXTS = Path(__file__).parents[3] / "viewer" / "src" / "words" / "texts.json"
MISSING = "its weights are not here: fetch them."
OFFLINE = ChatSettings(
    recognition=Choice("pocketsphinx"),
    language=Choice("persona-notes"),
    voice=Choice("espeak-ng", {"rate": 150}),
)


@pytest.fixture(autouse=True)
def voices(monkeypatch):
    """Three voices of which the best does not work."""
    spare = Provider("Spare", espeak.Settings, espeak.make)
    best = replace(spare, title="Best", hindrance=lambda options: MISSING)
    espeak_ng = TABLES["voice"]["espeak-ng"]
    table = {"best-one": best, "espeak-ng": espeak_ng, "spare": spare}
    monkeypatch.setattr("ico3d.chat.services.offers.TABLES", {**TABLES, "voice": table})


def voices_of(found):
    return [offer for offer in found if offer.kind == "voice"]


def test_all_services_are_listed_with_what_hinders_them():
    assert voices_of(offers(OFFLINE, {})) == [
        Offer("voice", "best-one", "Best", MISSING),
        Offer("voice", "espeak-ng", "espeak-ng", ""),
        Offer("voice", "spare", "Spare", ""),
    ]


def test_the_start_says_what_serves_and_what_would_be_better():
    lines = described(choose(OFFLINE).described(), voices_of(offers(OFFLINE, {})))
    assert lines == [
        "  listens with pocketsphinx",
        "  thinks with persona notes",
        "  speaks with espeak-ng",
        f"    better: Best; {MISSING}",
        "  (small offline stand-ins; choose others with --settings)",
        "  natural, in English, for about 265 MB more: ico3d demo --natural",
    ]


@pytest.mark.parametrize(
    ("wish", "title"), [("spare", "Spare"), ("best-one", "espeak-ng"), ("no-such", "espeak-ng")]
)
def test_wishes_are_heeded_where_they_work(wish, title):
    services = wished(choose(OFFLINE), OFFLINE, {}, {"voice": wish}, offers(OFFLINE, {}))
    assert services.voice.provider.title == title
    assert services.recognition.provider.title == "pocketsphinx"


def test_a_wish_for_what_the_settings_describe_keeps_their_options():
    spared = wished(choose(OFFLINE), OFFLINE, {}, {"voice": "spare"}, offers(OFFLINE, {}))
    again = wished(spared, OFFLINE, {}, {"voice": "espeak-ng"}, offers(OFFLINE, {}))
    assert again.voice.options.rate == 150 and spared.voice.options.rate == 165


def test_strangers_are_offered_nothing(bundle):
    avatar = server.open_avatar(bundle, OFFLINE)
    for host, count in (("0.0.0.0", 0), ("127.0.0.1", 3)):
        sessions = Sessions(avatar)
        server.make_app(bundle, avatar, host, sessions)
        assert len(voices_of(sessions.offers)) == count


async def test_a_page_gets_the_services_it_wishes(bundle):
    async with serving(bundle, OFFLINE) as (url, _):
        names = []
        for wishes in ({"voice": "spare"}, {"voice": "best-one", "nonsense": "x"}):
            async with connect(url.replace("http", "ws") + "ws") as socket:
                await socket.send(encode(Hello(VERSION, None, -1, wishes)))
                welcome = decode_server(await socket.recv())
            assert isinstance(welcome, Welcome) and len(voices_of(welcome.offers)) == 3
            names.append(welcome.services.voice.name)
        assert names == ["Spare", "espeak-ng"]


def test_services_without_a_name_of_their_own_have_words_on_the_page():
    words = json.loads(TEXTS.read_text(encoding="utf-8"))
    told = {text["en"] for key, text in words.items() if key.startswith("service.")}
    titles = {provider.title for table in TABLES.values() for provider in table.values()}
    names = {"Whisper", "pocketsphinx", "OpenVoice V2", "Kokoro", "Piper", "espeak-ng", "Hibari"}
    assert titles - names == told - {"{name} ({detail})"}
