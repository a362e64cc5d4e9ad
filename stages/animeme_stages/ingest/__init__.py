"""Reading recordings, transcripts and characters."""
