"""Folders of speech with captured motion, read for training and judging."""
