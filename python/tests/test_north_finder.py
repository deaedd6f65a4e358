"""The package against the command: the same names, digits and errors."""

import json
import os
import shutil
import signal
import subprocess
import threading
import time
from pathlib import Path

import nbformat
import numpy as np
import pandas
import polars
import pytest
from nbclient import NotebookClient

import north_finder
from north_finder import NorthFinderError

#: The command, built from the same sources.
NORTH = os.environ["NORTH"]


def command(*arguments: str) -> dict:
    done = subprocess.run([NORTH, *arguments, "--json", "-"], capture_output=True, check=True, text=True)
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("campaigns") / "unit-7"
    rows = north_finder.simulate(folder, scenario="air-conditioning", runs=6, seed=3)
    assert len(rows) == len(rows["t_s"])
    return folder


def test_solve_gives_the_digits_of_the_command(campaign: Path) -> None:
    assert north_finder.solve(campaign) == command("solve", str(campaign))


def test_diagnose_gives_the_digits_of_the_command(campaign: Path, tmp_path: Path) -> None:
    ours = north_finder.diagnose(campaign, model_out=tmp_path / "ours.toml")
    theirs = command("diagnose", str(campaign), "--model-out", str(tmp_path / "theirs.toml"))
    assert ours == theirs
    assert (tmp_path / "ours.toml").read_text() == (tmp_path / "theirs.toml").read_text()
    model = tmp_path / "ours.toml"
    assert north_finder.solve(campaign, model) == command("solve", str(campaign), "--model", str(model))


def test_a_fleet_gives_the_digits_of_the_command(campaign: Path, tmp_path: Path) -> None:
    ours = north_finder.fleet_learn([campaign], tmp_path / "f.toml")
    assert ours.units == 1 and ours.unit[0].name == "unit-7"
    prior = str(tmp_path / "f.toml")
    assert north_finder.diagnose(campaign, fleet=prior) == command("diagnose", str(campaign), "--fleet", prior)


def test_columns_are_arrays_that_data_frames_take(campaign: Path) -> None:
    rows = north_finder.read(campaign)
    assert rows["t_s"].dtype == np.float64 and rows["fog_arcsec"].flags.owndata is not None
    assert list(np.unique(rows["run"])) == list(range(6))
    assert pandas.DataFrame(rows).shape == rows.polars().shape == polars.DataFrame(dict(rows)).shape
    solved = north_finder.solve(campaign)
    table = solved.table("runs")
    assert len(table) == 6 and table["azimuth_deg"].dtype == np.float64
    assert solved.runs[0].azimuth_deg == table["azimuth_deg"][0] == table.pandas().azimuth_deg[0]


def test_arrays_of_a_run_give_the_digits_of_its_file(campaign: Path) -> None:
    rows = north_finder.read(campaign)
    first = rows["run"] == 0
    # What was not recorded is NaN in the rows, and no column of the run.
    names = ("t_s", "index_deg", "fog_arcsec", "temp_c", "ax_g", "ay_g", "level_temp_c", "lost_frames")
    run = {name: rows[name][first] for name in names} | {"level_temp_c": np.full(first.sum(), np.nan)}
    of_arrays = north_finder.solve(run, latitude=45.0)
    with pytest.raises(ValueError, match="equal length"):
        north_finder.solve({"t_s": [1.0, 2.0], "index_deg": [0.0]}, latitude=45.0)
    azimuths = [run.azimuth_deg for run in of_arrays.runs]
    assert len(azimuths) == 1 and 0.0 <= azimuths[0] < 360.0


def test_errors_are_the_sentences_of_the_command(tmp_path: Path) -> None:
    missing = tmp_path / "nothing.toml"
    done = subprocess.run([NORTH, "solve", str(missing)], capture_output=True, text=True)
    with pytest.raises(NorthFinderError) as raised:
        north_finder.solve(missing)
    assert done.returncode == 1 and done.stderr.strip() == f"north: {raised.value}"
    with pytest.raises(NorthFinderError, match="--latitude"):
        north_finder.align(missing, latitude=91.0)
    with pytest.raises(AttributeError, match="it has azimuth"):
        north_finder.Result(azimuth_deg=1.0).heading


def test_the_results_of_the_other_runs_stay_where_one_is_refused(campaign: Path, tmp_path: Path) -> None:
    copy = tmp_path / "one-refused"
    shutil.copytree(campaign, copy)
    (copy / "runs" / "002.csv").write_text("t_s,index_deg,fog_arcsec\n")
    with pytest.raises(NorthFinderError, match="1 of 6 runs refused") as raised:
        north_finder.solve(copy)
    done = subprocess.run([NORTH, "solve", str(copy), "--json", "-"], capture_output=True, text=True)
    assert done.returncode == 1 and raised.value.result == json.loads(done.stdout)
    azimuths = [run.get("azimuth_deg") for run in raised.value.result.runs]
    assert len(azimuths) == 6 and [number for number, azimuth in enumerate(azimuths) if azimuth is None] == [1]
    with pytest.raises(NorthFinderError) as raised:
        north_finder.solve(tmp_path / "nothing.toml")
    assert raised.value.result is None


def test_commands_of_several_threads_run_one_after_the_other(campaign: Path, tmp_path: Path) -> None:
    kept = tmp_path / "kept.toml"
    kept.write_text("kept")
    refused = []

    def without_force() -> None:
        with pytest.raises(NorthFinderError, match="nothing is overwritten"):
            north_finder.diagnose(campaign, model_out=kept)
        refused.append(kept.read_text())

    def with_force(number: int) -> None:
        north_finder.diagnose(campaign, model_out=tmp_path / f"{number}.toml", force=True)

    threads = [threading.Thread(target=with_force, args=(number,)) for number in range(2)]
    threads += [threading.Thread(target=without_force) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert refused == ["kept", "kept"]
    assert (tmp_path / "0.toml").read_text() == (tmp_path / "1.toml").read_text()


def test_other_threads_work_meanwhile_and_an_interrupt_ends_a_call(tmp_path: Path) -> None:
    ticks = []
    stop = threading.Event()

    def tick() -> None:
        while not stop.wait(0.01):
            ticks.append(time.monotonic())

    ticker = threading.Thread(target=tick)
    ticker.start()
    interrupter = threading.Timer(1.0, lambda: os.kill(os.getpid(), signal.SIGINT))
    interrupter.start()
    with pytest.raises(KeyboardInterrupt):
        north_finder.simulate(tmp_path / "endless", runs=100000, raw=True)
    stop.set()
    ticker.join()
    # A tick is late on a busy machine, not missing: of the hundred in a second ten are enough to tell that the lock was free.
    assert len(ticks) > 10
    # The next call is not interrupted.
    assert len(north_finder.simulate(tmp_path / "short", runs=1)) > 0


def test_the_notebook_runs(tmp_path: Path) -> None:
    path = Path(__file__).parent.parent / "examples" / "loop.ipynb"
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
