from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

__version__: str

class NorthFinderError(Exception):
    #: What the command wrote before it refused: of `run` its JSON, of the functions of the package a Result; None where it wrote nothing.
    result: Any

def run(arguments: list[str]) -> str: ...
def columns(path: str | PathLike[str]) -> dict[str, NDArray[Any]]: ...
