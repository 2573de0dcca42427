"""Figures: datasets drawn. Nothing is computed here."""
