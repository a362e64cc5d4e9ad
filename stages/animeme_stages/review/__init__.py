"""Pages on which a person sees and hears lines: what is in them, and how they are written."""
