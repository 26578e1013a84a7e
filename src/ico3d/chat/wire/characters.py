"""Halves of characters: JSON's escapes can hold them, and nothing can send them on."""

import json
from typing import Any


def sendable(text: str) -> str:
    """A text without halves of characters."""
    return text.encode("utf-16", "surrogatepass").decode("utf-16", "replace")


def sendable_json(value: Any) -> Any:
    """A value that came as JSON, without halves of characters in any of its texts."""
    return json.loads(sendable(json.dumps(value, ensure_ascii=False)))
