"""Exact alignment with PocketSphinx's acoustic model, in NumPy: features, scores, search, doubt."""
