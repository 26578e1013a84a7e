"""An avatar's own voice: heard where OpenVoice is installed, and why not where it is not."""

from types import SimpleNamespace

import httpx
import numpy as np
import pytest
from fastapi import FastAPI, Request

pytest.importorskip("torch")
soundfile = pytest.importorskip("soundfile")

from ico3d.bundle.format import Bundle, give_voice  # noqa: E402
from ico3d.bundle.people.provenance import OPENVOICE, ClonedVoice  # noqa: E402
from ico3d.bundle.people.voice import SIZE, VOICE  # noqa: E402
from ico3d.bundle.persona import Persona  # noqa: E402
from ico3d.chat.doctor.machine import of_avatar  # noqa: E402
from ico3d.chat.services import choose  # noqa: E402
from ico3d.chat.services.offers import named, offers  # noqa: E402
from ico3d.chat.services.own_voice import Own, own_of, unheard  # noqa: E402
from ico3d.chat.services.voice import openvoice  # noqa: E402
from ico3d.chat.serving import server  # noqa: E402
from ico3d.chat.serving.bundle_files import BundleFiles  # noqa: E402
from ico3d.chat.serving.server import open_avatar  # noqa: E402
from ico3d.chat.settings.conversation import ChatSettings, Choice  # noqa: E402
from ico3d.cli import main  # noqa: E402

LEVEL = 0.125
TONE = np.full(SIZE, LEVEL, np.float32)
OFFLINE = {"recognition": Choice("pocketsphinx"), "language": Choice("persona-notes")}
BEST, ESPEAK = (ChatSettings(**OFFLINE, voice=Choice(use)) for use in ("best", "espeak-ng"))


@pytest.fixture(scope="module")
def voiced_path(bundle_path, tmp_path_factory):
    """A bundle with a cloned voice."""
    path = tmp_path_factory.mktemp("voiced") / "ada.ico3d"
    give_voice(bundle_path, ClonedVoice(OPENVOICE, "ada.mp4", "agreed"), TONE, path)
    return path


@pytest.fixture(scope="module")
def voiced(voiced_path):
    return Bundle.open(voiced_path)


def own(*languages):
    return Own(TONE.tobytes(), languages)


async def test_it_speaks_with_the_voice_of_the_bundle(installed, fake, say, voiced):
    avatar = open_avatar(voiced, BEST)
    assert avatar.services.described().voice.name == "OpenVoice V2 (own voice)"
    pcm, errors = await say(avatar.services.voice.make(None), "Hello there.")
    assert not errors and len(pcm)
    # half as loud for half the tone colour: the base speaker's is 0.5, and its sound 0.5 loud
    assert np.abs(pcm).max() == pytest.approx(LEVEL * 32767, rel=0.02)
    [converter] = fake.ToneColorConverter.made
    assert converter.extracted == 0 and converter.messages[-1] == "default"  # with the watermark
    assert unheard(BEST.voice, {}, avatar.own_voice) == ""


def test_a_bundle_without_one_speaks_as_before(installed, bundle):
    avatar = open_avatar(bundle, BEST)
    assert avatar.own_voice is None and type(avatar.services.voice.options) is openvoice.Settings
    assert unheard(BEST.voice, {}, None) == "" and own_of(bundle, Persona("Ada")) is None


@pytest.mark.parametrize(
    ("languages", "speaker"),
    [((), "EN-US"), (("en",), "EN-US"), (("es-MX", "en"), "ES"), (("zh",), "ZH"), (("ja",), "JP")],
)
def test_the_base_speaker_speaks_the_personas_language(installed, languages, speaker):
    assert choose(BEST, {}, own(*languages)).voice.options.voice == speaker


def test_settings_and_persona_name_the_base_speaker(installed):
    chosen = ChatSettings(
        **OFFLINE, voice=Choice("openvoice", {"voice": "FR", "watermark": False, "speed": 1.5})
    )
    options = choose(chosen, {"openvoice": "EN-BR"}, own("es")).voice.options
    assert (options.voice, options.watermark, options.speed) == ("FR", False, 1.5)
    assert options.tone == TONE.tobytes()
    assert choose(BEST, {"openvoice": "EN-BR"}, own("de")).voice.options.voice == "EN-BR"


