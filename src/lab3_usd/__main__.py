"""`python -m lab3_usd`: the same command as `lab3`."""

from lab3_usd.cli import run

if __name__ == "__main__":
    run()
