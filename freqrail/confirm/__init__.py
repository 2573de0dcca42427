"""The time domain: points of a result held against simulations."""
