"""Judging what was made, one check per file."""
