"""How an answer is cut while it is being written."""

import asyncio
import time

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pipecat.frames.frames import (
    AggregatedTextFrame,
    ErrorFrame,
    LLMFullResponseEndFrame,
    LLMFullResponseStartFrame,
    LLMTextFrame,
    TTSTextFrame,
)
from pipecat.pipeline.pipeline import Pipeline
from pipecat.tests.utils import run_test
from pipecat.utils.text.simple_text_aggregator import SimpleTextAggregator

from ico3d.bundle.persona import Persona
from ico3d.chat.services.provider import Context
from ico3d.chat.services.voice import espeak
from ico3d.chat.services.voice.clauses import (
    MOST_LETTERS,
    MOST_STOPS,
    TURN,
    ClauseProcessor,
    Clauses,
    sentences_of,
)
from ico3d.chat.services.voice.markup import speakable
from ico3d.common.espeak.speech import synthesize


async def cut(*deltas, aggregator=None):
    """The pieces, each with the number of deltas that had arrived when it was complete."""
    aggregator = aggregator or Clauses()
    pieces = []
    for number, delta in enumerate(deltas, 1):
        pieces += [(piece.text, number) async for piece in aggregator.aggregate(delta)]
    rest = await aggregator.flush()
    return pieces + ([(rest.text, len(deltas))] if rest else [])


@pytest.mark.parametrize(
    "marked",
    [
        "Well, of course,| it is, as you say, nice.| And so on, and on.",
        "Yes.| I think so, too, as it happens.",
        "I met Dr. Smith,| who is 3.5 m tall.| He came at 5 p.m. today.",
        "Take fruit,| e.g. apples or 1,000 pears.| Or not.",
        "J. R. R. Tolkien wrote it.| He did.",
        "See https://a.b/c,d?e=f;g for more.",
        "It opens at 10:30 and closes at 18:00.",
        "Das sind 3,5 Meter,| glaube ich.",
        "Here is the list:|\n1. Bread is good.|\n2. Milk.",
        "**Note this:**| it works.",
        "She was here—|or so they said—yesterday.",
        "He left –| at last – for good.",
        "Between 10 - 12 people came.",
        "So it is;| so be it; yes.",
        "Hello! 😀👍🏽| How are you?| Bye! 👋",
        '"Come, all of you,"| she said.| He came.',
        "one two three four five six seven eight nine ten eleven twelve| thirteen.",
        "你好，我是小明，|很高兴见到你，真的。|我们去公园吧！",
        "我叫「小明」，|对吗？|好。",
        "こんにちは、|元気ですか。|はい！",
        "مرحبا بك،| أنا هنا، معك.| كيف حالك؟| بخير.",
        "नमस्ते दोस्त,| मैं यहाँ हूँ।| आप कैसे हैं?",
        "สวัสดีครับ| ผมชื่อสมชาย ยินดีที่ได้รู้จัก",
        "안녕하세요, 여러분,| 반갑습니다.| 좋아요!",
    ],
)
async def test_an_answer_is_cut_at_its_marks(marked):
    pieces = await cut(*marked.replace("|", ""))
    assert [piece for piece, _ in pieces] == [piece.strip() for piece in marked.split("|")]


async def test_abbreviations_are_those_of_the_language():
    text = "Ich mag Obst, Gemüse usw. Das ist gut."
    cut_in = {code: await cut(text, aggregator=Clauses(code)) for code in ("en", "de")}
    assert [piece for piece, _ in cut_in["en"]][1:] == ["Gemüse usw.", "Das ist gut."]
    assert [piece for piece, _ in cut_in["de"]][1:] == ["Gemüse usw. Das ist gut."]


ODD = st.sampled_from(list(".,;:!?…—–-*_#`|()[]\"'«» \n\t123aBé你。，、สم،हि।😀❤\ufe0f\u200d"))


@given(st.one_of(st.text(), st.lists(ODD).map("".join)), st.integers(1, 7))
@example("a b,\u2003c", 1)
async def test_nothing_is_lost_and_the_deltas_make_no_difference(text, size):
    pieces = [piece for piece, _ in await cut(text)]
    assert "".join("".join(pieces).split()) == "".join(text.split())
    assert all(piece == piece.strip() != "" for piece in pieces)
    deltas = [text[at : at + size] for at in range(0, len(text), size)]
    assert [piece for piece, _ in await cut(*deltas)] == pieces


ANSWERS = [
    "That is a good question, and the answer depends on the weather of the day.",
    "In the year 1969, two people walked on the moon for the first time in history.",
    "I would say that you should take the second street on the left and then ask again there.",
]


async def test_the_first_clause_comes_before_half_of_the_sentence():
    """In tokens of the model, whatever its speed."""
    for answer in ANSWERS:
        tokens = [word + " " for word in (answer + " That is all.").split()]
        (_, early), *_ = await cut(*tokens)
        (_, late), *_ = await cut(*tokens, aggregator=SimpleTextAggregator())
        assert early <= max(5, 13 * late / 18) and late >= 15


