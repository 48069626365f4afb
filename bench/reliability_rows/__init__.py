"""The rows of docs/evidence/reliability.md, for bench/reliability.py; the programs in C that they compile."""
