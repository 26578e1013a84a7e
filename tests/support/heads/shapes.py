"""Sizes of head models that tests make by hand."""

from ico3d.head.model import HeadShape, Variant


def head_shape(expression_size: int, variant: Variant = "full", **changes) -> HeadShape:
    """A shape with the paper's widths, but for what is changed."""
    widths = {"features": 32, "hidden": 64, "frequencies": 6}
    return HeadShape(expression_size, variant, **(widths | changes))
