"""Bodies on a skeleton in bundles: manifest entry, file, gestures, and evaluation in numpy."""
