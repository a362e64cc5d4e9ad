"""Sculpts the sample characters from code and writes them as glTF and USD."""
