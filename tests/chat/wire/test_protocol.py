"""The wire: what is encoded comes back the same; what is malformed is refused in one sentence."""

import inspect
import json
import struct
import typing
from dataclasses import fields, is_dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ico3d.chat.conversation import Conversation
from ico3d.chat.generating import reference, server_fields, shared, typescript
from ico3d.chat.wire import protocol
from ico3d.chat.wire.codec import (
    OversizedError,
    decode_client,
    decode_server,
    encode,
)
from ico3d.common.typed import field_types, kind_of
from ico3d.errors import ProtocolError


def characters(low, high):
    return st.text(st.characters(codec="utf-8"), min_size=low, max_size=min(high, 60))


def values(annotation):
    """A strategy for all values that an annotation of the protocol allows."""
    kind = kind_of(annotation)
    bare, marks, origin, arguments = kind.bare, kind.marks, kind.origin, kind.arguments
    if bare is np.ndarray:
        return arrays(marks[0])
    if origin is typing.Literal:
        return st.sampled_from(arguments)
    if origin is list:
        return st.lists(values(arguments[0]), max_size=min(marks[0].high, 8))
    if origin is tuple:
        return st.tuples(*map(values, arguments))
    if origin is dict:
        size = min(marks[0].high, 8)
        return st.dictionaries(characters(1, 8), values(arguments[1]), max_size=size)
    if is_dataclass(bare):
        return messages(bare)
    if arguments:  # T | None
        return st.none() | values(arguments[0])
    if bare is str:
        return characters(marks[0].low, marks[0].high)
    if bare is bool:
        return st.booleans()
    kind = st.integers if bare is int else st.floats
    return kind(marks[0].low, marks[0].high)


def arrays(tensor):
    shapes = st.tuples(*[st.integers(0, 40)] * tensor.dims)
    return shapes.flatmap(
        lambda shape: st.integers(0, 2**32 - 1).map(
            lambda seed: np.random.default_rng(seed).integers(-999, 999, shape).astype(tensor.dtype)
        )
    )


def messages(kind):
    return st.builds(kind, **{name: values(note) for name, note in field_types(kind).items()})


def assert_same(a, b):
    assert type(a) is type(b)
    for field in fields(a):
        x, y = getattr(a, field.name), getattr(b, field.name)
        if isinstance(x, np.ndarray):
            assert x.dtype == y.dtype and x.shape == y.shape
            np.testing.assert_array_equal(x, y)
        else:
            assert x == y


@given(st.one_of(*map(messages, protocol.CLIENT_MESSAGES)))
def test_client_messages_come_back_the_same(message):
    assert_same(decode_client(encode(message)), message)


@given(st.one_of(*map(messages, protocol.SERVER_MESSAGES)))
def test_server_messages_come_back_the_same(message):
    assert_same(decode_server(encode(message)), message)


def test_binary_layout_is_the_documented_one():
    pcm = np.array([1, -2, 3], np.int16)
    rows = np.array([[0.5, -1.0]], np.float16)
    frame = encode(protocol.Speech(3, 7, 100, 4, pcm, rows))
    (length,) = struct.unpack_from("<I", frame)
    header = json.loads(frame[4 : 4 + length])
    assert header == {
        "type": "speech",
        "utterance": 3,
        "index": 7,
        "first_sample": 100,
        "first_expression": 4,
        "pcm": [3],
        "expressions": [1, 2],
    }
    assert frame[4 + length :] == pcm.tobytes() + rows.tobytes()


@given(st.text() | st.binary())
def test_garbage_is_refused_and_nothing_else_happens(frame):
    with pytest.raises(ProtocolError):
        decode_client(frame)


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=8,
)


@given(
    st.sampled_from(protocol.CLIENT_MESSAGES).flatmap(
        lambda kind: st.tuples(
            st.just(kind), st.dictionaries(st.sampled_from(sorted(field_types(kind))), json_values)
        )
    )
)
def test_wrong_fields_are_refused_or_valid(case):
    kind, header = case
    frame = json.dumps({"type": kind.__name__.lower(), **header})
    try:
        message = decode_client(frame)
    except ProtocolError as error:
        assert len(str(error)) < 400
    else:
        assert_same(decode_client(encode(message)), message)


