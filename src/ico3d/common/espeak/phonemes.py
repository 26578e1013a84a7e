"""Phonemes for Piper and Kokoro, which have espeak-ng make them.

The library writes beyond a buffer at some texts (`i.` a hundred times is one) and ends its process.
So that is another one than that of the server, which runs this module and works on each text in a
copy of itself; the voice itself, which takes nearly all of the time, stays with the server.
"""

import functools
import json
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from ico3d.common.espeak.forked import forked
from ico3d.common.native.isolated import Isolated, LostError, RefusedError, Told, serve
from ico3d.errors import ServiceError

LONGEST = 10.0  # s for a piece of an answer; it takes milliseconds
MOST = 250
"""Phonemes that Piper speaks at once, about as many as 200 letters of English have. What it takes
of time and memory grows by the square, and a text of few letters may be read as thousands."""

process = Isolated("ico3d.common.espeak.phonemes", LONGEST)
"""That of this process."""


def of_piper(description: Path, text: str) -> list[list[str]]:
    """The phonemes of each sentence of a text, of long ones in pieces of at most `MOST`.

    Args:
        description: The voice's own, the JSON file beside its model.
        text: What the voice is to say.

    Raises:
        ServiceError: If espeak-ng fails at the text.
    """
    sentences = _ask({"voice": "piper", "description": str(description), "text": text})
    return [piece for sentence in sentences for piece in _pieces(sentence)]


def of_kokoro(text: str, language: str) -> str:
    """The phonemes of a text.

    Args:
        text: What the voice is to say.
        language: espeak-ng's name of its language.

    Raises:
        ServiceError: If espeak-ng fails at the text.
    """
    return _ask({"voice": "kokoro", "language": language, "text": text})


def _pieces(sentence: list[str]) -> Iterator[list[str]]:
    """Cuts a sentence behind the last space that fits, or amid a word that is too long."""
    while len(sentence) > MOST:
        space = next((at for at in range(MOST, 0, -1) if sentence[at - 1] == " "), MOST)
        yield sentence[:space]
        sentence = sentence[space:]
    yield sentence


def _ask(request: dict[str, Any]) -> Any:
    try:
        return process.ask(request)[0]["phonemes"]
    except LostError:
        raise ServiceError("espeak-ng failed at a text.") from None
    except RefusedError as error:
        raise ServiceError(f"no phonemes for a text: {error}.") from None


@functools.cache
def _piper(description: Path) -> Any:
    """Piper's voice without its model."""
    piper: Any = import_module("piper")
    return piper.PiperVoice(None, piper.PiperConfig.from_dict(json.loads(description.read_bytes())))


@functools.cache
def _kokoro() -> Any:
    tokenizer: Any = import_module("kokoro_onnx.tokenizer")
    return tokenizer.Tokenizer()


def _phonemizer(request: dict[str, Any]) -> Callable[[str], Any]:
    """What makes phonemes of a text in the voice and language of a request, imported once."""
    if request["voice"] == "piper":
        return _piper(Path(request["description"])).phonemize
    tokenizer = _kokoro()
    return lambda text: tokenizer.phonemize(text, request["language"])


def _prepared(request: dict[str, Any]) -> Told:
    """Answers a request in a copy of this process that has imported what it needs."""
    _phonemizer(request)
    return _in_a_copy(request)


def _answer(request: dict[str, Any]) -> Told:
    return {"phonemes": _phonemizer(request)(request["text"])}, b""


_in_a_copy = forked(_answer, int(LONGEST))


if __name__ == "__main__":
    serve(_prepared)
