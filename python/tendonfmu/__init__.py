"""Friction of tendon-driven robot fingers: check, build, run and more. The command line is `tendonfmu --help`."""

from importlib.metadata import version

__version__ = version("tendonfmu")
__all__ = ["__version__"]
