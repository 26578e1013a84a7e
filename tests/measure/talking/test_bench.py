"""`ico3d bench chat`: its figures from made trials, and trials against real servers."""

import asyncio
import json
import os
import wave
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ico3d.bundle.format import Bundle
from ico3d.chat.settings.conversation import ChatSettings
from ico3d.chat.wire.protocol import Pause, Resume, Speech, Stop
from ico3d.cli import main
from ico3d.errors import CaptureError
from ico3d.measure.talking.bench import SCRIPT, TURNS, Results, figures, share, shares, talk
from ico3d.measure.talking.page import Player
from ico3d.measure.talking.questions import audible, broken_off, sayings
from ico3d.measure.talking.trials import Assent, Interruption, Question, sound_of
from support.chat.serving import serving
from support.shared import SPEECH

pytestmark = pytest.mark.slow


def question(arrival, turn=100.0):
    return Question(arrival + 50, arrival, {"turn": turn, "voice": arrival / 10})


def test_figures_are_medians_and_what_went_wrong():
    results = Results(
        questions=[question(400), None, question(500), question(600)],
        interruptions=[Interruption(150, 500, 0), Interruption(250, 600, 2)],
        assents=[Assent(True, 900, True), Assent(False, 0, False), Assent(True, 1000, False)],
        shares=[10.0, None, 30.0],
        undisturbed=[10.0],
    )
    found = figures(results)
    assert found["voice_to_voice_ms"] == {"p50": 550, "p95": pytest.approx(640)}
    assert found["server_share_ms"] == {"p50": 20, "p95": pytest.approx(29)}
    assert found["undisturbed_share_ms"] == {"p50": 10, "p95": 10}
    assert found["duck_ms"]["p50"] == 200 and found["stop_ms"]["p95"] == pytest.approx(595)
    assert found["assent_silence_ms"]["p50"] == 900
    assert found["parts"]["voice"]["p50"] == 50
    assert found["trials"] == {
        "questions": 4,
        "questions_answered_in_order": 3,
        "shares": 3,
        "shares_undisturbed": 1,
        "interruptions": 2,
        "messages_after_stop": 2,
        "assents": 3,
        "assents_resumed": 2,
        "assents_lossless": 1,
    }


def test_figures_of_trials_that_were_not_wanted_are_absent():
    found = figures(Results(shares=[12.0]))
    assert set(found) == {"server_share_ms", "parts", "trials"} and found["parts"] == {}


def test_the_share_is_what_nothing_else_accounts_for():
    services = 1000 * (SCRIPT.language + SCRIPT.voice)
    by_sound = 1000 * (TURNS.pause + SCRIPT.recognition) + services
    by_silence = 1000 * TURNS.end_silence + services
    assert share(question(by_sound + 33, turn=140)) == pytest.approx(33)
    assert share(question(by_silence + 21, turn=1830)) == pytest.approx(21)


class Log:
    """A page that got these speech messages."""

    def __init__(self, *pieces):
        self.pieces = pieces

    def messages(self, kind):
        return list(self.pieces)


def piece(first, values, utterance=0):
    rows = np.zeros((1, 39), np.float16)
    return Speech(utterance, 0, first, 0, np.array(values, np.int16), rows)


def test_a_piece_that_comes_twice_or_not_at_all_is_heard():
    whole = [piece(0, [1, 2]), piece(2, [3, 4]), piece(4, [5])]
    assert sound_of(Log(*whole, piece(0, [9], utterance=1)), 0).tolist() == [1, 2, 3, 4, 5]
    assert sound_of(Log(*whole, whole[1]), 0).tolist() != [1, 2, 3, 4, 5]
    assert sound_of(Log(whole[0], whole[2]), 0).tolist() != [1, 2, 3, 4, 5]


def test_a_page_that_pauses_goes_on_where_it_stood():
    player = Player()
    player.take(piece(0, [0] * 24000), now=10.0)
    player.take(Pause(0), now=10.55)
    assert player.position(11.0) == player.position(12.0) == pytest.approx(0.5)
    assert player.clock(12.0).position == pytest.approx(0.5)
    player.take(Resume(0), now=13.0)
    assert player.position(13.25) == pytest.approx(0.75)
    player.take(Stop(0), now=13.3)
    assert player.clock(13.4) is None


