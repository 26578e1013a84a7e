"""Which shape comes out of each operator of a `speech.onnx`, for any number of rows.

The rules are those of ONNX's operator sets 13 to 17 for the operators listed here; what a rule does
not cover is refused. Only the first dimension of an array may depend on the number of rows, and
then it is that number and some more: so the numbers of an array and the multiplications of an
operator grow with the rows as a line does, and never by a power.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

FLOAT, INT64 = 1, 7
"""Types of numbers by ONNX's numbers: float32 and int64."""
ROWS = 1 << 40
"""Stands for the number of rows: a dimension of ROWS + 7 has seven more. None is as large."""
MOST_DIMENSIONS, MOST_SIZE = 8, 1 << 31
"""Dimensions of an array, and how large one may be."""
MOST_MORE = 1 << 20
"""How many rows an array may have beyond those that are heard."""

Shape = tuple[int, ...]
Settings = Mapping[str, Any]


class UnfitError(ValueError):
    """Shapes, types or attributes that no rule covers."""


class HeardError(ValueError):
    """A shape that depends on what is heard: it could be small in silence, in which it is tried."""


@dataclass(frozen=True)
class Array:
    """What is known of an array before anything runs.

    Attributes:
        kind: Type of its numbers.
        shape: Its dimensions.
        values: Its numbers, where they may say a shape; None for all else.
    """

    kind: int
    shape: Shape
    values: tuple[int, ...] | None = None


Inputs = Sequence[Array | None]
"""What an operator takes; None for an input that is left out."""


@dataclass(frozen=True)
class Rule:
    """What an operator may have, and what it makes.

    Attributes:
        shape: The shape of its output.
        inputs: How many inputs it takes, at least and at most.
        computed: How many of them, from the first one on, hold what is computed with; those behind
            say a shape.
        settings: Types of its attributes by name.
    """

    shape: Callable[[Inputs, Settings], Shape]
    inputs: tuple[int, int]
    computed: int
    settings: Mapping[str, int]


def output(operator: str, given: Inputs, settings: Settings) -> Array:
    """What an operator makes.

    Raises:
        HeardError: If its shape depends on what is heard.
        ValueError, LookupError, TypeError: If no rule covers it.
    """
    rule = RULES[operator]
    least, most = rule.inputs
    if not least <= len(given) <= most or None in given[:least]:
        raise UnfitError("another number of inputs")
    if operator not in _ANY_TYPE and any(a and a.kind != FLOAT for a in given[: rule.computed]):
        raise UnfitError("numbers of another type")
    if operator == "Constant":
        return settings["value"]
    shape = rule.shape(given, settings)
    check_shape(shape)
    return _first(given) if operator == "Identity" else Array(FLOAT, shape)


def check_shape(shape: Shape) -> None:
    """Checks that only the first dimension depends on the number of rows, and as a line does.

    Raises:
        UnfitError: If it is otherwise, or a dimension is empty or too large.
    """
    if len(shape) > MOST_DIMENSIONS or not all(1 <= size < MOST_SIZE for size in shape[1:]):
        raise UnfitError("too many or too large dimensions")
    if shape and not (1 <= shape[0] < MOST_SIZE or 0 <= shape[0] - ROWS <= MOST_MORE):
        raise UnfitError("rows in another number than are heard")


def _first(given: Inputs) -> Array:
    """An operator's first input."""
    assert given[0] is not None
    return given[0]


def _shapes(given: Inputs) -> list[Shape]:
    return [array.shape for array in given if array is not None]


def _said(given: Inputs, place: int, default: tuple[int, ...] | None = None) -> tuple[int, ...]:
    """The numbers of an input that says a shape."""
    array = given[place] if place < len(given) else None
    if array is None and default is not None:
        return default
    if array is None or array.values is None:
        raise HeardError
    return array.values


def _axis(axis: int, count: int) -> int:
    """The number of an axis, from the first one on."""
    if not -count <= axis < count:
        raise UnfitError("no such axis")
    return axis % count


def _axes(axes: Sequence[int], count: int) -> list[int]:
    """The numbers of several axes, of which none is named twice."""
    found = sorted(_axis(axis, count) for axis in axes)
    if not found or len(set(found)) != len(found):
        raise UnfitError("no axes, or one twice")
    return found


