"""Bodies on a skeleton in bundles: their manifest entry, their file and its evaluation."""
