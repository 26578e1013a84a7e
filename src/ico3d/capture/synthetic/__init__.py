"""Synthetic people: a mesh that speaks, a studio that records it, and the reader of the result."""

from ico3d.capture.synthetic.reader import SyntheticCapture

__all__ = ["SyntheticCapture"]
