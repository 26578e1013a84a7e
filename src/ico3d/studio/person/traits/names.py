"""Names of what synthetic people may have."""

from typing import Literal, get_args

TraitName = Literal["glasses", "beard", "long-hair", "dark-skin", "child"]
TRAITS: tuple[TraitName, ...] = get_args(TraitName)
