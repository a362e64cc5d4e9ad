"""The built-in stages, registered through the same entry points as a studio's."""
