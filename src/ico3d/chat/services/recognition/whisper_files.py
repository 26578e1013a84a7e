"""Checks the files of a converted Whisper model, which anybody may have made.

CTranslate2 believes what they say: a layer reads as many numbers of its bias as its weight has
rows, and a token that is never to be said is struck out at its number, wherever that lies.
"""

import json
import os
import re
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from ico3d.common.files import read_small
from ico3d.errors import ModelError

OLDEST, NEWEST = 4, 6
"""Versions of the format that are read."""
ITEM_BYTES = (4, 1, 2, 4, 2, 2)
"""Bytes of a number of each type: float32, int8, int16, int32, float16, bfloat16."""
MOST_VARIABLES = 10_000
LARGEST_TOKENIZER = 16 << 20
"""Bytes of a vocabulary; those of OpenAI have 2.5 MB."""
SOUND = {"sampling_rate": 16_000, "hop_length": 160, "chunk_length": 30, "n_fft": 400}
"""What every Whisper's sound is like."""
MELS = (80, 128)
POSITIONS = {"encoder": 1500, "decoder": 448}
"""Positions that every Whisper has."""

DAMAGE = (
    *(KeyError, IndexError, ValueError, TypeError, AttributeError),
    *(OSError, struct.error, RecursionError),
)
"""What reading a damaged file raises."""

Shape = tuple[int, ...]


@dataclass(frozen=True)
class Variable:
    """What a model file says of one of its variables.

    Attributes:
        shape: Its axes.
        start: The bytes with which it begins, 8 at most.
    """

    shape: Shape
    start: bytes


def check_whisper(folder: Path) -> None:
    """Refuses a folder whose files do not agree with each other, or with what every Whisper has.

    Args:
        folder: A model that was converted for CTranslate2.

    Raises:
        ModelError: If they do not.
    """
    try:
        with (folder / "model.bin").open("rb") as file:
            variables = dict(_variables(file))
        count, mels = _checked_shapes(variables)
        _check_sound(folder / "preprocessor_config.json", mels)
        _check_tokens(folder, count)
    except DAMAGE as error:
        why = f"it lacks {error}" if isinstance(error, KeyError) else str(error)
        raise ModelError(f"{folder} does not hold a Whisper model: {why}.") from None


def _variables(file: BinaryIO) -> Iterator[tuple[str, Variable]]:
    """Names of variables, and of those that are others' second names."""
    (version,) = _read(file, "I")
    if not OLDEST <= version <= NEWEST:
        raise ValueError(f"its format is {version}, not {OLDEST} to {NEWEST}")
    _text(file), _read(file, "I")  # the kind of model, and its revision
    known: dict[str, Variable] = {}
    for _ in range(_count(file)):
        name, (rank,) = _text(file), _read(file, "B")
        shape = _read(file, f"{rank}I") if rank else ()
        kind, size = _read(file, "BI")
        numbers = 1
        for axis in shape:
            numbers *= axis
        if not numbers or size != numbers * ITEM_BYTES[kind]:
            raise ValueError(f"{name} has not as many numbers as its shape")
        known[name] = Variable(shape, file.read(min(size, 8)))
        file.seek(max(0, size - 8), 1)
        yield name, known[name]
    for _ in range(_count(file)):
        yield _text(file), known[_text(file)]


def _count(file: BinaryIO) -> int:
    (count,) = _read(file, "I")
    if count > MOST_VARIABLES:
        raise ValueError(f"it has more than {MOST_VARIABLES} variables")
    return count


def _text(file: BinaryIO) -> str:
    (length,) = _read(file, "H")
    return file.read(length).rstrip(b"\0").decode()


def _read(file: BinaryIO, what: str) -> tuple[int, ...]:
    return struct.unpack(f"<{what}", file.read(struct.calcsize(f"<{what}")))


def _checked_shapes(variables: Mapping[str, Variable]) -> tuple[int, int]:
    """Numbers of tokens and of mel bands.

    Raises:
        KeyError: If a variable is missing.
        ValueError: If a shape does not fit the others.
    """
    count, width = _axes(variables, "decoder/embeddings/weight", 2)
    mels = _axes(variables, "encoder/conv1/weight", 3)[1]
    for side, positions in POSITIONS.items():
        heads = int.from_bytes(variables[f"{side}/num_heads"].start, "little")
        if not heads or width % heads:
            raise ValueError(f"{side}/num_heads does not fit its width")
        if _axes(variables, f"{side}/position_encodings/encodings", 2)[0] < positions:
            raise ValueError(f"{side}/position_encodings are too few")
    for name, variable in variables.items():
        wanted = _shape_of(name, variable, variables, (count, width, mels))
        if wanted is not None and variable.shape not in wanted:
            raise ValueError(f"{name} has the shape {variable.shape}, not {wanted[0]}")
    return count, mels


