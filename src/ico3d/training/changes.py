"""Settings changed by words of the command line."""

import dataclasses
from typing import Any, TypeVar

from ico3d.errors import SettingsError

Settings = TypeVar("Settings")


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
            values[name] = kind(text)
        except ValueError:
            raise SettingsError(f"'{change}': {name} takes {kind.__name__} values.") from None
    return dataclasses.replace(known, **values)
