"""Gyro north finding: the commands of ``north`` as functions.

Every function runs the command itself: results have the names of its JSON and all its digits, errors are
:class:`NorthFinderError` with its sentence. Its attribute ``result`` is the :class:`Result` that the command wrote before it
refused, None where it wrote nothing. An interrupt ends a call, and other threads of Python work meanwhile; their calls wait,
for one command runs at a time.
"""

from __future__ import annotations

import csv
import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ._north_finder import NorthFinderError, __version__
from ._north_finder import columns as _columns
from ._north_finder import run as _call

__all__ = [
    "NorthFinderError",
    "Result",
    "Table",
    "__version__",
    "align",
    "calibrate",
    "diagnose",
    "fleet_diagnose",
    "fleet_learn",
    "read",
    "simulate",
    "solve",
]

PathLike = str | os.PathLike[str]


class Result(dict[str, Any]):
    """A JSON object whose fields are attributes, too; lists of objects are tables by :meth:`table`."""

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"the result has no {name}; it has {', '.join(self)}") from None

    def table(self, name: str) -> Table:
        """The list ``name``, of objects, as columns; None where an object has no such field."""
        rows = self[name]
        names = list(dict.fromkeys(field for row in rows for field in row))
        return Table({field: _column(rows, field) for field in names})


class Table(dict[str, np.ndarray]):
    """Columns of equal length: ``pandas.DataFrame(table)`` and ``polars.DataFrame(table)`` take it as it is."""

    def __len__(self) -> int:
        return len(next(iter(self.values()))) if self.keys() else 0

    def pandas(self) -> Any:
        """As a data frame of pandas, which must be there."""
        import pandas

        return pandas.DataFrame(dict(self))

    def polars(self) -> Any:
        """As a data frame of polars, which must be there."""
        import polars

        return polars.DataFrame(dict(self))


def _column(rows: Sequence[Mapping[str, Any]], field: str) -> np.ndarray:
    # Filled one by one: of lists of equal length numpy would make a matrix.
    column = np.empty(len(rows), dtype=_type(rows, field))
    for place, row in enumerate(rows):
        column[place] = row.get(field)
    return column


def _type(rows: Sequence[Mapping[str, Any]], field: str) -> Any:
    values = [row.get(field) for row in rows]
    if all(isinstance(value, bool) for value in values):
        return bool
    return float if all(value is None or type(value) in (int, float) for value in values) else object


def read(path: PathLike) -> Table:
    """The rows of all runs of a campaign (its folder or its ``campaign.toml``).

    Columns: ``run`` (number of the run, from 0), ``latitude_deg``, ``reference_azimuth_deg``, ``t_s``, ``index_deg``,
    ``fog_arcsec``, ``temp_c``, ``ax_g``, ``ay_g``, ``level_temp_c``, ``lost_frames``, and the further channels by their
    names. NaN where a row has no value.
    """
    return Table(_columns(os.fspath(path)))


def solve(
    campaign: PathLike | Mapping[str, ArrayLike],
    model: PathLike | None = None,
    *,
    latitude: float | None = None,
    settings: PathLike | None = None,
) -> Result:
    """Azimuths of the runs of a campaign, of a run in a CSV file, or of one run as columns.

    ``campaign``: a path, or a mapping of the columns of a run (``t_s``, ``index_deg``, ``fog_arcsec`` and, where they
    were measured, ``temp_c``, ``ax_g``, ``ay_g``, ``level_temp_c``), arrays of equal length; one that is NaN throughout is not
    recorded. A bare run needs ``latitude``, degrees.

    Where a run is refused, the ``result`` of the error has the azimuths of the others, and why this one has none.
    """
    options = {"model": model, "latitude": latitude, "settings": settings}
    if not isinstance(campaign, Mapping):
        return _result(["solve", os.fspath(campaign)], options)
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run.csv"
        _write(run, campaign)
        return _result(["solve", str(run)], options)


def diagnose(
    campaign: PathLike,
    *,
    fleet: PathLike | None = None,
    model: PathLike | None = None,
    model_out: PathLike | None = None,
    report: PathLike | None = None,
    settings: PathLike | None = None,
    leave_one_out: bool = False,
    force: bool = False,
) -> Result:
    """What the error model of an instrument lacks, learned from a campaign: the verdict of ``north diagnose``.

    ``fleet`` is what the instruments of its type have in common, from :func:`fleet_learn`. ``model_out`` and ``report`` are
    files to write; with ``force`` they replace what is there.
    """
    options = {"fleet": fleet, "model": model, "model-out": model_out, "report": report, "settings": settings}
    flags = {"leave-one-out": leave_one_out, "force": force}
    return _result(["diagnose", os.fspath(campaign)], options, flags)


