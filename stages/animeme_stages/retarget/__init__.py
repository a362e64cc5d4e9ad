"""Turning control curves into a rig's shape curves."""
