"""Adding animation to assets."""
