"""Separates a language model's thoughts from its answers.

Models mark thoughts with tags that differ between families. Servers may return thoughts in a
separate field. Some chat templates open the tag themselves, so that the stream contains only the
end tag. pipecat's own filter, part of its service for NVIDIA, knows only one tag at the very
beginning.
"""

import re
from dataclasses import dataclass
from typing import Any

FIELDS = ("reasoning_content", "reasoning")
"""Fields in which servers return thoughts that they have separated from the text."""
_NAMES = (
    *("think", "thinking", "thought", "thoughts", "reason", "reasoning", "reflection"),
    *("analysis", "scratchpad", "seed:think", "internal_monologue"),
)
_WORDS = re.compile(r"</?(?:thoughts?|reason|reflection|analysis)\b", re.IGNORECASE)
"""Such names also stand for other things: within an answer they are text."""
_TAG = rf"(?:{'|'.join(_NAMES)})(?:\s[^<>]*)?>"
_OPENERS = (
    rf"<{_TAG}",
    r"\[THINK\]",
    "◁think▷",
    r"<\|begin_of_thought\|>",
    r"<\|START_THINKING\|>",
    r"<\|channel\|>(?:analysis|commentary)[^<>]*<\|message\|>",
)
_CLOSERS = (
    rf"</{_TAG}",
    r"\[/THINK\]",
    "◁/think▷",
    r"<\|end_of_thought\|>",
    r"<\|END_THINKING\|>",
)
_FINAL = r"<\|channel\|>final[^<>]*<\|message\|>"  # ends all thoughts before it
_MARK = re.compile(
    rf"(?P<open>{'|'.join(_OPENERS)})|(?P<close>{'|'.join(_CLOSERS)})|(?P<final>{_FINAL})"
    r"|(?P<nothing><\|(?:start\|>assistant|end\|>|return\|>))",
    re.IGNORECASE,
)
_BEGINNINGS = (
    *(f"<{name}" for name in _NAMES),
    *(f"</{name}" for name in _NAMES),
    *("[think]", "[/think]", "◁think▷", "◁/think▷"),
    *("<|begin_of_thought|>", "<|end_of_thought|>", "<|start_thinking|>", "<|end_thinking|>"),
    *("<|channel|>", "<|start|>assistant", "<|end|>", "<|return|>"),
)
_LONGEST = 100  # letters of a mark


@dataclass(frozen=True)
class Parts:
    """A piece of a model's text, separated into answer and thoughts.

    Attributes:
        said: Text of the answer.
        thought: Text of the thoughts.
    """

    said: str = ""
    thought: str = ""

    def __add__(self, more: "Parts") -> "Parts":
        """What comes after it, too."""
        return Parts(self.said + more.said, self.thought + more.thought)


