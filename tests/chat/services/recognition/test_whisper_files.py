"""Converted Whisper models whose files do not agree are refused, before anything believes them."""

import json
import shutil
import struct
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ico3d.chat.services.recognition.whisper_files import check_whisper
from ico3d.errors import ModelError
from support.needs import needs

pytestmark = [needs("ctranslate2"), needs("transformers"), pytest.mark.slow]


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """The folder of a good model."""
    from support.chat.tiny_whisper import write_whisper

    return write_whisper(tmp_path_factory.mktemp("whisper"))


@pytest.fixture
def copy(model, tmp_path):
    """The folder of a good model, to be spoilt."""
    return Path(shutil.copytree(model, tmp_path / "copy"))


def variable(name, shape, item=4, kind=0):
    """A variable of zeros as CTranslate2 writes it."""
    size = item
    for axis in shape:
        size *= axis
    head = struct.pack("<H", len(name) + 1) + name.encode() + b"\0" + bytes([len(shape)])
    return head + struct.pack(f"<{len(shape)}IBI", *shape, kind, size) + bytes(size)


def with_more(folder, *variables):
    """A model to whose file variables are added, in the place of those of their names."""
    file = folder / "model.bin"
    content = file.read_bytes()
    begin = content.index(b"WhisperSpec\0") + len(b"WhisperSpec\0") + 4  # its revision
    (count,) = struct.unpack_from("<I", content, begin)
    end = begin + 4
    for _ in range(count):  # aliases are behind all variables
        (length,) = struct.unpack_from("<H", content, end)
        end += 2 + length
        end += 1 + 4 * content[end] + 1
        end += 4 + struct.unpack_from("<I", content, end)[0]
    head = content[:begin] + struct.pack("<I", count + len(variables))
    file.write_bytes(head + content[begin + 4 : end] + b"".join(variables) + content[end:])
    return folder


def told(folder, name, **claims):
    """A model one of whose tables says something else."""
    path = folder / name
    path.write_text(json.dumps(json.loads(path.read_text()) | claims))
    return folder


def test_a_good_model_is_believed(model):
    check_whisper(model)


@pytest.mark.parametrize(
    ("added", "sentence"),
    [
        (variable("decoder/layer_0/ffn/linear_0/weight", [5000, 64]), "has the shape"),
        (variable("encoder/conv1/weight", [64, 64, 3]), "bands"),
        (variable("encoder/layer_norm/odd", [9]), "no Whisper has a variable"),
        (variable("decoder/num_heads", [], 2, 2), "num_heads does not fit"),
        (variable("decoder/position_encodings/encodings", [4, 64]), "are too few"),
        (variable("decoder/embeddings/weight", [7]), "has 1 axes"),
    ],
    ids=["wide", "bands", "odd", "heads", "positions", "axes"],
)
def test_shapes_fit_each_other(copy, added, sentence):
    with pytest.raises(ModelError, match=sentence):
        check_whisper(with_more(copy, added))


@pytest.mark.parametrize(
    ("name", "claims", "sentence"),
    [
        ("config.json", {"suppress_ids": [2_000_000_000]}, "token 2000000000 is none"),
        ("config.json", {"suppress_ids_begin": [-7]}, "token -7 is none"),
        ("config.json", {"lang_ids": ["en"]}, "token en is none"),
        ("tokenizer.json", {"added_tokens": [{"id": 10**9}]}, "token 1000000000 is none"),
        ("tokenizer.json", {"model": {"vocab": [["a", 0.5]]}}, "does not hold a Whisper model"),
        ("preprocessor_config.json", {"feature_size": 1_500_000}, "1500000 bands"),
        ("preprocessor_config.json", {"n_fft": 2_000_000}, "n_fft is 2000000, not 400"),
        ("preprocessor_config.json", {"hop_length": 1}, "hop_length is 1, not 160"),
    ],
)
def test_tokens_and_sound_are_those_of_a_whisper(copy, name, claims, sentence):
    with pytest.raises(ModelError, match=sentence):
        check_whisper(told(copy, name, **claims))


@settings(max_examples=60)
@given(data=st.data())
def test_damaged_files_are_refused_in_one_sentence_or_are_as_good(model, tmp_path_factory, data):
    content = bytearray((model / "model.bin").read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, 400) | st.integers(0, len(content) - 1))
        content[at] = data.draw(st.integers(0, 255))
    content = content[: data.draw(st.just(len(content)) | st.integers(0, len(content)))]
    folder = tmp_path_factory.mktemp("damaged")
    for file in model.iterdir():
        (folder / file.name).symlink_to(file)
    (folder / "model.bin").unlink()
    (folder / "model.bin").write_bytes(content)
    try:
        check_whisper(folder)
    except ModelError as error:
        assert str(error).startswith(str(folder))
