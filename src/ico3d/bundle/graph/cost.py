"""What a `speech.onnx` costs a runtime, found before one sees it.

A run of the graph in silence would show it too late: a single operator may take gigabytes or hours,
and cannot be ended.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ico3d.bundle.graph.shapes import (
    FLOAT,
    ROWS,
    Array,
    HeardError,
    Inputs,
    Settings,
    Shape,
    UnfitError,
    output,
)
from ico3d.common.unpacking.protobuf import RefusedFieldError

FEW = 8
"""Rows of the shortest run. What takes so much for them takes at most twice for sixteen, and so on,
as `shapes` has no powers of the number of rows."""
MOST_PRODUCTS = 1 << 29
"""Multiplications of a run of `FEW` rows: 0.1 s of a core; ours have 0.06 · 10⁹."""
MOST_NUMBERS = 1 << 24
"""Numbers that all operators of such a run take and give: 64 MiB. A weight counts for each operator
that takes it, as runtimes copy it for each into the order that suits them, outside of the memory
that is bounded. Without such optimising a run takes twice as long."""
_PICTURE = 1 << 12
"""Multiplications that each picture of a convolution costs at least: runtimes begin anew for it."""
_LANES = 16
"""Channels that runtimes compute, and store the weights of, at once: fewer cost as much."""


@dataclass(frozen=True)
class Step:
    """An operator in a graph.

    Attributes:
        operator: Its name.
        inputs: Names of what it takes; empty for an input that is left out.
        output: Name of what it makes.
        settings: Its attributes; that of a `Constant` is an `Array`.
    """

    operator: str
    inputs: tuple[str, ...]
    output: str
    settings: Settings


@dataclass
class Cost:
    """What a run of `FEW` rows takes.

    Attributes:
        products: Multiplications.
        numbers: Numbers that operators take and give.
    """

    products: int = 0
    numbers: int = 0


def check_cost(steps: list[Step], known: Mapping[str, Array], result: str, shape: Shape) -> Cost:
    """Checks that a graph makes what it should, of something like what ours take.

    Args:
        steps: The operators in their order.
        known: Weights and inputs by name.
        result: Name of the graph's output.
        shape: Its shape.

    Raises:
        RefusedFieldError: If it does not, or its shapes depend on what is heard.
        ValueError: If a name is given twice, or used before it is given.
    """
    arrays, cost = dict(known), Cost()
    for step in steps:
        if not step.output or step.output in arrays:
            raise ValueError("a name that is given twice")
        if not arrays.keys() >= {name for name in step.inputs if name}:
            raise ValueError("a name that is not given yet")
        given = [arrays[name] if name else None for name in step.inputs]
        arrays[step.output] = made = _made(step, given)
        _count(step.operator, given, made, cost)
        if cost.products > MOST_PRODUCTS or cost.numbers > MOST_NUMBERS:
            raise RefusedFieldError("takes more memory or time than a talk has")
    if result not in arrays or (arrays[result].kind, arrays[result].shape) != (FLOAT, shape):
        raise RefusedFieldError(f"does not give {shape[-1]} values for each row")
    return cost


def _made(step: Step, given: Inputs) -> Array:
    try:
        return output(step.operator, given, step.settings)
    except HeardError as error:
        raise RefusedFieldError("makes its shapes of what it hears") from error
    except UnfitError as error:
        raise RefusedFieldError(f"has an operator {step.operator} with {error}") from error
    except (ValueError, LookupError, TypeError) as error:
        raise RefusedFieldError(f"has an operator {step.operator} that fits nothing") from error


def _count(operator: str, given: Inputs, made: Array, cost: Cost) -> None:
    """Adds what an operator takes."""
    taken = [array.shape for array in given if array is not None]
    found = [*taken, made.shape]
    if operator == "Conv":
        # runtimes fill the channels of weights up
        wide = found[1] = (math.ceil(taken[1][0] / _LANES) * _LANES, *taken[1][1:])
        cost.products += _numbers((made.shape[0], *made.shape[2:])) * _numbers(wide)
        cost.products += _numbers(made.shape[:1]) * _PICTURE
    elif operator in ("Gemm", "MatMul"):
        cost.products += _numbers(made.shape) * taken[0][-1]
    cost.numbers += sum(map(_numbers, found))


def _numbers(shape: Shape) -> int:
    """How many numbers an array of some shape has in a run of `FEW` rows."""
    return math.prod(size - ROWS + FEW if size >= ROWS else size for size in shape)