def _axes(variables: Mapping[str, Variable], name: str, rank: int) -> Shape:
    shape = variables[name].shape
    if len(shape) != rank:
        raise ValueError(f"{name} has {len(shape)} axes")
    return shape


_LAYERS = {
    "embeddings": lambda n, d, m, f: (n, d),
    "projection": lambda n, d, m, f: (n, d),
    "conv1": lambda n, d, m, f: (d, m, 3),
    "conv2": lambda n, d, m, f: (d, d, 3),
    "self_attention/linear_0": lambda n, d, m, f: (3 * d, d),
    "self_attention/linear_1": lambda n, d, m, f: (d, d),
    "attention/linear_0": lambda n, d, m, f: (d, d),
    "attention/linear_1": lambda n, d, m, f: (2 * d, d),
    "attention/linear_2": lambda n, d, m, f: (d, d),
    "ffn/linear_0": lambda n, d, m, f: (f, d),
    "ffn/linear_1": lambda n, d, m, f: (d, f),
}
"""Shapes of weights: N tokens, D wide, M mel bands, F in the middle of the layer's own network."""
_NAME = re.compile(r"(?:en|de)coder/(?:layer_\d+/)?(.+)/([a-z_]+)")


def _shape_of(
    name: str, variable: Variable, variables: Mapping[str, Variable], sizes: Shape
) -> tuple[Shape, ...] | None:
    """Shapes that a variable may have; None for one whose shape says nothing: a single number.

    Raises:
        KeyError: If what it belongs to is missing.
        ValueError: If no Whisper has such a variable.
    """
    if not variable.shape and not name.endswith(("weight", "bias", "gamma", "beta")):
        return None
    found = _NAME.fullmatch(name)
    part, what = found.groups() if found else ("", "")
    width = sizes[1]
    if part == "position_encodings":
        return ((variable.shape[0], width),)
    if part.endswith("layer_norm") and what in ("gamma", "beta"):
        return ((width,),)
    if part not in _LAYERS or what not in ("weight", "weight_scale", "bias"):
        raise ValueError(f"no Whisper has a variable {name} of the shape {variable.shape}")
    middle = 0
    if part.startswith("ffn"):
        middle = variables[f"{name.rsplit('/', 2)[0]}/linear_0/weight"].shape[0]
    shape = _LAYERS[part](sizes[0], width, sizes[2], middle)
    return (shape,) if what == "weight" else ((shape[0],),)


def _check_sound(path: Path, mels: int) -> None:
    """Checks what a model says of its sound, if it does.

    Raises:
        ValueError: If no Whisper's is like that.
    """
    told = _json(path, 1 << 20) if os.path.isfile(path) else {"feature_size": 80}
    if mels not in MELS or told.get("feature_size", 80) != mels:
        raise ValueError(f"its sound has {told.get('feature_size')} bands, and it hears {mels}")
    for name, value in SOUND.items():
        if told.get(name, value) != value:
            raise ValueError(f"{path.name}: {name} is {told[name]}, not {value}")


def _check_tokens(folder: Path, count: int) -> None:
    """Checks that all tokens that are told are among those of the model.

    Raises:
        ValueError: If they are not.
    """
    settings = folder / "config.json"
    told = _json(settings, 1 << 20) if os.path.isfile(settings) else {}
    words = _json(folder / "tokenizer.json", LARGEST_TOKENIZER)
    numbers = [told.get(name) for name in ("lang_ids", "suppress_ids", "suppress_ids_begin")]
    numbers += [list(words["model"]["vocab"].values())]
    numbers += [[one["id"] for one in words.get("added_tokens", ())]]
    for number in (number for some in numbers for number in some or ()):
        if not isinstance(number, int) or not 0 <= number < count:
            raise ValueError(f"the token {number} is none of its {count}")


def _json(path: Path, most: int) -> dict[str, Any]:
    found = json.loads(read_small(path, most=most))
    if not isinstance(found, dict):
        raise ValueError(f"{path.name} is no table")
    return found
