"""`python -m freqrail`, the same as `freqrail`."""

from freqrail.cli.commands import main

main()
