"""Loads models of transformers from folders, which anybody may have made.

Weights come from safetensors only, and no code of a folder is run. What its settings claim is
believed as far as its weights hold it: transformers makes up what is missing, as large as claimed.
"""

import json
import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import torch
from transformers import AutoConfig, AutoModelForCausalLM, AutoTokenizer, GenerationConfig

from ico3d.common.files import read_small
from ico3d.common.unpacking.heads import check_head
from ico3d.errors import Ico3dError, ModelError

CONFIG, TOKENIZER = "config.json", "tokenizer.json"
LARGEST_CONFIG, LARGEST_TOKENIZER = 1 << 20, 40 << 20
"""Bytes of a model's settings, and of its vocabulary: large ones have 35 MB."""
MOST_REPEATED = 1024
"""Layers, heads or experts of a model: for each layer some objects are made before any weight is
read."""
REPEATED = ("layer", "head", "expert")
TIED, PACKED = 2, 16
"""How many numbers a model may have for one that is stored: embeddings may serve twice, and eight
or sixteen numbers of quantised weights lie in one."""
GROWING, MOST_GROWING, LONGEST_GROWTH = ("Replace", "Prepend"), 4, 4
"""Rules of a tokenizer that put something in the place of a letter, how many of them it may have,
and the letters of that: for a space, `▁` takes one."""
CHOSEN = (
    *("do_sample", "temperature", "top_k", "top_p", "min_p", "typical_p", "repetition_penalty"),
    *("bos_token_id", "eos_token_id", "pad_token_id"),
)
"""What a model may say of how it is sampled. Others, such as the number of beams, cost memory."""


def load_model(folder: Path, **how: Any) -> tuple[Any, Any]:
    """A causal language model, and its tokenizer.

    Args:
        folder: Folder of transformers.
        how: Further arguments for transformers.

    Raises:
        ModelError: If the folder does not hold all of a model, or claims more than it holds.
    """
    try:
        return _loaded(folder, how)
    except Ico3dError:
        raise
    except Exception as error:  # of many kinds, from several packages
        reason = str(error).strip().split("\n")[0]
        raise ModelError(f"{folder} does not hold a language model: {reason}") from error


def _loaded(folder: Path, how: dict[str, Any]) -> tuple[Any, Any]:
    kept: dict[str, Any] = {"local_files_only": True, "trust_remote_code": False}
    _check(folder, kept)
    model, about = AutoModelForCausalLM.from_pretrained(
        folder, use_safetensors=True, output_loading_info=True, **how, **kept
    )
    missing = sorted(about["missing_keys"])
    if missing:  # they would be random
        raise ModelError(f"{folder} does not hold a language model: it lacks {missing[0]}.")
    told = model.generation_config.to_dict()
    model.generation_config = GenerationConfig(**{name: told.get(name) for name in CHOSEN})
    return model.eval(), AutoTokenizer.from_pretrained(folder, **kept)


def _check(folder: Path, kept: dict[str, Any]) -> None:
    """Refuses a folder that claims more than it holds.

    Raises:
        ModelError: If it does.
    """
    if os.path.isfile(folder / TOKENIZER):
        _check_tokenizer(folder / TOKENIZER)
    settings = json.loads(read_small(folder / CONFIG, most=LARGEST_CONFIG))
    for name, value in _numbers(settings):
        if value > MOST_REPEATED and any(word in name for word in REPEATED):
            raise ModelError(f"{folder / CONFIG}: {name} is {value}, {MOST_REPEATED} at most.")
    with torch.device("meta"):  # shapes without numbers
        claimed = AutoModelForCausalLM.from_config(
            AutoConfig.from_pretrained(folder, **kept), trust_remote_code=False
        )
    each = PACKED if "quantization_config" in settings else TIED
    if sum(one.numel() for one in claimed.parameters()) > each * _stored(folder):
        raise ModelError(f"{folder}: {CONFIG} claims a larger model than its weights are.")


def _check_tokenizer(path: Path) -> None:
    """Refuses a vocabulary whose rules can make a text much longer: each may double it.

    Raises:
        ModelError: If it has more of them than any usual one, or longer ones.
    """
    words = json.loads(read_small(path, most=LARGEST_TOKENIZER))
    parts = [words.get(name) for name in ("normalizer", "pre_tokenizer", "decoder")]
    longer = [one for part in parts for one in _parts(part) if one.get("type") in GROWING]
    told = [str(one.get("content", one.get("prepend", ""))) for one in longer]
    if len(longer) > MOST_GROWING or any(len(text) > LONGEST_GROWTH for text in told):
        raise ModelError(f"{path} has rules that could make a text longer without an end.")


def _parts(part: Any) -> Iterator[dict[str, Any]]:
    """A part of a tokenizer, and all that it consists of."""
    if isinstance(part, dict):
        yield part
    for value in part.values() if isinstance(part, dict) else part or ():
        if isinstance(value, dict | list):
            yield from _parts(value)


def _numbers(settings: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """Names and values of all numbers in some settings."""
    if isinstance(settings, dict):
        for key, value in settings.items():
            yield from _numbers(value, str(key))
    elif isinstance(settings, list):
        for value in settings:
            yield from _numbers(value, name)
    elif isinstance(settings, int | float):
        yield name, settings


def _stored(folder: Path) -> int:
    """How many numbers a folder's weights hold."""
    count = 0
    for path in folder.glob("*.safetensors"):
        head = check_head(path)
        told = json.loads(head)
        told.pop("__metadata__", None)
        bytes_held = path.stat().st_size - 8 - len(head)
        count += min(sum(math.prod(one["shape"]) for one in told.values()), bytes_held)
    return count
