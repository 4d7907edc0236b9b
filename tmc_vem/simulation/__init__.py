"""One run: options, what it writes, and how it is interrupted and resumed."""
