"""The parts without a network: playback, pieces of speech, the page's memory, settings, timing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.chat.frames import SpeechFrame, Utterances
from ico3d.chat.page import MAX_WAITING, Outbox, Page
from ico3d.chat.performing.face import ROW, Face
from ico3d.chat.performing.sentence import LEAST, MOST, Sentence
from ico3d.chat.playback import Playback
from ico3d.chat.services import choose, chosen
from ico3d.chat.services.provider import Context, Provider
from ico3d.chat.services.recognition.sphinx import LOUDNESS, NOISE, Leveller
from ico3d.chat.settings.conversation import ChatSettings, Choice, Turns, read_settings
from ico3d.chat.wire.protocol import Answer, End, Speech, State, Stop, Transcript
from ico3d.errors import SettingsError
from ico3d.speech.runtime import SpeechModel
from support.chat.serving import OFFLINE


def test_playback_follows_the_pages_clock():
    playback = Playback()
    playback.begin(4)
    assert playback.wait_to_send(24_000, now=0.0) == -1.0  # 1 s of sound may go at once
    playback.sent(72_000, now=10.0)  # 3 s
    assert playback.position(11.0) == 1.0
    playback.clock(4, 0.2, now=11.0)  # it started late
    assert playback.position(11.5) == pytest.approx(0.7)
    playback.clock(3, 2.9, now=11.5)  # of another utterance
    assert playback.position(11.5) == pytest.approx(0.7)
    assert playback.wait_to_send(96_000, now=11.5) == pytest.approx(4 - 2 - 0.7)
    playback.clock(4, 99.0, now=12.0)  # it cannot have heard what was not sent
    assert playback.position(12.0) == 3.0 and playback.remaining(12.0) == 0.0


def test_playback_stands_still_while_the_page_is_away():
    playback = Playback()
    playback.begin(0)
    playback.sent(72_000, now=0.0)
    playback.hold(now=1.0)
    assert playback.position(50.0) == 1.0
    playback.release(now=60.0)
    assert playback.position(60.5) == 1.5


@settings(max_examples=25)
@given(st.lists(st.integers(1, 30_000), min_size=1, max_size=5), st.booleans())
def test_pieces_are_gapless_and_hold_100_to_200_ms(bundle, sizes, moving):
    info = bundle.manifest.head
    model = speech_model(bundle) if moving else None
    sentence = Sentence(Face(info, model, seed=0), first_row=7, start=0.0)
    rng = np.random.default_rng(sum(sizes))
    parts = [rng.integers(-9000, 9000, size).astype(np.int16) for size in sizes]
    pieces = [piece for part in parts for piece in sentence.push(part)] + sentence.finish()
    rows = 7
    for piece in pieces:
        assert piece.first_row == rows
        assert LEAST <= len(piece.expressions) <= MOST
        assert len(piece.pcm) == len(piece.expressions) * ROW
        rows += len(piece.expressions)
    sound = np.concatenate(parts)
    sent = np.concatenate([piece.pcm for piece in pieces])
    np.testing.assert_array_equal(sent[: len(sound)], sound)
    assert not sent[len(sound) :].any()  # padded with silence to whole rows
    assert len(sent) - len(sound) < max(ROW, LEAST * ROW)
    assert sentence.next_row == rows


_MODELS = {}


def speech_model(bundle):
    return _MODELS.setdefault(id(bundle), SpeechModel(bundle.read("speech.onnx")))


def test_rows_are_those_of_the_whole_sentence(bundle):
    model = speech_model(bundle)
    pcm = np.random.default_rng(1).integers(-9000, 9000, 40 * ROW).astype(np.int16)
    sentence = Sentence(Face(bundle.manifest.head, model, seed=0), 0, 0.0)
    pieces = sentence.push(pcm[:15_000]) + sentence.push(pcm[15_000:]) + sentence.finish()
    rows = np.concatenate([piece.expressions for piece in pieces])
    whole = model.expressions(pcm.astype(np.float32) / 32768, 24_000)
    np.testing.assert_allclose(rows[:, :32], whole[: len(rows)], atol=1e-5)


def test_without_a_speech_model_only_the_eyes_move(bundle):
    info = bundle.manifest.head
    rows = Face(info, None, seed=3).rows(np.zeros((500, 0)), np.zeros(0, np.int16), start=0.0)
    assert (rows[:, :32] == np.float32(info.idle_expression[:32])).all()
    assert rows[:, 37].max() == pytest.approx(1.0, abs=0.1)  # a blink


def piece(utterance, number):
    pcm, rows = np.zeros(2880, np.int16), np.full((3, 39), 1e9, np.float32)
    return SpeechFrame(utterance, number * 2880, number * 3, pcm, rows)


async def received(outbox):
    outbox.close()
    messages = []
    while (message := await outbox.get()) is not None:
        messages.append(message)
    return messages


async def test_a_page_gets_again_what_it_missed():
    page = Page()
    for number in range(3):
        page.send_speech(piece(0, number))
    page.send(Answer(0, 8640, "more"))
    page.send(Transcript("half", final=False))
    page.send_speech(piece(0, 3))
    page.send(End(0, 11520))
    outbox = Outbox()
    page.attach(outbox)
    page.replay(1)
    kinds = [type(message) for message in await received(outbox)]
    assert kinds == [Speech, Answer, Speech, End, State]
    assert np.isfinite(page._log[0].expressions.astype(np.float32)).all()


async def test_stop_takes_back_what_waits():
    page, outbox = Page(), Outbox()
    page.attach(outbox)
    page.send_speech(piece(0, 0))
    page.send(Stop(0))
    page.send_speech(piece(1, 0))
    messages = await received(outbox)
    assert [(type(m), m.utterance) for m in messages] == [(Stop, 0), (Speech, 1)]


async def test_a_page_that_does_not_read_is_given_up():
    outbox = Outbox()
    for _ in range(MAX_WAITING + 10):
        outbox.put(State("idle"))
    assert len(await received(outbox)) == MAX_WAITING


def test_utterances_count_up_and_stay_stopped():
    utterances = Utterances()
    assert [utterances.begin(), utterances.begin()] == [0, 1]
    utterances.stop_all()
    assert utterances.is_stopped(1) and not utterances.is_stopped(utterances.begin())


@pytest.mark.parametrize("level", [200, 3000, 12000])
def test_speech_is_levelled(level):
    rng = np.random.default_rng(0)
    speech = (rng.normal(0, level, 8000)).clip(-32768, 32767).astype(np.int16)
    leveller = Leveller()
    leveller.measure(np.concatenate([np.zeros(4000, np.int16), speech]).tobytes())
    levelled = np.frombuffer(leveller.apply(speech.tobytes()), np.int16).astype(float)
    assert levelled.std() == pytest.approx(LOUDNESS, rel=0.05)
    silence = np.frombuffer(Leveller().apply(bytes(16000)), np.int16).astype(float)
    assert silence.std() == pytest.approx(NOISE, rel=0.05)


def test_settings_come_from_toml_and_json(tmp_path):
    toml = tmp_path / "a.toml"
    toml.write_text(
        'voice = "espeak-ng"\n[turns]\nend_silence = 1\n[language]\nuse = "openai"\nmodel = "m"\n'
    )
    settings = read_settings(toml)
    assert settings.turns == Turns(end_silence=1.0)
    assert settings.language == Choice("openai", {"model": "m"})
    chosen = choose(settings)
    assert chosen.language.options.model == "m"
    assert chosen.described().language.stand_in is False
    json = tmp_path / "a.json"
    json.write_text('{"max_sessions": 2}')
    assert read_settings(json).max_sessions == 2
    assert read_settings(None) == ChatSettings()


@pytest.mark.parametrize(
    "text",
    [
        'voice = "nobody"',
        "voice = 3",
        '[voice]\nuse = "espeak-ng"\nrate = "fast"',
        '[voice]\nuse = "espeak-ng"\nspeed = 3',
        "[voice]\nrate = 3",
        "max_sessions = 0",
        "max_sessions = true",
        "[turns]\npause = 5",
        "turns = 5",
        "x = 1",
        "a = " + "[" * 20_000,
        "= =",
    ],
)
def test_wrong_settings_are_one_sentence(tmp_path, text):
    path = tmp_path / "a.toml"
    path.write_text(text)
    with pytest.raises(SettingsError) as error:
        choose(read_settings(path))
    assert "\n" not in str(error.value)


def provider(hindrance: str) -> Provider:
    return Provider("a provider", Turns, lambda *_: None, lambda options: hindrance)


def test_the_best_is_the_first_that_works():
    table = {"a": provider("its weights are missing."), "b": provider(""), "c": provider("")}
    assert chosen(table, Choice(), "voice").provider is table["b"]
    assert chosen(table, Choice("a"), "voice").provider is table["a"], "asked for is not asked"


def test_the_openai_service_is_pipecats_own():
    from pipecat.services.openai.llm import OpenAILLMService

    from ico3d.bundle.manifest import Persona

    persona = Persona("Ada", "Hello.", ("who are you => I am Ada.",))
    settings = ChatSettings(
        language=Choice("openai", {"url": "http://127.0.0.1:9/v1", "model": "tiny"})
    )
    made = choose(settings).language.make(Context(persona, None, None))
    assert isinstance(made, OpenAILLMService)


def test_the_personas_voice_speaks_unless_the_settings_name_one():
    voices = {"espeak-ng": "de+f2", "nobody": "x"}
    assert choose(OFFLINE, voices).voice.options.voice == "de+f2"
    named = ChatSettings(
        OFFLINE.recognition, OFFLINE.language, Choice("espeak-ng", {"voice": "fr"})
    )
    assert choose(named, voices).voice.options.voice == "fr"
    assert choose(OFFLINE, {"nobody": "x"}).voice.options == choose(OFFLINE).voice.options
