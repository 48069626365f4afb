"""How often does `diagnose --reference` name what has changed between two recordings, and how often a wrong change?"""

from __future__ import annotations

from evidence.change import encoders, simulated, trend

PARTS = {"simulated": simulated.PART, "encoders": encoders.PART, "trend": trend.PART}
