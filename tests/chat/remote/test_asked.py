"""Requests of modules are counted before anything is parsed of them."""

import json

import pytest
from pydantic import ValidationError
from starlette import formparsers
from starlette.exceptions import HTTPException
from starlette.requests import Request

from ico3d.chat.remote import asked as reading
from ico3d.chat.remote.asked import asked, form_of
from ico3d.chat.remote.language import ChatRequest
from ico3d.chat.remote.voice import SpeechRequest
from ico3d.errors import ProtocolError

JSON, FORM = "application/json", "multipart/form-data; boundary=b"


def request(body: bytes, kind: str = JSON) -> Request:
    async def receive():
        return {"type": "http.request", "body": body, "more_body": False}

    headers = [(b"content-type", kind.encode())]
    return Request({"type": "http", "method": "POST", "headers": headers, "app": None}, receive)


def left(body: bytes, kind: str = JSON) -> Request:
    """A whole request, whose client then leaves."""
    messages = [{"type": "http.request", "body": body}, {"type": "http.disconnect"}]

    async def receive():
        return messages.pop(0)

    headers = [(b"content-type", kind.encode())]
    return Request({"type": "http", "method": "POST", "headers": headers, "app": None}, receive)


def chat(content: str) -> bytes:
    return b'{"messages": [{"role": "user", "content": %s}]}' % content.encode()


@pytest.mark.parametrize("value", ["[]", "{}", "0"])
@pytest.mark.parametrize("kind", [ChatRequest, SpeechRequest])
async def test_json_of_millions_of_values_is_not_parsed(monkeypatch, kind, value):
    """Eight bodies of 25 MB of empty lists took 4 GB, and held up everybody for seven seconds."""
    monkeypatch.setattr(json, "loads", lambda *_: pytest.fail("parsed"))
    with pytest.raises(ProtocolError, match=r"no JSON \(it has more than 100,000 values\)"):
        await asked(request(chat(f"[{','.join([value] * 100_000)}]")), kind)


async def test_a_long_talk_is_read():
    said = "Well, I went there, and then, of course, it rained. "
    talk = json.dumps({"messages": [{"role": "user", "content": said}] * 10_000}).encode()
    assert len((await asked(request(talk), ChatRequest)).messages) == 10_000
    picture = {
        "type": "image_url",
        "image_url": {"url": "data:image/png;base64," + "A" * 4_000_000},
    }
    found = await asked(request(chat(json.dumps([picture]))), ChatRequest)
    assert found.messages[0]["content"] == [picture]


async def test_json_of_more_bytes_than_any_talk_is_too_large():
    with pytest.raises(HTTPException, match="larger than 8 MB") as refused:
        await asked(request(chat(json.dumps("a" * 8_000_000))), ChatRequest)
    assert refused.value.status_code == 413


@pytest.mark.parametrize(
    ("body", "kind", "sentence"),
    [
        (b"[1]", JSON, r"^the body: Input should be .*\.$"),
        (b'{"input": ""}', JSON, r"^input: .*\.$"),
        (b'{"input": "a"', JSON, r"^the body is no JSON \(.*\)\.$"),
        (b"[" * 100_000, JSON, "nested too deep"),
        (b'{"input": "a"}', "text/plain", "must be JSON"),
    ],
)
async def test_what_is_wrong_is_one_sentence(body, kind, sentence):
    with pytest.raises(ProtocolError, match=sentence):
        await asked(request(body, kind), SpeechRequest)


def test_of_many_messages_that_are_none_one_is_told():
    with pytest.raises(ValidationError) as refused:
        ChatRequest.model_validate({"messages": [[]] * 9999})
    assert refused.value.error_count() == 1


@pytest.mark.parametrize(
    ("content", "sentence"),
    [(["a"], "each part of content"), ({"a": 1}, "must be a text"), (5, "text")],
)
def test_messages_say_something_or_nothing(content, sentence):
    with pytest.raises(ValidationError, match=sentence):
        ChatRequest.model_validate({"messages": [{"role": "user", "content": content}]})
    for fine in (None, "", [], [{"type": "text", "text": "Hello."}]):
        ChatRequest.model_validate({"messages": [{"role": "user", "content": fine}, {}]})


@pytest.mark.parametrize("more", [b"", b'filename="f"; '])
async def test_few_heads_of_a_form_are_read(monkeypatch, more):
    """A thousand files and a thousand fields: 2 ms each, in the loop."""
    read = []
    plain = formparsers.parse_options_header
    monkeypatch.setattr(
        formparsers, "parse_options_header", lambda head: read.append(head) or plain(head)
    )
    part = b'--b\r\nContent-Disposition: form-data; name="f"; %s;;;;\r\n\r\nx\r\n' % more
    with pytest.raises(HTTPException, match="Too many") as refused:
        async with form_of(request(part * 900 + b"--b--\r\n", FORM)):
            pass
    assert refused.value.status_code == 400 and len(read) < reading.MOST_FIELDS + 5


async def test_a_form_is_multipart():
    with pytest.raises(ProtocolError, match="must be a form"):
        async with form_of(request(b"a=b&" * 100, "application/x-www-form-urlencoded")):
            pass


async def test_nothing_begins_for_a_client_that_has_left():
    """A thousand of them a second kept the next one waiting for seconds."""
    with pytest.raises(HTTPException, match="as a whole"):
        await asked(left(b'{"input": "A."}'), SpeechRequest)
    head = b'Content-Disposition: form-data; name="file"; filename="a.wav"'
    file = b"--b\r\n%s\r\n\r\nR\r\n--b--\r\n" % head
    async with form_of(request(file, FORM)) as form:
        assert len(form) == 1
    with pytest.raises(HTTPException, match="as a whole"):
        async with form_of(left(file, FORM)):
            pytest.fail("it began")
