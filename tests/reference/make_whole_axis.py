"""Mean squares over the whole axis with 50-digit arithmetic, the reference of tests/test_residues.py.

    python tests/reference/make_whole_axis.py > tests/reference/whole_axis.json      (about ten minutes)

Shares no code and no method with freqrail: the full ten-freedom equations of motion (eqs. 3 to 7) are solved
at every node of an integral over the real frequency axis, the wheels' lags summed in the response. mpmath's
tanh-sinh quadrature works between break points at the poles' frequencies, which are given only as places to
split at, widened geometrically to the peaks' widths; the tail is mapped to a finite interval.
"""
