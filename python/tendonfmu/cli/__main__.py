"""Run `python -m tendonfmu.cli` as the command `tendonfmu`."""

from tendonfmu.cli.program import main

main()
