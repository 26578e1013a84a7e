"""Settings of methods that are compared: what is changed for one is changed for all."""

from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from ico3d.body.settings import BodySettings, Method, settings_for

OURS: Method = "swings++"

Settings = TypeVar("Settings")


def preset(method: Method) -> BodySettings:
    """The cpu preset of a method, but that nobody begins on true surface points."""
    settings = settings_for("cpu", method)
    return replace(settings, initial=replace(settings.initial, source="hull"))


def changed_alike(method: Method, settings: BodySettings) -> BodySettings:
    """The preset of a method, changed as settings of SWinGS++ differ from the preset of that."""
    return _changed(preset(method), preset(OURS), settings)


def _changed(target: Settings, before: Settings, after: Settings) -> Settings:
    """A target with those values replaced in which `after` differs from `before`."""
    known: Any = before
    values: dict[str, Any] = {}
    for field in fields(known):
        name = field.name
        old, new = getattr(before, name), getattr(after, name)
        if is_dataclass(old):
            values[name] = _changed(getattr(target, name), old, new)
        elif old != new:
            values[name] = new
    return replace(target, **values)  # type: ignore[type-var]
