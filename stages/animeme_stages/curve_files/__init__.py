"""Curve files: Live Link Face CSV, plain CSV, JSON and NPZ, out and in."""
