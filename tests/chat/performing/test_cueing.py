"""Gestures of a body on a skeleton, from sound as it is made to the page's cues."""

from dataclasses import replace

import numpy as np
import pytest

from ico3d.chat.frames import SpeechFrame, UtteranceEndFrame
from ico3d.chat.page import Page
from ico3d.chat.performing.cueing import LEAD, SOONEST, Cueing
from ico3d.chat.wire.codec import decode_server, encode
from ico3d.chat.wire.protocol import SPEECH_RATE, Clock, Cues
from ico3d.motion.clip import Clip, Marks
from ico3d.motion.composing.composer import BEATS, Composer
from ico3d.motion.curves import Curve
from ico3d.rig.quaternions import from_rotvec

SENTENCES = ("Hello my dear friends.", "There are three gardens here.", "Nobody knows which one.")
WORD = 0.35
"""Seconds from word to word; each has its peak in the middle."""
PIECE = 0.16
"""Seconds of a piece of sound."""


def clip(name: str, *sides: str) -> Clip:
    keys = from_rotvec(np.array([[0.0, 0, 0], [1.0, 0, 0], [0, 0, 0]]))
    curve = Curve(np.array([0.0, 0.6, 1.5]), keys)
    roles = [f"{side}_wrist" for side in sides] or ["head"]
    return Clip(name, Marks(0.4, 0.6, 0.6, 0.9, 1.5), {role: curve for role in roles})


CLIPS = {name: clip(name, "right") for _, name, _ in BEATS} | {
    "wave": clip("wave", "right"),
    "count_three": clip("count_three", "right"),
    "open_hands": clip("open_hands", "left", "right"),
    "nod": clip("nod"),
}


class Recorder(Page):
    def __init__(self):
        super().__init__()
        self.sent = []

    def send(self, message):
        self.sent.append(message)


def spoken() -> list[SpeechFrame]:
    """Three sentences of utterance 0, piece by piece."""
    frames: list[SpeechFrame] = []
    for sentence in SENTENCES:
        count = len(sentence.split())
        times = np.arange(round(count * WORD * SPEECH_RATE)) / SPEECH_RATE
        loud = np.abs(np.sin(np.pi * times / WORD)) ** 2
        pcm = np.int16(16000 * loud * np.sin(2 * np.pi * 200 * times))
        step = round(PIECE * SPEECH_RATE)
        for at in range(0, len(pcm), step):
            first = frames[-1].first_sample + len(frames[-1].pcm) if frames else 0
            text = sentence if at == 0 else None
            rows = np.zeros((1, 39), np.float32)
            frames.append(SpeechFrame(0, first, 0, pcm[at : at + step], rows, text))
    return frames


SECONDS = sum(len(frame.pcm) for frame in spoken()) / SPEECH_RATE


def heard(cueing: Cueing, page: Recorder, until: float = 99.0, ahead: float = 2.5) -> list[tuple]:
    """Plays the speech, which is made so far ahead; messages with the position of their sending."""
    frames, position, found = spoken(), 0.0, []
    while position < min(SECONDS, until):
        while frames and frames[0].first_sample / SPEECH_RATE < position + ahead:
            cueing.read(frames.pop(0))
            if not frames:
                cueing.read(UtteranceEndFrame(0, round(SECONDS * SPEECH_RATE)))
        cueing.clock(Clock(0, position, 0.0), position)
        found += [(position, message) for message in page.sent]
        page.sent.clear()
        position += 0.2
    return found


def test_cues_come_before_they_begin_on_peaks_and_all_are_released():
    page = Recorder()
    found = heard(Cueing(CLIPS, page, True, 3), page)
    cues = [(at, cue) for at, message in found for cue in message.cues]
    releases = {r.number: (at, r.time) for at, message in found for r in message.releases}
    assert len(cues) >= 3 and "count_three" in {cue.name for _, cue in cues}
    assert [cue.number for _, cue in cues] == list(range(len(cues))) and len(releases) == len(cues)
    for at, cue in cues:
        assert cue.begin >= max(at, SOONEST) and cue.begin < cue.stroke
        away = (cue.stroke / WORD - 0.5) % 1
        assert min(away, 1 - away) * WORD < 0.04
        sent, time = releases[cue.number]
        assert time >= cue.stroke and time >= sent
    assert all(decode_server(encode(message)) == message for _, message in found)
    assert all(isinstance(message, Cues) and message.utterance == 0 for _, message in found)


