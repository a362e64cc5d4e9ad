"""Finding when each phone is spoken."""
