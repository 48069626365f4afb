"""What the project's figures come from: each module holds the cases of one bench and writes its table."""
