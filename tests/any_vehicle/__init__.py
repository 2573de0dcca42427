"""Random vehicles of every kind against dense solutions: `python -m tests.any_vehicle --count 300`."""