def test_where_it_cannot_be_heard_something_else_speaks_and_it_is_said(installed):
    german = choose(BEST, {}, own("de")).voice
    assert not isinstance(german.options, openvoice.OwnVoice)
    said = "OpenVoice does not speak 'de', the persona's language."
    assert unheard(BEST.voice, {}, own("de")) == said
    assert unheard(ESPEAK.voice, {}, own()) == "the settings choose another voice."
    assert choose(ESPEAK, {}, own()).voice.provider.title == "espeak-ng"
    other = Choice("openvoice", {"reference": "else.wav"})
    assert unheard(other, {}, own()) == "the settings choose another voice."
    (installed / "OpenVoiceV2/converter/checkpoint.pth").unlink()
    assert unheard(BEST.voice, {}, own()).startswith("the weights 'openvoice' are not here")
    assert type(choose(BEST, {}, own()).voice.options) is openvoice.Settings


def test_without_openvoice_there_is_one_sentence(models):
    if openvoice.importlib.util.find_spec("melo") is not None:
        pytest.skip("MeloTTS is installed")
    assert unheard(BEST.voice, {}, own()).startswith("melo is not installed: the commands are in")
    assert choose(BEST, {}, own()).voice.provider.title != "OpenVoice V2"
    assert openvoice.cloning_hindrance().startswith("openvoice is not installed: the commands are")


def test_the_start_and_the_doctor_say_why_it_is_not_heard(
    voiced_path, bundle_path, tmp_path, monkeypatch, capsys
):
    def make_server(*_):
        return SimpleNamespace(run=lambda sockets: [listener.close() for listener in sockets])

    monkeypatch.setattr(server, "make_server", make_server)
    file = tmp_path / "chat.toml"
    file.write_text('recognition = "browser"\nlanguage = "persona-notes"\nvoice = "espeak-ng"\n')
    lost = "the avatar has a voice of its own, which is not heard"
    for path, told in ((voiced_path, True), (bundle_path, False)):
        assert main(["serve", str(path), "--port", "0", "--settings", str(file)]) == 0
        said = f"\n  {lost}: the settings choose another voice.\n"
        assert (said in capsys.readouterr().out) == told
        found = [one for one in of_avatar(path, file) if one.what == lost]
        assert [(one.grade, one.mend) for one in found] == (
            [("weak", "the settings choose another voice.")] * told
        )


def test_visitors_are_offered_it(installed):
    [offer] = [one for one in offers(ESPEAK, {}, own()) if one.key == "openvoice"]
    assert (offer.name, offer.hindrance) == ("OpenVoice V2 (own voice)", "")
    service = named(ESPEAK, {}, "voice", "openvoice", own())
    assert isinstance(service.options, openvoice.OwnVoice)
    assert named(ESPEAK, {}, "voice", "espeak-ng", own()).provider.title == "espeak-ng"


def test_a_tone_colour_is_taken_from_a_recording(installed, fake, tmp_path):
    path = tmp_path / "me.wav"
    soundfile.write(path, np.zeros(1000), 22050)
    tone = openvoice.tone_colour(path)
    assert (tone.shape, tone.dtype) == ((SIZE,), np.float32)
    [converter] = fake.ToneColorConverter.made
    assert tone[0] == float(converter.extract_se([str(path)])[0, 0, 0])
    assert fake.HELD in converter.loaded


async def test_no_page_gets_the_file(voiced):
    app, files = FastAPI(), BundleFiles(voiced, None)

    @app.get("/{name:path}")
    async def answer(name: str, request: Request):
        return files.answer(name, request)

    async with httpx.AsyncClient(
        transport=httpx.ASGITransport(app), base_url="http://page"
    ) as page:
        assert (await page.get(f"/{VOICE}")).status_code == 404
        assert (await page.get("/thumbnail.png")).status_code == 200
        stated = (await page.get("/manifest.json")).json()["provenance"]["voice"]
    assert stated["recording"] == "ada.mp4"