async def texts(*frames):
    down, _ = await run_test(ClauseProcessor(), frames_to_send=frames, start_timeout=60)
    return [f.text for f in down if isinstance(f, AggregatedTextFrame)]


async def test_every_answer_has_a_first_clause():
    answer = LLMFullResponseStartFrame(), LLMTextFrame("Now, I see, it is"), LLMTextFrame(" so. I")
    assert await texts(*answer, LLMFullResponseEndFrame(), *answer) == [
        *("Now, I see,", "it is so.", "I"),
        *("Now, I see,", "it is so.", "I"),
    ]


async def test_what_was_interrupted_is_forgotten():
    clauses = Clauses()
    assert [p.text async for p in clauses.aggregate("Now then, I")] == ["Now then,"]
    await clauses.handle_interruption()
    assert [p.text async for p in clauses.aggregate("So then, you")] == ["So then,"]
    assert (await clauses.flush()).text == "you"


ANSWER = (
    "Grüß dich, **lieber Gast**! 😀 你好，世界。 مرحبا بك. Es sind 3,5 km bis 10:30 Uhr.\n"
    "- `print(2*3)`\n```python\nx = 1\n```\nन॒मस्ते। Bis bald! 👋"
)


async def test_captions_show_what_was_written_and_the_voice_says_its_words():
    voice = espeak.make(espeak.Settings("de"), Context(Persona("Ann"), None, None))
    voice.add_text_transformer(speakable)
    requests = []

    async def requested(_, __, text):
        requests.append(text.strip())

    voice.add_event_handler("on_tts_request", requested)
    answer = LLMFullResponseStartFrame(), LLMTextFrame(ANSWER), LLMFullResponseEndFrame()
    down, up = await run_test(
        Pipeline([ClauseProcessor(), voice]), frames_to_send=answer, start_timeout=60
    )
    assert not [frame for frame in up if isinstance(frame, ErrorFrame)]
    pieces = [f for f in down if isinstance(f, AggregatedTextFrame) and f.will_be_spoken]
    captions = "".join(f.text for f in pieces if not isinstance(f, TTSTextFrame))
    fences = ANSWER.replace("```python", "").replace("```", "")
    assert "".join(captions.split()) == "".join(fences.split())
    assert requests == [
        *("Grüß dich,", "lieber Gast!", "你好，世界。", "مرحبا بك."),
        *("Es sind 3,5 km bis 10:30 Uhr.", "print(2*3)", "x = 1", "न॒मस्ते।", "Bis bald!"),
    ]


def test_the_voice_itself_reads_numbers():
    symbols = "".join(event.symbol for event in synthesize("3.5", "en-us").events)
    assert symbols == "θɹˈiːpɔɪntfˈaɪv"


@pytest.mark.parametrize("space", "\xa0\u2028\u3000\x85")
async def test_a_text_at_which_the_rules_panic_is_said_all_the_same(space):
    text = f"Ask X{space}. {space}He knows. Then ask me again"
    clauses = Clauses("de")
    pieces = [piece.text async for piece in clauses.aggregate(text)]
    rest = await clauses.flush()
    assert rest is not None
    assert "".join("".join([*pieces, rest.text]).split()) == "".join(text.split())


@pytest.mark.parametrize("text", ["m", "XA", "あא", "a'", "(a", "🙂", "word ", "1. "])
async def test_no_piece_is_longer_than_people_write(text):
    answer = text * (4000 // len(text))
    begun = time.process_time()
    pieces = [piece for piece, _ in await cut(answer)]
    assert time.process_time() - begun < 1.0  # 1.5 s on an idle machine before
    assert max(map(len, pieces)) <= MOST_LETTERS + 1
    assert "".join("".join(pieces).split()) == "".join(answer.split())
    assert all(piece.endswith("word") for piece in pieces[1:-1]) or text != "word "


@pytest.mark.parametrize("blank", [" ", "_", "- ", "、", "，", ", ", "\u0e31 ", "、」"])
async def test_an_answer_of_blanks_holds_nobody_up(blank):
    clauses, answer = Clauses(), (blank * 4000)[:4000]
    begun = time.process_time()
    async for _ in clauses.aggregate(answer):
        pass
    assert time.process_time() - begun < 5  # it took minutes, in the loop of all visitors


async def test_a_whole_text_is_cut_at_sentences_alone():
    said = "Well then, you see, I am here. It is 3.5 km to Mr. Smith's, no more!\nBye"
    assert await sentences_of(said) == [
        "Well then, you see, I am here.",
        "It is 3.5 km to Mr. Smith's, no more!",
        "Bye",
    ]
    assert await sentences_of(" \n ") == []


async def test_initials_without_end_leave_others_their_turns():
    """Eight pages that had such said kept others waiting for five seconds."""
    turns = 0

    async def others():
        nonlocal turns
        while True:
            await asyncio.sleep(0)
            turns += 1

    waiting = asyncio.create_task(others())
    pieces = await sentences_of("A." * 2048)
    waiting.cancel()
    assert "".join(pieces) == "A." * 2048 and max(map(len, pieces)) <= 2 * (MOST_STOPS + 1)
    assert turns >= 4096 // TURN - 1 and len(pieces) > 7
