"""The `gbufrt` command."""


def main() -> None:
    """Entry point."""
