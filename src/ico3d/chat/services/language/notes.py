"""Finds the note that answers a question; tolerates other wordings and misheard words."""

import itertools
import math
import re
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ico3d.bundle.persona import Persona, wordings_of
from ico3d.chat.services.language.index import Index
from ico3d.common.people.spelling import spelled
from ico3d.motion.composing.lexicon import requested

CONFIDENT = 0.42  # score from which a note is taken as the answer
WORDS, LETTERS = 0.7, 0.3  # weights of whole words and of letter triples
MOST_LETTERS = 1000  # of what a visitor says that are compared with notes
ENDINGS = ("ingly", "edly", "ing", "ed", "es", "ly", "s")
CONTRACTIONS = (
    (r"\bwhat's\b", "what is"),
    (r"\bwho's\b", "who is"),
    (r"\bwhere's\b", "where is"),
    (r"\bhow's\b", "how is"),
    (r"\bit's\b", "it is"),
    (r"'re\b", " are"),
    (r"n't\b", " not"),
    (r"'m\b", " am"),
    (r"'ll\b", " will"),
    (r"'ve\b", " have"),
    (r"'s\b", ""),
)
COMMON = frozenset(
    """a also an and are be can could did do does for have hello hi how i in is it just me my now of
    oh ok on or please really say so tell that the then this to was well what when where which who
    why will with would you your""".split()  # noqa: SIM905
)
COMMON_WEIGHT = 0.25  # of words that every question has, against the others
UNKNOWN_WEIGHT = 0.5  # of words that no note has, against the rarest that one has
SHORTEST_ROOT = 4  # letters of a word's stem by which its other forms are known
OWN = frozenset(["i", "me", "my", "mine"])
ADDRESSED = {"i": "you", "me": "you", "my": "your", "mine": "yours", "am": "are", "was": "were"}
"""What a visitor says of themselves, as notes ask it of the avatar."""
HELLO = frozenset(["hello", "hi", "hey", "greetings", "howdy"])
THANKS = frozenset(["thank", "thanks", "thx", "cheers"])
GOODBYE = frozenset(["bye", "goodbye", "farewell"])


@dataclass(frozen=True)
class Note:
    """A note with an answer.

    Attributes:
        questions: Wordings of the question.
        answer: The answer.
    """

    questions: tuple[str, ...]
    answer: str


class Notes:
    """Answers from a persona's notes; otherwise says what can be asked."""

    def __init__(self, persona: Persona, gestures: Collection[str] = ()):
        """Parses the notes; those without `=>` are skipped.

        Args:
            persona: Who answers.
            gestures: Meanings of the gestures that the body makes when it is asked to.
        """
        self._persona, self._gestures = persona, gestures
        self._asked, self._topics = _questions(persona.notes), _topics(persona.forbidden)
        self.notes = self._asked.notes

    def answer(self, question: str) -> str:
        """The answer to a question in natural language."""
        return self.known(question) or self.fallback()

    def known(self, question: str) -> str | None:
        """The answer to a question if the notes, the body or politeness have one."""
        question = heard(question)
        if self._topics.concern(question):
            return self.refusal()
        best, score = self.best(question)
        if best is not None and score >= CONFIDENT and not is_of_visitor(question, best):
            return best.answer
        if requested(question, self._gestures) in self._gestures:
            return "Of course."  # the body shows the rest
        return self._pleasantry(question)

    def best(self, question: str) -> tuple[Note | None, float]:
        """The note that matches best, and the score of the match, 0 to 1."""
        found = self.nearest(question, 1)
        return found[0] if found else (None, 0.0)

    def nearest(self, question: str, count: int) -> list[tuple[Note, float]]:
        """The notes that match best, the best first, and their scores, 0 to 1."""
        scores = self._asked.likeness(heard(question))
        best = np.argsort(-scores, kind="stable")[:count]
        return [(self.notes[at], float(scores[at])) for at in best]

    def fallback(self) -> str:
        """The answer if no note matches."""
        if not self.notes:
            return "I do not know that. I have no notes to answer from yet."
        listed = ", or ".join(f"“{question}”" for question in self._persona.proposed)
        return f"I do not know that. You can ask me, for example: {listed}."

    def refusal(self) -> str:
        """The answer to a question about a forbidden topic."""
        return "I would rather not talk about that. Is there something else you would like to know?"

    def not_understood(self) -> str:
        """The answer if nothing was understood."""
        return "Sorry, I did not catch that. Could you say it again?"

    def _pleasantry(self, question: str) -> str | None:
        said = set(plain(question).split())
        if said & GOODBYE:
            return "Goodbye! It was nice talking with you."
        if said & THANKS:
            return "You are welcome."
        if said & HELLO and len(said) <= 4:
            return f"Hello! I am {self._persona.name}. What would you like to know?"
        return None