def _flag(settings: Settings, name: str, default: int = 0) -> bool:
    """An attribute that says yes or no; of other numbers runtimes think differently."""
    found = settings.get(name, default)
    if found not in (0, 1):
        raise UnfitError("attributes that do not fit")
    return bool(found)


def _same(given: Inputs, settings: Settings) -> Shape:
    return _first(given).shape


def _cast(given: Inputs, settings: Settings) -> Shape:
    if settings.get("to") != FLOAT:
        raise UnfitError("a cast to something other than float32")
    return _first(given).shape


def _softmax(given: Inputs, settings: Settings) -> Shape:
    shape = _first(given).shape
    _axis(settings.get("axis", -1), len(shape))
    return shape


def _broadcast(*shapes: Shape) -> Shape:
    """The shape to which all are spread."""
    count = max(map(len, shapes))
    spread = [(1,) * (count - len(shape)) + shape for shape in shapes]
    found = tuple(max(sizes) for sizes in zip(*spread, strict=True))
    if any(len({1, *sizes}) > 2 for sizes in zip(*spread, strict=True)):
        raise UnfitError("shapes that do not fit")
    return found


def _elementwise(given: Inputs, settings: Settings) -> Shape:
    return _broadcast(*_shapes(given))


def _concat(given: Inputs, settings: Settings) -> Shape:
    shapes = _shapes(given)
    axis = _axis(settings["axis"], len(shapes[0])) if "axis" in settings else None
    if axis is None or len(shapes) < len(given):
        raise UnfitError("no axis, or an input left out")
    if len({(len(shape), shape[:axis], shape[axis + 1 :]) for shape in shapes}) > 1:
        raise UnfitError("shapes that do not fit")
    whole = sum(shape[axis] for shape in shapes)
    return (*shapes[0][:axis], whole, *shapes[0][axis + 1 :])


def _flatten(given: Inputs, settings: Settings) -> Shape:
    shape, axis = _first(given).shape, settings.get("axis", 1)
    axis = axis if axis == len(shape) else _axis(axis, len(shape))
    return math.prod(shape[:axis]), math.prod(shape[axis:])


def _gemm(given: Inputs, settings: Settings) -> Shape:
    (rows, inner), second, *added = _shapes(given)
    if _flag(settings, "transA") or len(second) != 2:
        raise UnfitError("a first matrix that is turned")
    height, width = second[::-1] if _flag(settings, "transB") else second
    if height != inner or any(_broadcast(one, (rows, width)) != (rows, width) for one in added):
        raise UnfitError("shapes that do not fit")
    return rows, width


def _matmul(given: Inputs, settings: Settings) -> Shape:
    one, other = _shapes(given)
    if len(one) != 2 or len(other) != 2 or one[-1] != other[-2]:  # of many, runtimes keep lists
        raise UnfitError("shapes that do not fit")
    return one[0], other[1]