def fleet_learn(
    units: PathLike | Sequence[PathLike], out: PathLike, *, threads: int | None = None, force: bool = False
) -> Result:
    """What the units of one type have in common, learned from their campaigns or model files and written to ``out``.

    ``units``: paths of campaigns, of model files, or of folders of them.
    """
    return _result(["fleet", "learn", *_paths(units)], {"out": out, "threads": threads}, {"force": force})


def fleet_diagnose(
    campaigns: PathLike | Sequence[PathLike],
    results: PathLike,
    *,
    fleet: PathLike | None = None,
    table: PathLike | None = None,
    threads: int | None = None,
    force: bool = False,
) -> Result:
    """Diagnoses campaigns into the folder ``results``, each on a thread; what is done there is not done again.

    A campaign NAME has the results NAME.json and NAME.toml (its model); ``table`` is a Parquet file with a row for each.
    """
    options = {"results": results, "fleet": fleet, "table": table, "threads": threads}
    return _result(["fleet", "diagnose", *_paths(campaigns)], options, {"force": force})


def align(
    recording: PathLike,
    *,
    latitude: float | str,
    model: PathLike | None = None,
    window: float | None = None,
    arw: float | None = None,
    bias: float | None = None,
    reference: float | None = None,
    report: PathLike | None = None,
    force: bool = False,
) -> Result:
    """Heading and levels of a recorded three-axis block; ``latitude`` in degrees, or ``"unknown"``."""
    options = {
        "latitude": latitude,
        "model": model,
        "window": window,
        "arw": arw,
        "bias": bias,
        "reference": reference,
        "report": report,
    }
    return _result(["align", os.fspath(recording)], options, {"force": force})


def calibrate(kind: str, path: PathLike, *, force: bool = False, **options: Any) -> Result:
    """A calibration: ``kind`` is ``"six-position"``, ``"ellipsoid"`` or ``"accelerometer-six-position"``.

    ``options`` are those of ``north calibrate KIND``, with ``_`` for ``-``: ``latitude=34.75, model_out="m.toml"``.
    """
    named = {name.replace("_", "-"): value for name, value in options.items()}
    return _result(["calibrate", kind, os.fspath(path)], named, {"force": force})


def simulate(
    out: PathLike, *, scenario: str = "calm-bench", runs: int = 8, seed: int = 1, raw: bool = False
) -> Table:
    """Writes a simulated campaign of a built-in scenario, or of a scenario's file, to the folder ``out``; gives its rows.

    Fixes that end without an azimuth are an error; the campaign is written all the same, and :func:`read` gives its rows.
    """
    options = {"out": out, "scenario": scenario, "runs": runs, "seed": seed}
    _run(_words(["simulate"], options, {"raw": raw}))
    return read(out)


def _paths(paths: PathLike | Sequence[PathLike]) -> list[str]:
    given = [paths] if isinstance(paths, (str, os.PathLike)) else paths
    return [os.fspath(path) for path in given]


def _words(command: list[str], options: Mapping[str, Any], flags: Mapping[str, bool] | None = None) -> list[str]:
    given = [f"--{name}={_word(value)}" for name, value in options.items() if value is not None]
    return command + given + [f"--{name}" for name, value in (flags or {}).items() if value]


def _word(value: Any) -> str:
    # repr keeps every digit of a number.
    return repr(float(value)) if isinstance(value, (float, np.floating)) else os.fspath(value) if isinstance(value, os.PathLike) else str(value)


def _run(words: list[str]) -> str:
    try:
        return _call(words)
    except NorthFinderError as refusal:
        if refusal.result is not None:
            refusal.result = _parsed(refusal.result)
        raise


def _parsed(text: str) -> Result:
    result: Result = json.loads(text, object_hook=Result)
    return result


def _result(command: list[str], options: Mapping[str, Any], flags: Mapping[str, bool] | None = None) -> Result:
    return _parsed(_run(_words(command, options, flags) + ["--json=-"]))


def _write(path: Path, columns: Mapping[str, ArrayLike]) -> None:
    arrays = {name: np.asarray(values, dtype=float) for name, values in columns.items()}
    lengths = {name: values.shape for name, values in arrays.items()}
    if any(len(shape) != 1 for shape in lengths.values()) or len(set(lengths.values())) > 1:
        raise ValueError(f"the columns of a run are arrays of one dimension and of equal length; these are {lengths}")
    # A number that was not recorded is NaN, which no file of a run has.
    recorded = {name: values for name, values in arrays.items() if values.size == 0 or not np.isnan(values).all()}
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(recorded)
        writer.writerows(zip(*(map(repr, values.tolist()) for values in recorded.values())))
