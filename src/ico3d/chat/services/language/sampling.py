"""Checks options of a request to a language model."""

import json
from collections.abc import Mapping
from typing import Any

from ico3d.errors import SettingsError

HOTTEST = 2.0
OWN = (
    *("model", "messages", "stream", "stream_options", "tools", "tool_choice", "n"),
    *("temperature", "max_tokens", "max_completion_tokens"),
)
"""Fields of a request that ico3d fills in and settings must not change."""


def check_sampling(
    temperature: float | None, max_tokens: int | None, extra: Mapping[str, Any], where: str
) -> None:
    """Checks temperature, length and further fields of a request.

    Args:
        temperature: Temperature of sampling; None for the server's own.
        max_tokens: Highest number of tokens, thoughts included; None for the server's own.
        extra: Further fields of the request.
        where: Place of the setting, for errors.

    Raises:
        SettingsError: If a value is out of range, a field belongs to ico3d, or a value is not JSON.
    """
    if temperature is not None and not 0 <= temperature <= HOTTEST:
        raise SettingsError(f"{where}: temperature must be 0 to {HOTTEST:g}.")
    if max_tokens is not None and max_tokens < 1:
        raise SettingsError(f"{where}: max_tokens must be at least 1.")
    taken = [name for name in extra if name in OWN]
    if taken:
        raise SettingsError(f"{where}: extra must not have {' or '.join(taken)}: ico3d sets that.")
    try:
        json.dumps(dict(extra), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise SettingsError(f"{where}: extra cannot be sent as JSON ({error}).") from None
