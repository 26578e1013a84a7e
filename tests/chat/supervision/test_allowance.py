"""What a visitor may take of a server: questions, time, long answers, new conversations."""

import asyncio
import math
from dataclasses import replace

import pytest

from ico3d.chat.bucket import Bucket
from ico3d.chat.services import choose
from ico3d.chat.serving.sessions import STARTS_AT_ONCE, HastyError
from ico3d.chat.settings.conversation import ChatSettings, Choice, Turns
from ico3d.chat.settings.visits import Visits
from ico3d.chat.supervision.allowance import Allowance
from ico3d.chat.wire.protocol import (
    VERSION,
    Answer,
    Clock,
    Error,
    Heard,
    Hello,
    Interrupt,
    Say,
    Talk,
    Text,
    Transcript,
)
from ico3d.chat.wire.sentences import HASTY, LONG
from ico3d.errors import SettingsError
from ico3d.measure.talking.scripted import Script
from support.chat.guests import Guest, open_sessions
from support.chat.virtual_time import run

pytestmark = pytest.mark.slow

QUICK = Script(0.0, 0.0, 0.0, seconds=0.5)
TURNS = Turns(speculate=False)
BROWSER = choose(ChatSettings(recognition=Choice("browser", {"fallback": ""}))).recognition


def limited(**limits):
    return ChatSettings(turns=TURNS, limits=Visits(**limits))


def test_the_scarcest_bucket_decides():
    many, few = Bucket(0.0, 9.0, lambda: 0.0), Bucket(0.0, 1.0, lambda: 0.0)
    allowance = Allowance(many, few)
    assert allowance.may_ask()
    allowance.spend()
    assert not allowance.may_ask() and many.has(8)
    assert Allowance().may_ask()


def test_a_visitor_is_not_heard_until_his_questions_have_come_back(bundle, question):
    async def talk():
        services = QUICK.services()
        async with open_sessions(bundle, services, limited(questions_per_minute=2)) as sessions:
            guest = await Guest.enter(sessions)
            await asyncio.sleep(2)
            counts, told = [], []
            for wait in (0, 0, 0, 31):
                await asyncio.sleep(wait)
                before = len(guest.got(Answer))
                await guest.session.conversation.handle(Text("who are you?"))
                await asyncio.sleep(3)
                counts.append(len(guest.got(Answer)) - before)
                told.append([error.code for _, error in guest.got(Error)])
            answered = len(guest.got(Answer))
            await guest.say(question)  # nothing is left
            unheard = len(guest.got(Answer)) - answered
            await guest.leave()
            return counts, told, unheard

    counts, told, unheard = run(talk())
    assert counts == [1, 1, 0, 1]
    assert told == [[], [], [HASTY.code], [HASTY.code]]
    assert unheard == 0


def test_a_turn_that_is_not_heard_to_its_end_ends(bundle, question, given_up):
    """The question that uses up the last of it comes while the visitor speaks."""

    async def talk():
        services = QUICK.services()
        async with open_sessions(bundle, services, limited(questions_per_minute=1)) as sessions:
            guest = await Guest.enter(sessions)
            await asyncio.sleep(2)
            speaking = asyncio.create_task(guest.say(question))
            await asyncio.sleep(0.5)
            guest.session.conversation._allowance.spend()
            await speaking
            await asyncio.sleep(5)
            state = guest.session.page.state
            await guest.leave()
            return state

    assert run(talk()) == "idle" and not given_up


def test_who_begins_anew_does_not_get_more(bundle):
    async def ask(sessions):
        """Answers to three questions in a session, which the visitor leaves for good."""
        hello = Hello(VERSION, None, -1)
        ticket = sessions.line_up(hello, "203.0.113.7")
        guest = await Guest.enter(sessions, hello, ticket)
        await asyncio.sleep(1)  # a question at once would take the greeting's place
        for _ in range(3):
            await guest.session.conversation.handle(Text("who are you?"))
            await asyncio.sleep(2)
        answers = len(guest.got(Answer)) - 1  # the greeting
        await guest.leave(for_good=True)
        return answers

    async def talk():
        settings = replace(limited(questions_per_minute=2), max_sessions=4)  # two of an address
        async with open_sessions(bundle, QUICK.services(), settings) as sessions:
            answers = [await ask(sessions) for _ in range(3)]
            hasty = 0
            for _ in range(20):
                try:
                    sessions.line.leave(sessions.line_up(Hello(VERSION, None, -1), "203.0.113.7"))
                except HastyError:
                    hasty += 1
            sessions.line.leave(sessions.line_up(Hello(VERSION, None, -1), "203.0.113.8"))
            return answers, hasty

    answers, hasty = run(talk())
    assert answers == [2, 2, 1]  # four of two sessions at once, and one came back
    assert hasty == 20 - 2 * STARTS_AT_ONCE  # the three of the sessions came back meanwhile


def test_a_session_ends_when_it_has_lasted_long_enough(bundle):
    async def stay():
        now = asyncio.get_running_loop().time
        settings = limited(session_minutes=2)
        async with open_sessions(bundle, QUICK.services(), settings) as sessions:
            guest = await Guest.enter(sessions)
            began = now()
            while len(sessions) and now() < began + 300:
                await asyncio.sleep(10)
                await guest.session.conversation.handle(Text("who are you?"))
            lasted = now() - began
            await asyncio.sleep(1)
            _, error = guest.got(Error)[-1]
            await guest.leave()
            return lasted, error

    lasted, error = run(stay())
    assert lasted == pytest.approx(120, abs=10.1)
    assert error == LONG.error(fatal=True, again=True, minutes=2)


