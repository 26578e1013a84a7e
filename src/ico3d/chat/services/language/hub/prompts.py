"""Writes prompts by chat templates, which are programs that anybody may have written.

A template can loop for days or double a text until the memory is full, and nothing stops it from
within a process. So they run in one of their own, which ends.
"""

from typing import Any

from ico3d.common.native.isolated import Isolated, LostError, Told, serve
from ico3d.common.unpacking.limits import limit_memory
from ico3d.errors import ModelError

LONGEST_TEMPLATE, LONGEST_PROMPT = 1 << 18, 1 << 17
"""Letters of a template, and of what it writes."""
SECONDS = 20.0
"""Seconds by the clock that a prompt may take on a busy machine, the start of the process included:
2 s on a quiet one, then milliseconds."""
MOST_BYTES = 256 << 20
"""Memory that a template may take."""


class Prompts:
    """The chat template of one model."""

    def __init__(self, template: str, marks: dict[str, str]):
        """Starts no process yet; the first prompt does.

        Args:
            template: A template of Jinja.
            marks: The model's special tokens, by the names that templates have for them.
        """
        self._template, self._marks = template, marks
        self._writer = Isolated(__name__, SECONDS)
        self._is_lost = False

    def of(self, messages: list[dict[str, Any]]) -> str:
        """The prompt that asks for an answer to a conversation.

        Args:
            messages: Roles and contents.

        Raises:
            ModelError: If the template takes too much time or memory, now or once before.
            RefusedError: If it refuses the conversation, or writes too much.
        """
        request = {"template": self._template, "marks": self._marks, "messages": messages}
        if not self._is_lost:
            try:
                return self._writer.ask(request)[1].decode()
            except LostError:
                self._is_lost = True  # else each question would wait as long again
        raise ModelError("the model's chat template takes too much time or memory.")


def prompts_of(tokenizer: Any) -> Prompts:
    """The chat template of a tokenizer of transformers.

    Raises:
        ModelError: If it has none, or none of a usual length.
    """
    template, marks = tokenizer.chat_template, tokenizer.special_tokens_map
    if not isinstance(template, str) or len(template) > LONGEST_TEMPLATE:
        raise ModelError("the model has no chat template of a usual length.")
    return Prompts(template, {name: str(mark) for name, mark in marks.items()})


def _answer(request: dict[str, Any]) -> Told:
    """What the process does: writes one prompt."""
    from transformers.utils.chat_template_utils import render_jinja_template

    try:
        written, _ = render_jinja_template(
            [request["messages"]],
            chat_template=request["template"],
            add_generation_prompt=True,
            **request["marks"],
        )
    except MemoryError:
        raise LostError from None
    prompt = str(written[0])
    if len(prompt) > LONGEST_PROMPT:
        raise ValueError(f"its chat template writes more than {LONGEST_PROMPT} letters.")
    return {}, prompt.encode()


def _main() -> None:
    import transformers.utils.chat_template_utils

    del transformers  # imported before memory is counted
    limit_memory(MOST_BYTES)
    serve(_answer)


if __name__ == "__main__":
    _main()
