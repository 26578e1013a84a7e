"""Values that readers stumble over, and the places of a parsed tree where they go."""

import json
import math
from random import Random
from typing import Any

NUMBERS = (0, 1, -1, 2, 7, 255, 65_536, 2**31, 2**32, 2**63, -(2**63) - 1, 10**400, 10**9)
REALS = (0.5, -0.0, 1e-308, 1e308, math.nan, math.inf, -math.inf, 1e-9, 1e17)
TEXTS = (
    "",
    " ",
    "a" * 5000,
    "\0",
    "../../etc/passwd",
    "/dev/zero",
    "nan",
    "é\u2028",
    "\x1b[2J",
    "%s",
)
TEXTS += ("1" * 5000, "\ud800", "\n", "__class__", "https://a@b/", "[::1", "F32", "a/b/c/d/e/f/g")
DEEP = "<deep>"
"""Stands for brackets within brackets until the tree is written."""
DEPTH = 20_000


def hostile(random: Random) -> Any:
    """Some value of JSON that is seldom what a reader expects."""
    kind = random.randrange(8)
    if kind == 0:
        return random.choice((None, True, False, [], {}, [[]], {"": None}))
    if kind == 1:
        return random.choice(([0] * 1000, [[0] * 4] * 4, [None], ["a", 1], {"a": {"a": {}}}, DEEP))
    if kind <= 3:
        return random.choice(TEXTS)
    return random.choice(NUMBERS if kind <= 5 else REALS)


def changed_tree(tree: Any, random: Random) -> Any:
    """A copy of parsed JSON with one to three changes anywhere."""
    tree = json.loads(json.dumps(tree))
    for _ in range(random.choice((1, 1, 2, 3))):
        places = list(_places(tree))
        if not places:
            return hostile(random)
        holder, key = random.choice(places)
        _change(holder, key, tree, random)
    return tree


def _places(tree: Any):
    """Every container with every key in it."""
    keys = list(tree) if isinstance(tree, dict) else range(len(tree)) if _is_list(tree) else ()
    for key in keys:
        yield tree, key
        yield from _places(tree[key])


def _is_list(value: Any) -> bool:
    return isinstance(value, list)


def _change(holder: Any, key: Any, tree: Any, random: Random) -> None:
    """Replaces, removes, renames, moves, bends or multiplies one value."""
    step, value = random.randrange(9), holder[key]
    if step == 0:
        del holder[key]
    elif step == 1 and isinstance(holder, dict):
        holder[random.choice(TEXTS[:-4])] = holder.pop(key)
    elif step == 2 and isinstance(holder, list):
        holder.insert(key, value)
    elif step == 3 and isinstance(value, int | float) and not isinstance(value, bool):
        holder[key] = random.choice((-value, value + 1, value * 2, value / 3, value + 1e-3))
    elif step == 4 and isinstance(value, list | str):
        holder[key] = value[: len(value) // 2] if random.random() < 0.5 else value * 2
    elif step == 5:
        other, name = random.choice(list(_places(tree)))
        holder[key] = json.loads(json.dumps(other[name]))
    else:
        holder[key] = hostile(random)


def json_text(tree: Any, random: Random) -> bytes:
    """A tree as JSON, with NaN as Python writes it, now and then a key twice."""
    text = json.dumps(tree, ensure_ascii=random.random() < 0.5)
    text = text.replace(f'"{DEEP}"', "[" * DEPTH + "]" * DEPTH)
    if random.random() < 0.05 and text.startswith("{") and isinstance(tree, dict) and tree:
        text = "{" + json.dumps(next(iter(tree))) + ": 1, " + text[1:]
    return text.encode("utf-8", "surrogatepass")


def toml_text(tree: Any) -> bytes:
    """A tree as TOML, in which tables stand in lines of their own."""
    if not isinstance(tree, dict):
        return _toml(tree).encode("utf-8", "surrogatepass")
    lines = [f"{json.dumps(key)} = {_toml(value)}" for key, value in tree.items()]
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if value == DEEP:
        return "[" * DEPTH + "]" * DEPTH
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    return '""' if value is None else json.dumps(value)
