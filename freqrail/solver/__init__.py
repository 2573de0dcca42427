"""RMS of responses over grids of vehicles and speeds, from a system reduced to blocks."""
