"""Settings of methods that are compared: a change of SWinGS++'s settings applies to all methods."""

from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from ico3d.body.settings import BodySettings, Method, settings_for
from ico3d.common.presets import PresetName

OURS: Method = "swings++"
"""The method that others are compared with."""

Settings = TypeVar("Settings")


def preset(method: Method, name: PresetName = "cpu") -> BodySettings:
    """A preset of a method, with first points on the visual hull, not on true surfaces."""
    settings = settings_for(name, method)
    return replace(settings, initial=replace(settings.initial, source="hull"))


def changed_alike(method: Method, settings: BodySettings, name: PresetName = "cpu") -> BodySettings:
    """A preset of a method, with the same changes as settings of SWinGS++.

    Args:
        method: The method.
        settings: Settings of SWinGS++; values that differ from its preset replace those of
            `method`.
        name: The preset.
    """
    return _changed(preset(method, name), preset(OURS, name), settings)


def _changed(target: Settings, before: Settings, after: Settings) -> Settings:
    """`target` with those values of `after` in which `after` differs from `before`."""
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
