"""What happens with calls, files and machines that are not as they should be: rows of docs/evidence/reliability.md."""
