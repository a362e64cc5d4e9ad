"""Tracked lip points mapped to the controls of a character."""
