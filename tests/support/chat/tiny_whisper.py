"""Whisper models of a few kilobytes in the real file format, with random weights."""

import json
from pathlib import Path

import torch
from ctranslate2.converters import TransformersConverter
from faster_whisper.tokenizer import _LANGUAGE_CODES
from tokenizers import Tokenizer, decoders, models, pre_tokenizers
from transformers import (
    GenerationConfig,
    PreTrainedTokenizerFast,
    WhisperConfig,
    WhisperForConditionalGeneration,
)

TIMESTAMPS = 1_501
MULTILINGUAL = ""  # the token by which CTranslate2 knows a multilingual vocabulary


def write_whisper(folder: Path, sentence: str = "", language: str = "en") -> Path:
    """A converted model with one layer on each side, in a new folder.

    Args:
        folder: Where to make it.
        sentence: What it hears in whatever it hears; empty for whatever is random.
        language: What it takes that to be.
    """
    torch.manual_seed(0)
    source, target = folder / "source", folder / "converted"
    ids = write_tokenizer(source, sentence)
    model = WhisperForConditionalGeneration(config_of(ids))
    if sentence:
        dictate(model, ids, sentence, language)
    languages = {name: ids[name] for name in map("<|{}|>".format, _LANGUAGE_CODES)}
    model.generation_config = GenerationConfig(
        lang_to_id=languages, suppress_tokens=[], begin_suppress_tokens=[]
    )
    model.save_pretrained(source)
    TransformersConverter(str(source), copy_files=["tokenizer.json"]).convert(str(target))
    features = {"feature_size": 80, "sampling_rate": 16000, "hop_length": 160, "n_fft": 400}
    (target / "preprocessor_config.json").write_text(json.dumps(features))
    return target


def write_tokenizer(folder: Path, sentence: str) -> dict[str, int]:
    """A tokenizer of bytes, a sentence's words and Whisper's special tokens; returns all ids."""
    tokens = dict.fromkeys((*pre_tokenizers.ByteLevel.alphabet(), *words(sentence), MULTILINGUAL))
    tokenizer = Tokenizer(models.BPE({token: n for n, token in enumerate(sorted(tokens))}, []))
    tokenizer.pre_tokenizer = pre_tokenizers.ByteLevel(add_prefix_space=False)
    tokenizer.decoder = decoders.ByteLevel()
    tasks = ("translate", "transcribe", "startoflm", "startofprev", "nospeech", "notimestamps")
    names = ("endoftext", "startoftranscript", *_LANGUAGE_CODES, *tasks)
    tokenizer.add_special_tokens([f"<|{name}|>" for name in names])
    PreTrainedTokenizerFast(tokenizer_object=tokenizer).save_pretrained(folder)
    return tokenizer.get_vocab()


def words(sentence: str) -> list[str]:
    """A sentence's words, each with the space before it, as byte-level tokens."""
    level = pre_tokenizers.ByteLevel(add_prefix_space=True)
    return [word for word, _ in level.pre_tokenize_str(sentence)]


def config_of(ids: dict[str, int], width: int = 64) -> WhisperConfig:
    """Sizes of a small model."""
    end = ids["<|endoftext|>"]
    return WhisperConfig(
        vocab_size=len(ids) + TIMESTAMPS,
        d_model=width,
        encoder_layers=1,
        decoder_layers=1,
        encoder_attention_heads=2,
        decoder_attention_heads=2,
        encoder_ffn_dim=width,
        decoder_ffn_dim=width,
        pad_token_id=end,
        bos_token_id=end,
        eos_token_id=end,
        decoder_start_token_id=ids["<|startoftranscript|>"],
    )


def dictate(model, ids: dict[str, int], sentence: str, language: str) -> None:
    """Lets each position call for its token, whatever was heard."""
    decoder = model.model.decoder
    start = ids["<|notimestamps|>"] + 1
    spoken = [start, *(ids[word] for word in words(sentence)), start + 50, ids["<|endoftext|>"]]
    wanted = [ids[f"<|{language}|>"], ids["<|transcribe|>"], *spoken]
    with torch.no_grad():
        rows = decoder.embed_tokens.weight.normal_()
        rows -= rows.mean(dim=1, keepdim=True)
        rows /= rows.std(dim=1, keepdim=True)  # no other row is as close to a row as itself
        decoder.embed_positions.weight[: len(wanted)] = 100 * rows[wanted]
