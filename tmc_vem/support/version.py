"""The version of this program, alone, as everything may need it."""

VERSION = "0.1.0"
