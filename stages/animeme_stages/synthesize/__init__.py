"""Turning phones into control curves."""