@pytest.mark.parametrize("sign", [Interrupt(None), Interrupt(0), Clock(0, 0.1, None)])
def test_signs_without_a_meaning_hold_no_place(bundle, sign):
    async def stay():
        now = asyncio.get_running_loop().time
        settings = ChatSettings(idle_minutes=1)
        async with open_sessions(bundle, QUICK.services(), settings) as sessions:
            guest = await Guest.enter(sessions)
            began = now()
            while len(sessions) and now() < began + 300:
                await asyncio.sleep(10)
                await guest.session.conversation.handle(sign)
            await guest.leave()
            return now() - began

    assert run(stay()) < 80


def test_an_answer_without_end_is_cut_off(bundle):
    words = "This never ends, and so it goes on. " * 100
    script = replace(QUICK, answer=words)

    async def talk():
        settings = limited(answer_letters=200)
        async with open_sessions(bundle, script.services(), settings) as sessions:
            guest = await Guest.enter(sessions)
            await asyncio.sleep(3)
            answers = []
            for _ in range(2):
                before = len(guest.got(Answer))
                await guest.session.conversation.handle(Text("who are you?"))
                await asyncio.sleep(20)
                answers.append(" ".join(m.text for _, m in guest.got(Answer)[before:]))
            await guest.leave()
            return answers

    for answer in run(talk()):
        assert 180 < len(answer) <= 201 and answer.endswith("…")
        assert words.startswith(answer.rstrip("…").rstrip())


def test_texts_that_a_site_has_said_count(bundle):
    async def talk():
        settings = limited(questions_per_minute=2)
        settings = replace(settings, embedding=replace(settings.embedding, say=True))
        async with open_sessions(bundle, QUICK.services(), settings) as sessions:
            guest = await Guest.enter(sessions)
            await asyncio.sleep(2)
            for _ in range(4):
                await guest.session.conversation.handle(Say("Good day."))
                await asyncio.sleep(2)
            said = [m.text for _, m in guest.got(Answer)]
            await guest.leave()
            return said

    assert run(talk()).count("Good day.") == 2


@pytest.mark.parametrize(
    "limits",
    [
        {"session_minutes": -1},
        {"session_minutes": math.inf},
        {"questions_per_minute": 0},
        {"questions_per_minute": math.nan},
        {"answer_letters": 10},
        {"sessions_per_address": -1},
    ],
)
def test_limits_with_which_nobody_could_talk_are_one_sentence(limits):
    with pytest.raises(SettingsError, match=f"\\[limits\\] {next(iter(limits))} must be"):
        Visits(**limits)


def test_an_address_has_half_of_the_places_unless_told():
    assert [Visits().share(most) for most in (1, 2, 4, 5)] == [1, 1, 2, 3]
    assert Visits(sessions_per_address=30).share(40) == 30


async def dictate(guest, first, *texts):
    """Holds the button while the browser hears something."""
    conversation = guest.session.conversation
    await conversation.handle(Talk(True))
    for number, text in enumerate(texts, first):
        await asyncio.sleep(0.1)
        await conversation.handle(Heard(number, text, True))
    await conversation.handle(Talk(False))


def test_dictated_questions_count_like_typed_ones(bundle):
    async def talk():
        services = replace(QUICK.services(), recognition=BROWSER)
        async with open_sessions(bundle, services, limited(questions_per_minute=2)) as sessions:
            guest = await Guest.enter(sessions)
            await asyncio.sleep(2)
            counts = []
            for number, wait in enumerate((0, 0, 0, 31)):
                await asyncio.sleep(wait)
                before = len(guest.got(Answer))
                await dictate(guest, 3 * number, "who", "are", "you?")
                await asyncio.sleep(4)
                counts.append(len(guest.got(Answer)) - before)
            told = [error.code for _, error in guest.got(Error)]
            await guest.leave()
            return counts, told

    assert run(talk()) == ([1, 1, 0, 1], [HASTY.code])


def test_a_question_that_has_begun_is_heard_to_its_end(bundle):
    """Somebody else at the same address asks while the button is held."""

    async def talk():
        services = replace(QUICK.services(), recognition=BROWSER)
        async with open_sessions(bundle, services, limited(questions_per_minute=1)) as sessions:
            guest = await Guest.enter(sessions)
            await asyncio.sleep(2)
            conversation = guest.session.conversation
            await conversation.handle(Talk(True))
            for number, text in enumerate(("who", "are", "you?")):
                await asyncio.sleep(0.1)
                await conversation.handle(Heard(number, text, True))
                conversation._allowance._buckets[0].drain(1)
            await conversation.handle(Talk(False))
            await asyncio.sleep(3)
            await dictate(guest, 3, "and", "why?")
            await asyncio.sleep(3)
            words = [m.text for _, m in guest.got(Transcript) if m.final]
            await guest.leave()
            return words

    assert run(talk())[-1] == "who are you?"
