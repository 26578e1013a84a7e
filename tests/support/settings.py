"""Settings of trainings that are done in a moment."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any


def changed(settings: Any, changes: Mapping[str, Any]) -> Any:
    """Settings with some values replaced.

    Args:
        settings: A dataclass, with others in it.
        changes: New values by the names that the command line has for them, as `density.until`.
    """
    for name, value in changes.items():
        group, _, rest = name.partition(".")
        new = changed(getattr(settings, group), {rest: value}) if rest else value
        settings = replace(settings, **{group: new})
    return settings