def _conv(given: Inputs, settings: Settings) -> Shape:
    (number, channels, *sizes), (made, taken, *kernel), *added = _shapes(given)
    count = len(sizes)
    if (
        channels != taken
        or settings.get("group", 1) != 1
        or count not in (1, 2)
        or added not in ([], [(made,)])
    ):
        raise UnfitError("shapes that do not fit")
    if settings.get("kernel_shape", tuple(kernel)) != tuple(kernel):
        raise UnfitError("a kernel of another shape than it states")
    steps, gaps = (_positive(settings, name, count) for name in ("strides", "dilations"))
    pads = settings.get("pads", (0,) * 2 * count)
    if len(pads) != 2 * count or min(pads) < 0 or len(kernel) != count:
        raise UnfitError("pads that do not fit")
    left = [
        size + pads[i] + pads[i + count] - gaps[i] * (kernel[i] - 1) - 1
        for i, size in enumerate(sizes)
    ]
    return (number, made, *(rest // step + 1 for rest, step in zip(left, steps, strict=True)))


def _positive(settings: Settings, name: str, count: int) -> tuple[int, ...]:
    """An attribute of one number for each dimension of a picture, 1 unless it is given."""
    found = settings.get(name, (1,) * count)
    if len(found) != count or min(found) < 1:
        raise UnfitError("attributes that do not fit")
    return found


def _pad(given: Inputs, settings: Settings) -> Shape:
    shape = _first(given).shape
    pads = _said(given, 1)
    if len(pads) != 2 * len(shape) or min(pads, default=0) < 0:
        raise UnfitError("pads that do not fit")
    before, after = pads[: len(shape)], pads[len(shape) :]
    return tuple(map(sum, zip(before, shape, after, strict=True)))


def _reduce(given: Inputs, settings: Settings) -> Shape:
    shape = _first(given).shape
    axes = _axes(_said(given, 1), len(shape))
    if _flag(settings, "keepdims", 1):
        return tuple(1 if axis in axes else size for axis, size in enumerate(shape))
    return tuple(size for axis, size in enumerate(shape) if axis not in axes)


def _slice(given: Inputs, settings: Settings) -> Shape:
    sizes = list(_first(given).shape)
    first, last = _said(given, 1), _said(given, 2)
    named = _said(given, 3, tuple(range(len(first))))
    axes = [_axis(axis, len(sizes)) for axis in named]
    steps = _said(given, 4, (1,) * len(first))
    if len(set(axes)) != len(axes) or min(steps, default=1) < 1:
        raise UnfitError("an axis twice, or a step back")
    for axis, begin, end, step in zip(axes, first, last, steps, strict=True):
        size = len(range(*slice(begin, end, step).indices(sizes[axis])))
        # what is there from some row on alone is nothing while a graph is tried
        if sizes[axis] >= ROWS > size:
            raise UnfitError("rows in another number than are heard")
        sizes[axis] = size
    return tuple(sizes)


def _unsqueeze(given: Inputs, settings: Settings) -> Shape:
    shape = _first(given).shape
    said = _said(given, 1)
    axes = _axes(said, len(shape) + len(said))
    left = iter(shape)
    return tuple(1 if i in axes else next(left) for i in range(len(shape) + len(axes)))


_DECIMAL, _WHOLE, _TENSOR, _WHOLES = 1, 2, 4, 7
_CONV = dict.fromkeys(("dilations", "kernel_shape", "pads", "strides"), _WHOLES)
_ANY_TYPE = {"Cast", "Identity"}
RULES = {
    "Add": Rule(_elementwise, (2, 2), 2, {}),
    "Cast": Rule(_cast, (1, 1), 1, {"to": _WHOLE}),
    "Concat": Rule(_concat, (1, 100_000), 100_000, {"axis": _WHOLE}),
    "Constant": Rule(_same, (0, 0), 0, {"value": _TENSOR}),
    "Conv": Rule(_conv, (2, 3), 3, _CONV | {"group": _WHOLE}),
    "Flatten": Rule(_flatten, (1, 1), 1, {"axis": _WHOLE}),
    "Gemm": Rule(
        _gemm,
        (2, 3),
        3,
        {"alpha": _DECIMAL, "beta": _DECIMAL, "transA": _WHOLE, "transB": _WHOLE},
    ),
    "Identity": Rule(_same, (1, 1), 1, {}),
    "LeakyRelu": Rule(_same, (1, 1), 1, {"alpha": _DECIMAL}),
    "MatMul": Rule(_matmul, (2, 2), 2, {}),
    "Mul": Rule(_elementwise, (2, 2), 2, {}),
    "Pad": Rule(_pad, (2, 2), 1, {}),
    "ReduceSum": Rule(_reduce, (2, 2), 1, {"keepdims": _WHOLE}),
    "Relu": Rule(_same, (1, 1), 1, {}),
    "Slice": Rule(_slice, (3, 5), 1, {}),
    "Softmax": Rule(_softmax, (1, 1), 1, {"axis": _WHOLE}),
    "Tanh": Rule(_same, (1, 1), 1, {}),
    "Unsqueeze": Rule(_unsqueeze, (2, 2), 1, {}),
}
"""Allowed operators: those of feed-forward graphs such as `speech.export` writes.

There are no loops and no random numbers among them.
"""
