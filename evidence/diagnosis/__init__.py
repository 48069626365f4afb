"""Hidden effects and changes: how often `diagnose` is right."""