def test_the_same_seed_says_the_same_and_another_something_else():
    pages = [Recorder() for _ in range(8)]
    said = [heard(Cueing(CLIPS, page, True, i // 2), page) for i, page in enumerate(pages)]
    assert said[0] == said[1]
    assert any(other != said[0] for other in said[2:])


def test_what_is_asked_for_is_made_in_what_is_heard_or_in_what_follows():
    page = Recorder()
    cueing = Cueing(CLIPS, page, True, 3)
    cueing.request("wave")
    found = heard(cueing, page, until=1.0)
    assert found[0][1].cues[0].name == "wave"
    assert found[0][1].cues[0].begin == SOONEST
    cueing.forget()
    cueing.clock(Clock(0, 1.2, 0.0), 1.2)
    assert page.sent == []  # the utterance is over
    for number in (1, 2):
        for frame in spoken():
            frame.utterance = number
            cueing.read(frame)
    cueing.request("nod")
    cueing.forget()
    cueing.clock(Clock(1, 0.1, 0.0), 0.1)
    assert "nod" not in [cue.name for message in page.sent for cue in message.cues]
    cueing.request("nod")
    cueing.clock(Clock(1, 0.3, 0.0), 0.3)
    made = [cue for message in page.sent for cue in message.cues if cue.name == "nod"]
    assert len(made) == 1 and made[0].begin < 0.3 + LEAD


def test_who_asks_for_a_gesture_gets_it_with_the_answer():
    page = Recorder()
    cueing = Cueing(CLIPS, page, True, 3)
    cueing.asked("What is a wave?")
    cueing.asked("Can you wave at me?")
    assert heard(cueing, page, until=0.5)[0][1].cues[0].name == "wave"
    page, without = Recorder(), {name: one for name, one in CLIPS.items() if name != "wave"}
    cueing = Cueing(without, page, True, 3)
    cueing.asked("Can you wave at me?")
    assert "wave" not in [cue.name for _, message in heard(cueing, page) for cue in message.cues]


def test_a_body_that_is_to_stand_makes_no_gestures():
    page = Recorder()
    cueing = Cueing(CLIPS, page, False, 3)
    assert cueing.names == [] and heard(cueing, page) == []
    assert set(Cueing(CLIPS, page, True, 3).names) == set(CLIPS)


def test_a_speech_that_nothing_is_known_of_is_left_alone():
    page = Recorder()
    Cueing(CLIPS, page, True, 3).clock(Clock(7, 1.0, 0.0), 1.0)
    assert page.sent == []
    with pytest.raises(KeyError):
        cueing = Cueing(CLIPS, page, True, 3)
        heard(cueing, page, until=0.3)
        cueing.request("somersault")


def test_a_page_that_reports_nothing_has_few_utterances_remembered():
    cueing = Cueing(CLIPS, Recorder(), True, 3)
    for number in range(9):
        for frame in spoken():
            cueing.read(replace(frame, utterance=number))
    assert list(cueing._scripts) == [5, 6, 7, 8]


def test_reports_in_a_flood_are_looked_at_ten_times_a_second(monkeypatch):
    looked, directions = [], Composer.directions
    counted = lambda self, until: looked.append(until) or directions(self, until)  # noqa: E731
    monkeypatch.setattr(Composer, "directions", counted)
    cueing = Cueing(CLIPS, Recorder(), True, 1)
    for frame in spoken():
        cueing.read(frame)
    for position in np.arange(0, 2, 0.002):
        cueing.clock(Clock(0, float(position), 0.0), float(position))
    assert 18 <= len(looked) <= 21
    cueing.read(UtteranceEndFrame(0, round(SECONDS * SPEECH_RATE)))
    cueing.clock(Clock(0, 2.0, 0.0), 2.0)
    assert len(looked) <= 22  # the end changes what is to be done
