"""The graph of `speech.onnx`: what it may hold, which shapes it makes, and what it costs."""