@pytest.mark.parametrize(
    "frame",
    [
        '{"type":"text","text":""}',
        '{"type":"text","text":"' + "x" * 2001 + '"}',
        '{"type":"text","text":"a","more":1}',
        '{"type":"text"}',
        '{"type":"text","text":"\\ud800"}',
        '{"type":["text"],"text":"a"}',
        '{"type":"welcome"}',
        '{"type":"clock","utterance":0,"position":NaN,"body_time":0}',
        '{"type":"clock","utterance":0,"position":1e999,"body_time":0}',
        '{"type":"clock","utterance":true,"position":0,"body_time":0}',
        '{"type":"clock","utterance":0.5,"position":0,"body_time":0}',
        '{"type":"clock","utterance":-1,"position":0,"body_time":0}',
        '{"type":"audio","sample":0,"pcm":[2]}',
        "[" * 16000,
        "9" * 16000,
        struct.pack("<I", 2**31) + b"{}",
        struct.pack("<I", 2) + b"{}",
    ],
)
def test_malformed_frames_are_refused(frame):
    with pytest.raises(ProtocolError):
        decode_client(frame)


@pytest.mark.parametrize("shape", [[3], [1], [-1], [2, 1], [16001], [2.0], [True], None, [1e300]])
def test_a_payload_must_match_its_shape(shape):
    header = json.dumps({"type": "audio", "sample": 0, "pcm": shape}).encode()
    with pytest.raises(ProtocolError):
        decode_client(struct.pack("<I", len(header)) + header + bytes(4))


def test_oversized_frames_are_told_apart():
    with pytest.raises(OversizedError):
        decode_client('{"type":"text","text":"' + "x" * 20000 + '"}')
    with pytest.raises(OversizedError):
        decode_client(bytes(70000))


def test_own_mistakes_are_refused_when_encoding():
    with pytest.raises(ProtocolError):
        encode(protocol.Clock(0, float("nan"), 0.0))
    with pytest.raises(ProtocolError):
        encode(protocol.Audio(0, np.zeros(16001, np.int16)))


def test_every_message_of_a_page_has_a_handler():
    handlers = inspect.getattr_static(Conversation, "handle").dispatcher.registry
    assert set(handlers) - {object} == set(protocol.CLIENT_MESSAGES)


@pytest.mark.parametrize(
    ("target", "made"),
    [
        (typescript.TARGET, typescript.typescript),
        (server_fields.TARGET, server_fields.typescript),
        (shared.TARGET, shared.typescript),
        (reference.TARGET, reference.markdown),
    ],
    ids=["protocol.ts", "fields.ts", "shared.ts", "protocol.md"],
)
def test_what_is_generated_is_up_to_date(target, made):
    assert target.read_text(encoding="utf-8") == made(), "run python -m ico3d.chat.generating"


def test_the_page_names_every_message_and_field():
    page = reference.markdown()
    for kind in (*protocol.CLIENT_MESSAGES, *protocol.SERVER_MESSAGES):
        (row,) = [
            line for line in page.splitlines() if line.startswith(f"| `{kind.__name__.lower()}`")
        ]
        assert all(f"`{name}` (" in row for name in field_types(kind))


HELLOS = [
    '{"type":"hello","version":1,"session":null,"last_index":-1}',
    *(
        f'{{"type":"hello","version":{version},"session":"a","last_index":3,"wishes":{{}}}}'
        for version in range(2, protocol.VERSION + 1)
    ),
]
"""How pages of each version said hello."""


@pytest.mark.parametrize("frame", HELLOS[1:])
def test_a_page_of_any_version_can_say_which_it_is(frame):
    """The server then tells it to be loaded anew."""
    assert decode_client(frame).version == json.loads(frame)["version"]


def test_a_page_of_the_first_version_is_told_what_it_lacks():
    with pytest.raises(ProtocolError, match="field 'wishes' is missing"):
        decode_client(HELLOS[0])
