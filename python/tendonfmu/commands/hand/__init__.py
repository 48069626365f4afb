"""How a hand is checked, calibrated, run, scored and diagnosed: each of its fingers, with the wrist that they share.

`description` reads a hand, `recordings` splits its recording into those of its fingers and runs them, `commands` does
the rest, `page` shows the results, and `ssp` packs the FMUs.
"""
