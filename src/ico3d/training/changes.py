"""Settings changed by words of the command line."""

import dataclasses
from typing import Any, TypeVar

from ico3d.errors import SettingsError

Settings = TypeVar("Settings")

TRUTH = {"true": True, "false": False}


def with_changes(settings: Settings, changes: tuple[str, ...]) -> Settings:
    """Settings with some values replaced.

    Args:
        settings: A dataclass of numbers and words.
        changes: Words `name=value`.

    Raises:
        SettingsError: If a name is unknown or a value has the wrong type.
    """
    known: Any = settings
    values, names = {}, [field.name for field in dataclasses.fields(known)]
    for change in changes:
        name, _, text = change.partition("=")
        if name not in names:
            raise SettingsError(f"there is no setting '{name}': known are {', '.join(names)}.")
        kind = type(getattr(settings, name))
        try:
            values[name] = TRUTH[text] if kind is bool else kind(text)
        except (ValueError, KeyError):
            words = "true or false" if kind is bool else f"{kind.__name__} values"
            raise SettingsError(f"'{change}': {name} takes {words}.") from None
    return dataclasses.replace(known, **values)
