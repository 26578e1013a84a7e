"""The persona's notes: other words and misheard ones find the answer, foreign ones do not."""

import time
from dataclasses import replace

import pytest

from ico3d.bundle.manifest import Persona
from ico3d.bundle.persona import check_persona
from ico3d.chat.services.language.index import Index
from ico3d.chat.services.language.instruction import SPOKEN, instruction
from ico3d.chat.services.language.notes import Notes, parse_note, plain, stem
from ico3d.chat.services.language.persona import sentences

PERSONA = Persona(
    "Ada",
    "Hello.",
    (
        "what is your name | who are you => I am Ada.",
        "how do you work | what are you made of => I am made of Gaussians.",
        "what can you do | how can you help me => I can answer questions.",
        "who made you | who built you => Engineers did.",
        "wie heißt du => Ich heiße Ada.",
        "a note without an answer",
    ),
)


@pytest.fixture
def notes():
    return Notes(PERSONA)


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("What is your name?", "I am Ada."),
        ("what's your name", "I am Ada."),
        ("tell me your name please", "I am Ada."),
        ("so who are you then", "I am Ada."),
        ("your named", "I am Ada."),
        ("HOW DO YOU WORK", "I am made of Gaussians."),
        ("how are you working", "I am made of Gaussians."),
        ("what can you do for me", "I can answer questions."),
        ("who has made you", "Engineers did."),
        ("Wie heisst du?", "Ich heiße Ada."),
    ],
)
def test_the_best_note_answers(notes, question, answer):
    assert notes.answer(question) == answer


@pytest.mark.parametrize(
    "question",
    ["we must find a new home in the stars", "how high is the Eiffel tower", "", "?!", "你好吗"],
)
def test_what_no_note_knows_is_admitted_with_examples(notes, question):
    answer = notes.answer(question)
    assert answer.startswith("I do not know that.") and "what is your name" in answer


@pytest.mark.parametrize(
    "said",
    [
        *("What is my name?", "My name is Tom and I like tea.", "Do you know my name?"),
        *("who am I", "what am I made of", "What's my name again?", "who made me"),
    ],
)
def test_what_is_said_of_the_visitor_is_not_answered_with_what_is_known_of_the_avatar(notes, said):
    assert notes.answer(said).startswith("I do not know that.")
    assert notes.answer(f"{said} And what is your name?") == "I am Ada."


def test_a_note_that_asks_of_visitors_too_answers_them():
    cameras = Notes(replace(PERSONA, notes=("what do I need | what do you need => A camera.",)))
    assert cameras.answer("Do I need much?") == "A camera."


def test_pleasantries(notes):
    assert "Ada" in notes.answer("hello")
    assert notes.answer("thank you very much") == "You are welcome."
    assert notes.answer("good bye").startswith("Goodbye")
    assert notes.answer("hello who are you") == "I am Ada."


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("can you wave at me?", "Of course."),
        ("Please take a bow", "Of course."),
        ("please shrug", "I do not know that."),  # this body cannot
        ("don't wave at me", "I do not know that."),
        ("who are you", "I am Ada."),
    ],
)
def test_what_the_body_shows_is_promised(question, answer):
    persona = Persona("Ada", "Hello.", ("who are you => I am Ada.",))
    assert Notes(persona, ("wave", "take_a_bow")).answer(question).startswith(answer)


def test_a_persona_without_notes_says_so():
    answer = Notes(Persona("Ada", "Hello.", ())).answer("what is your name")
    assert "no notes" in answer


def test_text_of_any_script_survives():
    assert plain("Wie heißt du?  Ça va — 你好!") == "wie heisst du ça va 你好"
    assert parse_note("no arrow") is None and parse_note("=> x") is None
    assert (
        stem("working") == "work"
        and stem("named") == stem("names") == stem("name")
        and stem("is") == "is"
    )


def test_texts_are_compared_by_the_angle_between_their_terms():
    index = Index([{"a": 2.0}, {}, {"a": 3.0, "b": 4.0}, {"c": 1.0}])
    assert index.cosines({"a": 1.0}) == pytest.approx([1.0, 0.0, 0.6, 0.0])
    assert index.cosines({"a": 1.0, "c": 1.0}) == pytest.approx(
        [0.5**0.5, 0.0, 0.6 * 0.5**0.5, 0.5**0.5]
    )
    assert not index.cosines({}).any() and index.cosines({"d": 1.0}).tolist() == [0.0] * 4
    assert Index([]).cosines({"a": 1.0}).shape == (0,)


def test_answers_are_cut_into_sentences():
    assert sentences("One. Two! Three? 3.5 is a number") == [
        "One.",
        "Two!",
        "Three?",
        "3.5 is a number",
    ]


@pytest.mark.parametrize(
    ("question", "declined"),
    [
        ("What do you think of the elections?", True),
        ("what are your POLITICAL views", True),
        ("Do you like polite people?", False),
        ("how old are you", False),
        ("how old is the war, and who fought it?", True),
        ("is war bad", False),
        ("was denkst du über 政治问题", True),
        ("who are you", False),
    ],
)
def test_forbidden_topics_are_declined_politely(question, declined):
    topics = ("politics | elections | 政治", "old war")
    ada = Notes(Persona("Ada", notes=("who are you => I am Ada.",), forbidden=topics))
    assert (ada.answer(question) == ada.refusal()) == declined


def test_a_language_model_is_told_who_it_is():
    told = instruction(
        Persona(
            "Ada",
            manner="Warm and brief.",
            notes=("who are you => I am Ada.", "The museum closes at six."),
            languages=("en", "de"),
            forbidden=("politics | elections", "age"),
        )
    )
    assert told.startswith("You are Ada,") and "Warm and brief." in told and SPOKEN in told
    assert "if it is one of en, de; otherwise in en." in told
    assert "Never talk about these topics: politics or elections; age." in told
    assert told.endswith("who are you => I am Ada.\nThe museum closes at six.")
    assert "topics" not in instruction(Persona("Ada")) and "know" not in instruction(Persona("Ada"))


@pytest.mark.parametrize("said", ["\ufdfa" * 2000, "a b " * 4_000_000])
def test_a_long_question_holds_nobody_up(said):
    notes = Notes(Persona("Ada", "", tuple(f"question {n} | other {n} => {n}" for n in range(200))))
    begun = time.process_time()
    assert notes.answer(said).startswith("I do not know that.")
    assert time.process_time() - begun < 1  # a letter that stands for 18 took seconds


def test_the_largest_persona_holds_nobody_up():
    said = " ".join(f"museum{n % 7} whom{n % 5}" for n in range(70))[:980]
    notes = tuple(f"{said[n * 13 % 900 :][:36]} => {n}" for n in range(10_000))
    names = ["é" * (n % 100 + 1) if n % 2 else f"x {'e' * (n % 90 + 4)}" for n in range(1000)]
    topics = tuple(" | ".join(names[n::100]) for n in range(100))
    ada = Persona("Ada", notes=notes, forbidden=topics)
    check_persona(ada, "Ada")
    Notes(ada)  # read once, when a session begins, in a thread
    begun = time.process_time()
    session = Notes(ada)
    for question in (said, "x " * 490, "è" * 980) * 5:
        session.answer(question)
    assert time.process_time() - begun < 1  # a third of a second for each, while all others waited
