"""Judging what somebody delivered, one check per file."""
