"""Hidden effects, changes and rivals: how often `diagnose` is right."""
