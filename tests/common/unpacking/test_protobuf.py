"""Messages of strangers hold what is listed, once and in the shortest form."""

import pytest

from ico3d.common.unpacking.protobuf import Form, Reader, RefusedFieldError

INNER = Form("inner", once={1: "number"})
FORM = Form("outer", once={1: "number", 2: "text", 3: "bytes", 4: "float"}, many={5: INNER})


def read(data: bytes):
    return Reader(10, 10).read(memoryview(data), FORM)


def test_what_is_listed_is_read():
    message = read(b"\x08\xac\x02\x12\x02ab\x1a\x01\xff\x25\0\0\x80\x3f\x2a\x02\x08\x07\x2a\x00")
    assert (message.one(1, 0), message.one(2, "")) == (300, "ab")
    assert (bytes(message.one(3, b"")), bytes(message.one(4, b""))) == (b"\xff", b"\0\0\x80\x3f")
    assert [inner.one(1, 0) for inner in message.all(5)] == [7, 0]


@pytest.mark.parametrize(
    "data",
    [
        b"\x08\x01\x08\x01",  # twice
        b"\x08\x80\x00",  # a longer form
        b"\x88\x00\x01",
        b"\x88\x80\x80\x80\x10\x01",  # a tag of 33 bits, whose lower 32 are listed
        b"\x08" + b"\xff" * 9 + b"\x02",  # 65 bits
        b"\x08" + b"\xff" * 10 + b"\x01",
        b"\x0a\x01\x01",  # another kind
        b"\x2a\x03\x08\x01",  # cut off
        b"\x12\x0b" + b"a" * 11,  # too much text
        b"\x12\x01\xff",
        b"\x2a\x00" * 11,  # too many fields
    ],
)
def test_all_else_is_refused(data):
    with pytest.raises((ValueError, IndexError)):
        read(data)


def test_a_field_that_is_not_listed_is_named():
    with pytest.raises(RefusedFieldError, match="unexpected field 2 in its inner"):
        read(b"\x2a\x02\x10\x01")
