"""How a hand is checked, calibrated, run, scored and diagnosed: each of its fingers, with the wrist that they share.

`description` reads a hand, `recordings` splits its recording into those of its fingers and runs them, `commands` does
the rest, and `results` shows the results and packs the FMUs.
"""
