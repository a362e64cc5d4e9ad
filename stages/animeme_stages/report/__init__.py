"""Telling people and programs how a run went."""