@pytest.fixture(scope="module")
def said():
    """What synthetic voices ask and object."""
    return sayings(None)


def test_speech_is_cut_where_it_is_audible(said):
    sound = np.full(3300, 30, np.int16)  # the room
    sound[650:1500] = 5000
    assert audible(sound).tolist() == sound[640:1600].tolist()  # whole moments of 20 ms
    assert len(said.questions) == 4 and len(said.objections) == 8 and len(said.assent) == 8
    assert all(s.dtype == np.int16 and s.any() for s in said.questions + said.assent)


def test_a_question_breaks_off_where_it_is_loudest():
    sound = np.full(24_000, 100, np.int16)
    sound[3200:3520] = 9000  # within the first half second
    sound[12_800:13_120] = -5000
    assert len(broken_off(sound)) == 13_120
    assert len(broken_off(sound[:12_700])) == 8_320  # all alike: the first


@pytest.mark.skipif(not SPEECH.is_dir(), reason="needs ../shared/speech")
def test_recordings_of_people_ask_and_interrupt():
    said = sayings(SPEECH)
    assert len(said.questions) == 3 and max(map(len, said.questions)) > 10 * 16000
    assert {len(sound) for sound in said.objections} == {2 * 16000}


def test_recordings_that_cannot_be_used_are_one_sentence(tmp_path):
    with pytest.raises(CaptureError, match="has no recordings"):
        sayings(tmp_path)
    for name, rate, samples in (("rate", 8000, 9), ("silent", 16000, 0)):
        path = tmp_path / f"{name}.wav"
        with wave.open(str(path), "wb") as file:
            file.setnchannels(1)
            file.setsampwidth(2)
            file.setframerate(rate)
            file.writeframes(np.full(800, samples, np.int16).tobytes())
        with pytest.raises(CaptureError, match=name):
            sayings(tmp_path)
        path.unlink()


@pytest.fixture(scope="module")
def demo():
    """The packaged avatar."""
    return Bundle.open(Path("demo"))


@pytest.mark.slow
def test_a_trial_with_real_servers(tmp_path):
    """One of the three talks that run by the real clock: the command, two server processes."""
    path = tmp_path / "chat.json"
    asked = ["--kinds", "questions", "share", "--turns", "1", "--json", str(path)]
    assert main(["bench", "chat", *asked]) == 0
    found = json.loads(path.read_text())
    slowness = max(1.0, os.getloadavg()[0])
    assert found["trials"]["questions_answered_in_order"] == found["trials"]["shares"] == 1
    assert 200 < found["voice_to_voice_ms"]["p50"] < 1300 * slowness
    assert -60 < found["server_share_ms"]["p50"] < 100 * slowness
    assert found["stolen_cores"] is None or found["stolen_cores"] >= 0


@pytest.mark.slow
async def test_trials_of_each_kind(demo, said):
    """All services are the real ones of the packaged avatar."""
    results = Results()
    kinds = ("questions", "interruptions", "assent")
    async with serving(demo, ChatSettings()) as (url, _):
        await talk(url, said, kinds, 1, results, lambda kind: None)
    found = figures(results)
    assert found["trials"]["questions_answered_in_order"] == 1
    assert found["trials"]["interruptions"] == 1 and found["trials"]["messages_after_stop"] == 0
    assert found["trials"]["assents"] == found["trials"]["assents_lossless"] == 1
    assert found["trials"]["assents_resumed"] == 1
    assert 200 < found["voice_to_voice_ms"]["p50"] < 1300
    assert 0 < found["duck_ms"]["p50"] <= found["stop_ms"]["p50"] < 800


async def test_a_server_adds_little_to_what_its_services_take(demo, said):
    def scripted(avatar):
        return replace(avatar, services=SCRIPT.services())

    results = Results()
    async with serving(demo, ChatSettings(turns=TURNS), adapt=scripted) as (url, _):
        began = asyncio.get_running_loop().time()
        await shares(url, said, 2, results, lambda kind: None)
        took = asyncio.get_running_loop().time() - began
    assert -60 < figures(results)["server_share_ms"]["p95"] < 60
    assert took < 20  # nobody waits for longer than until nothing is said
