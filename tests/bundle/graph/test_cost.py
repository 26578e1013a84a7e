"""What a graph takes is counted before a runtime sees it."""

import pytest

from ico3d.bundle.graph import cost as counting
from ico3d.bundle.graph.cost import Cost, Step, check_cost
from ico3d.bundle.graph.shapes import FLOAT, ROWS, Array
from ico3d.common.unpacking.protobuf import RefusedFieldError
from ico3d.speech.runtime import AFTER, BEFORE

SHAPE = (ROWS, 32)


def arrays(**shapes: tuple[int, ...]) -> dict[str, Array]:
    return {name: Array(FLOAT, shape) for name, shape in shapes.items()}


def checked(steps: list[Step], **shapes: tuple[int, ...]) -> Cost:
    return check_cost(steps, arrays(**shapes), "y", SHAPE)


def test_few_rows_are_those_of_the_shortest_run():
    assert BEFORE + 1 + AFTER == counting.FEW


def test_products_and_numbers_are_those_of_eight_rows():
    product = Step("MatMul", ("x", "w"), "y", {})
    assert checked([product], x=(ROWS, 5), w=(5, 32)) == Cost(8 * 32 * 5, 8 * 5 + 5 * 32 + 8 * 32)


def test_a_convolution_counts_sixteen_channels_at_least():
    steps = [Step("Conv", ("x", "w"), "c", {}), Step("Flatten", ("c",), "y", {})]
    found = checked(steps, x=(ROWS, 1, 34), w=(1, 1, 3))
    assert found.products == 8 * 32 * 3 * 16 + 8 * 4096
    assert found.numbers == 8 * 34 + 16 * 3 + 8 * 32 + 2 * 8 * 32


def test_each_picture_of_a_convolution_costs_something():
    """Runtimes begin anew for it: a million of one number take seconds."""
    steps = [Step("Conv", ("many", "w"), "c", {}), Step("Identity", ("x",), "y", {})]
    with pytest.raises(RefusedFieldError, match="more memory or time than a talk has"):
        checked(steps, x=SHAPE, many=(200_000, 1, 1), w=(1, 1, 1))


def test_a_weight_counts_for_each_operator_that_takes_it():
    """Runtimes copied one of ten megabytes for each of twenty: four gigabytes."""
    steps = [Step("Add", ("x", "w"), "y0", {})]
    steps += [Step("Mul", (f"y{i}", "w"), f"y{i + 1}", {}) for i in range(9)]
    steps.append(Step("Identity", ("y9",), "y", {}))
    assert checked(steps, x=SHAPE, w=(1, 32)).numbers == 10 * (256 + 32 + 256) + 512


@pytest.mark.parametrize("what", ["MOST_PRODUCTS", "MOST_NUMBERS"])
def test_what_takes_too_much_is_refused(monkeypatch, what):
    step = Step("MatMul", ("x", "w"), "y", {})
    monkeypatch.setattr(counting, what, 1279 if what == "MOST_PRODUCTS" else 455)
    with pytest.raises(RefusedFieldError, match="more memory or time than a talk has"):
        checked([step], x=(ROWS, 5), w=(5, 32))
    monkeypatch.setattr(counting, what, 1280 if what == "MOST_PRODUCTS" else 456)
    checked([step], x=(ROWS, 5), w=(5, 32))


def test_a_graph_gives_32_values_for_each_row():
    for shape in [(ROWS, 7), (ROWS + 1, 32), (8, 32), (ROWS, 32, 1)]:
        with pytest.raises(RefusedFieldError, match="does not give 32 values for each row"):
            checked([Step("Relu", ("x",), "y", {})], x=shape)


def test_names_are_given_once_and_before_they_are_used():
    relu = Step("Relu", ("x",), "y", {})
    for steps in ([relu, relu], [Step("Relu", ("z",), "y", {})], [Step("Relu", ("x",), "", {})]):
        with pytest.raises(ValueError, match="a name"):
            checked(steps, x=SHAPE)
