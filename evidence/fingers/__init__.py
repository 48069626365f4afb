"""Simulated fingers: foreign ones, and the matched rig; what goes wrong with their recordings."""
