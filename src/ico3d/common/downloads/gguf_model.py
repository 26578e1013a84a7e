"""Converts a Llama-like language model from GGUF to CTranslate2's int8 format, with its tokenizer.

Only numpy computes: neither torch nor transformers is needed. GGUF holds data alone; the chat
template in it, which is a program, is ignored. GGUF keeps the rows of queries and keys in the order
of the original Llama, in which the two numbers that are rotated together lie side by side.
"""

import importlib
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ico3d.errors import DownloadError, MissingExtraError

PACKAGES = ("gguf", "ctranslate2", "tokenizers")
SPECIAL = 3  # GGUF's kind of tokens that control a model and stand in no text
MODEL, PRE_TOKENIZER = "gpt2", "smollm"
"""GGUF's names of the only kind of tokenizer that is understood here."""
UNKNOWN, BEGIN, END = "<|endoftext|>", "<|im_start|>", "<|im_end|>"


def packages_for_conversion() -> None:
    """Checks that the packages which convert are installed.

    Raises:
        MissingExtraError: If one of them is missing.
    """
    for name in PACKAGES:
        if find_spec(name) is None:
            raise MissingExtraError(name, "natural", "the conversion of a language model")


def convert(source: Path, target: Path) -> None:
    """Writes model, vocabulary and tokenizer into an existing folder.

    Args:
        source: The model in GGUF.
        target: The folder to write to.

    Raises:
        DownloadError: If the model is of another architecture, or has another kind of tokenizer.
    """
    gguf: Any = importlib.import_module("gguf")
    reader = gguf.GGUFReader(source)

    def fact(name: str) -> Any:
        field = reader.fields.get(name)
        return None if field is None else field.contents()

    kinds = tuple(fact(name) for name in _KINDS)
    if kinds != tuple(_KINDS.values()):
        raise DownloadError(f"{source.name} is no model that can be converted: {kinds}.")
    tensors = {tensor.name: tensor for tensor in reader.tensors}

    def weight(name: str) -> np.ndarray:
        tensor = tensors[name]
        return gguf.quants.dequantize(tensor.data, tensor.tensor_type).astype(np.float32)

    specification = _specification(fact, weight)
    specification.register_vocabulary(fact("tokenizer.ggml.tokens"))
    specification.validate()
    specification.optimize(quantization="int8")
    specification.save(str(target))
    _tokenizer(fact).save(str(target / "tokenizer.json"))


_KINDS = {
    "general.architecture": "llama",
    "tokenizer.ggml.model": MODEL,
    "tokenizer.ggml.pre": PRE_TOKENIZER,
}


def _specification(fact: Callable[[str], Any], weight: Callable[[str], np.ndarray]) -> Any:
    """CTranslate2's description of the model, with its weights in float32."""
    specs: Any = importlib.import_module("ctranslate2.specs")
    made: Any = specs.TransformerDecoderModelSpec.from_config(
        fact("llama.block_count"),
        fact("llama.attention.head_count"),
        num_heads_kv=fact("llama.attention.head_count_kv"),
        activation=specs.Activation.SWISH,
        pre_norm=True,
        ffn_glu=True,
        rms_norm=True,
        rotary_dim=0,  # all of a head
        rotary_interleave=True,
        rotary_base=fact("llama.rope.freq_base"),
    )
    decoder = made.decoder
    decoder.scale_embeddings = False
    decoder.embeddings.weight = weight("token_embd.weight")
    decoder.projection.weight = decoder.embeddings.weight  # the model shares them
    decoder.layer_norm.gamma = weight("output_norm.weight")
    for index, layer in enumerate(decoder.layer):
        _fill_layer(layer, lambda name, index=index: weight(f"blk.{index}.{name}.weight"))
    made.config.unk_token, made.config.bos_token, made.config.eos_token = UNKNOWN, BEGIN, END
    made.config.layer_norm_epsilon = fact("llama.attention.layer_norm_rms_epsilon")
    return made


def _fill_layer(layer: Any, weight: Callable[[str], np.ndarray]) -> None:
    """Sets the weights of one layer."""
    attention = layer.self_attention
    attention.layer_norm.gamma = weight("attn_norm")
    together = [weight(f"attn_{name}") for name in "qkv"]
    attention.linear[0].weight = np.concatenate(together)  # (E + 2 K, E)
    attention.linear[1].weight = weight("attn_output")
    layer.ffn.layer_norm.gamma = weight("ffn_norm")
    layer.ffn.linear_0.weight = weight("ffn_gate")
    layer.ffn.linear_0_noact.weight = weight("ffn_up")
    layer.ffn.linear_1.weight = weight("ffn_down")


def _tokenizer(fact: Callable[[str], Any]) -> Any:
    """The tokenizer: pairs of bytes that are merged, digits one by one."""
    tokenizers: Any = importlib.import_module("tokenizers")
    before: Any = importlib.import_module("tokenizers.pre_tokenizers")
    tokens: list[str] = fact("tokenizer.ggml.tokens")
    merges = [tuple(pair.split(" ")) for pair in fact("tokenizer.ggml.merges")]
    numbered = {token: number for number, token in enumerate(tokens)}
    made = tokenizers.Tokenizer(tokenizers.models.BPE(numbered, merges))
    made.pre_tokenizer = before.Sequence(
        [before.Digits(individual_digits=True), before.ByteLevel(add_prefix_space=False)]
    )
    made.decoder = tokenizers.decoders.ByteLevel()
    kinds = zip(tokens, fact("tokenizer.ggml.token_type"), strict=True)
    special = [token for token, kind in kinds if kind == SPECIAL]
    made.add_special_tokens(
        [tokenizers.AddedToken(token, special=True, normalized=False) for token in special]
    )
    return made
