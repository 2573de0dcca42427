"""`python -m freqrail`, the same as `freqrail`."""

from freqrail.cli import main

main()
