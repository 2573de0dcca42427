"""Results: labelled, on disk, read back."""
