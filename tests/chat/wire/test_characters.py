"""Halves of characters come as JSON's escapes, and go no further."""

import pytest

from ico3d.chat.wire.characters import sendable, sendable_json
from ico3d.chat.wire.codec import encode
from ico3d.chat.wire.protocol import Answer, Call
from ico3d.errors import ProtocolError


@pytest.mark.parametrize(
    ("text", "sent"),
    [("Grüße 😀", "Grüße 😀"), ("a\ud83d.", "a\ufffd."), ("\ud83d\ude00", "😀")],
)
def test_halves_of_characters_are_not_sent_on(text, sent):
    assert sendable(text) == sent
    sendable(text).encode()
    assert sendable_json({text: [text, 1, None]}) == {sent: [sent, 1, None]}


@pytest.mark.parametrize("message", [Call("mood", '{"name": "\ud83d"}'), Answer(0, 0, "\ud83d")])
def test_a_message_with_half_a_character_is_one_message_less(message):
    with pytest.raises(ProtocolError, match="half of a character"):
        encode(message)