class Thoughts:
    """Separates one answer from its thoughts while it is streamed.

    Attributes:
        opened: Whether the stream begins within a thought that the chat template has opened; None
            while unknown. Until this is known, no text is returned as answer, because the end of a
            thought may follow.
        lone: Whether an end of a thought without a beginning was seen.
        begun: Whether a part of the answer was returned.
    """

    def __init__(self, opened: bool | None = False):
        """Starts an answer."""
        self.opened, self.lone, self.begun = opened, False, False
        self._depth = 1 if opened else 0
        self._rest = ""  # may be the beginning of a mark
        # Lists, joined once: thoughts come in thousands of pieces.
        self._after = list[str]()  # what came since a thought ended within another
        self._held = list[str]()  # an answer, or a thought whose end will show what it was
        self._fresh = True  # nothing has come, white space aside
        self._closed = False  # a thought has ended

    def push(self, text: str) -> Parts:
        """Adds text; returns the parts that are now known."""
        text = self._rest + text
        said, thought, at = list[str](), list[str](), 0
        for mark in _MARK.finditer(text):
            _add(self._take(text[at : mark.start()]), said, thought)
            at = mark.end()
            if self.begun and not self._depth and _WORDS.match(mark[0]):
                _add(self._take(mark[0]), said, thought)
            elif mark["open"]:
                self._open()
            elif self._depth:
                self._depth = 0 if mark["final"] else self._depth - (mark["close"] is not None)
                self._after = []
                self._closed = self._closed or mark["close"] is not None
            elif mark["close"]:
                thought += [*self._held, *said]
                said.clear()
                self._held, self.opened, self.lone = [], False, True
        cut = at + _whole(text[at:])
        self._rest = text[cut:]
        _add(self._take(text[at:cut]), said, thought)
        return Parts("".join(said), "".join(thought))

    def separate(self) -> Parts:
        """Notes that the server separates thoughts itself, so its text is the answer."""
        held, self._held = "".join(self._held), []
        if self.opened is None:
            self.opened = False
        return Parts(self._spoken(held))

    def finish(self, complete: bool = True) -> Parts:
        """Ends the text; returns the rest.

        A thought may mention such marks. If all of a text would be thoughts although some of them
        ended, the answer is the text after the last end.

        Args:
            complete: Whether the model finished and was not cut off.
        """
        rest, self._rest = self._take(self._rest), ""
        parts = self.separate() + rest
        if complete and self._depth and not self.begun:
            parts += Parts(self._spoken("".join(self._after)))
        return parts

    def _take(self, text: str) -> Parts:
        """Text without marks."""
        self._fresh = self._fresh and not text.strip()
        if self._depth:
            if self._closed:
                self._after.append(text)
            return Parts("", text)
        if self.opened is None:
            self._held.append(text)
            return Parts()
        return Parts(self._spoken(text))

    def _open(self) -> None:
        if self._fresh:  # first of all: the model opens its thoughts itself, whatever was expected
            self.opened, self._depth, self._fresh = False, 0, False
        self._depth += 1

    def _spoken(self, text: str) -> str:
        """Text of the answer, which does not begin with white space."""
        text = text if self.begun else text.lstrip()
        self.begun = self.begun or bool(text)
        return text


def _add(parts: Parts, said: list[str], thought: list[str]) -> None:
    """Adds parts to lists, which are joined once: a text of marks alone has thousands."""
    said.append(parts.said)
    thought.append(parts.thought)


def without_thoughts(text: str, opened: bool | None = None) -> str:
    """The answer in a whole text."""
    thoughts = Thoughts(opened)
    return thoughts.push(text).said + thoughts.finish().said


def opens_thoughts(prompt: str) -> bool:
    """Whether a prompt, written by a chat template, ends with the beginning of a thought."""
    marks = list(_MARK.finditer(prompt))
    return bool(marks and marks[-1]["open"] and not prompt[marks[-1].end() :].strip())


def field_of(delta: Any) -> str | None:
    """The thoughts that a server returns in a separate field; empty if there are none."""
    values = [getattr(delta, name, None) for name in FIELDS]
    return next((value for value in values if isinstance(value, str)), None)


def _whole(text: str) -> int:
    """How much of a text, from its beginning, can be no unfinished mark."""
    for at in range(max(0, len(text) - _LONGEST), len(text)):
        if text[at] in "<[◁" and _may_become_a_mark(text[at:].lower()):
            return at
    return len(text)


def _may_become_a_mark(tail: str) -> bool:
    return any(
        beginning.startswith(tail) or (tail.startswith(beginning) and _goes_on(tail, beginning))
        for beginning in _BEGINNINGS
    )


def _goes_on(tail: str, beginning: str) -> bool:
    """Whether what follows the beginning of a mark may still belong to it."""
    if beginning == "<|channel|>":
        return tail.count("<") < 2 or "<|message|>".startswith(tail[tail.rindex("<") :])
    attributes = tail[len(beginning) :]
    is_tag = beginning.strip("</") in _NAMES
    return is_tag and re.fullmatch(r"(\s[^<>]*)?", attributes) is not None
