"""What a page is told of the functions that a language model calls."""

import json

import pytest

from ico3d.chat.speaker import tool_call
from ico3d.chat.wire.codec import decode_server, encode
from ico3d.chat.wire.protocol import MAX_ARGUMENTS, Call


def test_a_call_arrives_with_its_arguments():
    call = decode_server(encode(tool_call("weather", {"city": "Zürich", "days": 2})))
    assert isinstance(call, Call) and call.name == "weather"
    assert json.loads(call.arguments) == {"city": "Zürich", "days": 2}


def test_long_arguments_are_left_out_and_no_call_is_lost():
    fitting = {"text": "x" * (MAX_ARGUMENTS - len('{"text": ""}'))}
    assert json.loads(tool_call("note", fitting).arguments) == fitting
    longer = tool_call("n" * 300, {"text": fitting["text"] + "x"})
    assert longer.arguments == "{}" and isinstance(decode_server(encode(longer)), Call)


@pytest.mark.parametrize("arguments", [[1, 2], "x", 5, None, {"mood": float("inf")}])
def test_arguments_that_are_no_object_of_json_are_left_out(arguments):
    assert decode_server(encode(tool_call("mood", arguments))) == Call("mood", "{}")


def test_halves_of_characters_lose_no_call():
    call = decode_server(encode(tool_call("mo\ud83d", {"name": "\ud83d"})))
    assert call == Call("mo\ufffd", '{"name": "\ufffd"}')
