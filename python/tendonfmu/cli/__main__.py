"""`python -m tendonfmu.cli` is the command `tendonfmu`."""

from tendonfmu.cli.program import main

main()