class Questions:
    """What all notes ask, read once: a question costs what it shares with them."""

    def __init__(self, texts: tuple[str, ...]):
        """Parses the notes; those without `=>` are skipped."""
        self.notes = [note for text in texts if (note := parse_note(text))]
        asked = [question for note in self.notes for question in note.questions]
        documents = [words(question) for question in asked]
        counts = Counter(word for document in documents for word in set(document))
        self._rarity = {w: math.log(1 + len(documents) / n) for w, n in counts.items()}
        self._unknown = UNKNOWN_WEIGHT * math.log(1 + len(documents))
        self._words = Index([self._weighted(document) for document in documents])
        self._letters = Index([triples(question) for question in asked])
        numbers = [len(note.questions) for note in self.notes]
        self._firsts = np.cumsum([0, *numbers[:-1]])  # of each note's questions

    def likeness(self, question: str) -> np.ndarray:
        """(N,) how well each note fits a question, 0 to 1, by the nearest of its wordings."""
        if not self.notes:
            return np.zeros(0)
        by_words = self._words.cosines(self._weighted(words(question)))
        by_letters = self._letters.cosines(triples(question))
        return np.maximum.reduceat(WORDS * by_words + LETTERS * by_letters, self._firsts)

    def _weighted(self, found: list[str]) -> dict[str, float]:
        weights = {word: self._rarity.get(word, self._unknown) for word in found}
        return {w: v * COMMON_WEIGHT if w in COMMON else v for w, v in weights.items()}


class Topics:
    """What the avatar declines to talk about, read once: a question costs its own length."""

    def __init__(self, topics: tuple[str, ...]):
        """Takes topics, each "word | other word"."""
        names = (plain(name).split() for topic in topics for name in topic.split("|"))
        self._names = list(dict.fromkeys(frozenset(name) for name in names if name))
        roots = {word: stem(word) for name in self._names for word in name}
        self._inside = {word for word, root in roots.items() if not root.isascii()}
        self._roots = {
            word: root
            for word, root in roots.items()
            if word not in self._inside and len(root) >= SHORTEST_ROOT
        }
        self._inner = {len(word) for word in self._inside}
        self._leading = {len(root) for root in self._roots.values()}

    def concern(self, question: str) -> bool:
        """Whether a question contains all words of one of a topic's names, in any form.

        `political` is a form of `politics`; scripts without spaces have a word inside another.
        """
        said = plain(question)
        whole = set(said.split())
        begun = {word[:length] for word in whole for length in self._leading}
        within = {said[i : i + length] for length in self._inner for i in range(len(said))}
        met = whole | (self._inside & within)
        met |= {word for word, root in self._roots.items() if root in begun}
        return any(name <= met for name in self._names)


@lru_cache(maxsize=2)  # all sessions of a server ask the same notes
def _questions(texts: tuple[str, ...]) -> Questions:
    return Questions(texts)


@lru_cache(maxsize=2)
def _topics(topics: tuple[str, ...]) -> Topics:
    return Topics(topics)


def heard(question: str) -> str:
    """As much of a question as is compared with notes; one letter may stand for eighteen."""
    return spelled("NFKC", question[:MOST_LETTERS])[:MOST_LETTERS]


def parse_note(text: str) -> Note | None:
    """A note from `question | question => answer`; None for other texts."""
    questions, answer = wordings_of(text), text.partition("=>")[2].strip()
    return Note(questions, answer) if questions and answer else None


def plain(text: str) -> str:
    """Normalises a text: lower case, contractions expanded, letters and digits, single spaces."""
    text = spelled("NFKC", text).casefold().replace("’", "'")
    for pattern, full in CONTRACTIONS:
        text = re.sub(pattern, full, text)
    return " ".join(re.findall(r"\w+", text))


def words(text: str) -> list[str]:
    """The stems of a text's words."""
    return [stem(word) for word in plain(text).split()]


def pairs(found: list[str]) -> set[tuple[str, str]]:
    """The pairs of words that follow one another."""
    return set(itertools.pairwise(found))


def is_of_visitor(question: str, note: Note) -> bool:
    """Whether visitors say of themselves what a note asks of the avatar.

    A note that asks for "your name" has no answer to "what is my name", and none to "my name is
    Tom", however alike they are. Who also asks for the avatar's is answered, and so is who asks
    what a note asks of visitors, too, such as "do I need".
    """
    said = words(question)
    last = len(said) - 1
    own = {
        (said[at - 1], word) if at == last else (word, said[at + 1])
        for at, word in enumerate(said)
        if word in OWN and last > 0
    }
    turned = {(ADDRESSED.get(a, a), ADDRESSED.get(b, b)) for a, b in own} - pairs(said)
    asked = {pair for question in note.questions for pair in pairs(words(question))}
    return bool(turned & asked) and not own & asked


def stem(word: str) -> str:
    """A word without common English endings."""
    for ending in ENDINGS:
        if word.endswith(ending) and len(word) - len(ending) >= 3:
            word = word[: -len(ending)]
            break
    return word[:-1] if word.endswith("e") and len(word) > 3 else word


def triples(text: str) -> dict[str, float]:
    """Weights of a text's letter triples, many of which survive misheard words."""
    spaced = f" {plain(text)} "
    return dict(Counter(spaced[i : i + 3] for i in range(len(spaced) - 2)))
