"""Fingers by seed that share no code and no friction law with the product: they judge it."""
