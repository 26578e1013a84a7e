"""Damages messages and requests."""

import json
import re
import struct
from random import Random

from fuzz.damage.raw import changed_bytes, changed_lines
from fuzz.damage.values import changed_tree, json_text

NAMES = ("Host", "Origin", "Content-Length", "Content-Type", "Accept-Encoding", "If-None-Match")
NAMES += (
    "Range",
    "Authorization",
    "Connection",
    "Transfer-Encoding",
    "Upgrade",
    "Expect",
    "Cookie",
)
HEADERS = (
    "",
    "http://[",
    "[::1",
    "a@b",
    "localhost:99999",
    "localhost:x",
    "-1",
    "9" * 5000,
    "\xff",
)
HEADERS += ("null", "*/*;q=x", "gzip;q=1e999", "bytes=0-99999999999", "Bearer \xe9", "chunked")
HEADERS += (
    "multipart/form-data",
    "multipart/form-data; boundary=",
    'a="',
    "100-continue",
    "websocket",
)
HEADERS += (
    "127.0.0.1",
    "http://127.0.0.1",
    "http://evil.example",
    "a" * 20_000,
    "application/json",
)
PATHS = ("/%00", "/%ff", "/..%2f..%2fetc/passwd", "//", "/" + "a" * 20_000, "*", "/bundle/%2e%2e/x")
PATHS += (
    "/bundle/" + "a/" * 500,
    "/?token=" + "9" * 5000,
    "/assets/..",
    "/é",
    "http://[/",
    "/a?b=%",
)


def changed_frame(data: bytes, random: Random) -> bytes:
    """A binary message with another header of the right length, or another payload."""
    (length,) = struct.unpack_from("<I", data)
    header, payload = data[4 : 4 + length], data[4 + length :]
    if random.random() < 0.7:
        header = json_text(changed_tree(json.loads(header), random), random)
    else:
        payload = changed_bytes(payload, random)
    return struct.pack("<I", len(header)) + header + payload


def changed_request(data: bytes, random: Random) -> bytes:
    """A request with another path, header or body, whose length is mostly told right."""
    head, _, body = data.partition(b"\r\n\r\n")
    step = random.randrange(4 if body else 3)
    if step == 0:
        lines = head.split(b"\r\n")
        line = f"{random.choice(NAMES)}: {random.choice(HEADERS)}".encode("latin-1")
        lines.insert(random.randrange(1, len(lines) + 1), line)
        if random.random() < 0.7:  # in the place of the one that is there
            del lines[random.randrange(1, len(lines))]
        head = b"\r\n".join(lines)
    elif step == 1:
        path = random.choice(PATHS).encode()
        head = re.sub(rb" \S+ ", lambda _: b" " + path + b" ", head, count=1)
    elif step == 2:
        head = changed_lines(head, random)
    else:
        body = _changed_body(body, random)
    if body and random.random() < 0.9:
        head = re.sub(rb"(?i)(content-length: )\d+", rb"\g<1>%d" % len(body), head)
    return head + b"\r\n\r\n" + body


def _changed_body(body: bytes, random: Random) -> bytes:
    """Other JSON, or other bytes."""
    if body[:1] != b"{":
        return changed_bytes(body, random)
    return json_text(changed_tree(json.loads(body), random), random)
