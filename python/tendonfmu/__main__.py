"""Run `python -m tendonfmu` as the command `tendonfmu`."""

from tendonfmu.cli import main

main()
