"""Where the data files live: beside the package in a wheel, at the top level of a checkout."""

from pathlib import Path

PACKAGE = Path(__file__).resolve().parent


def data_folder(name: str) -> Path:
    """Return the folder `name` (`graphs`, `maps`, `schema`) of this installation.

    A wheel carries the folders inside the package; an editable install finds them at the top
    level of the checkout.

    Raises:
        FileNotFoundError: the installation carries no such folder.
    """
    for folder in (PACKAGE / "_data" / name, PACKAGE.parents[1] / name):
        if folder.is_dir():
            return folder
    message = f"lab3-usd is installed without its folder '{name}'; install it again"
    raise FileNotFoundError(message)
