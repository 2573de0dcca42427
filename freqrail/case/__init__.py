"""Text to SI: quantities, axes, the tables of a case file, the checked case."""
