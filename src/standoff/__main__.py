"""`python -m standoff`: the command line, for launchers that take a module, as torchrun does."""

from standoff.cli import main

if __name__ == "__main__":
    main()
