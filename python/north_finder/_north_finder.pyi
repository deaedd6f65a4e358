from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

__version__: str

class NorthFinderError(Exception): ...

def run(arguments: list[str]) -> str: ...
def columns(path: str | PathLike[str]) -> dict[str, NDArray[Any]]: ...
