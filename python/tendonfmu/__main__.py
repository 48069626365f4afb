"""Run `python -m tendonfmu` as the command `tendonfmu`."""

from tendonfmu.commands.program import main

main()
