"""The diagnosis of many campaigns on a cluster of two local workers: the same as on one machine, and nothing is lost with a worker."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import north_finder

ray = pytest.importorskip("ray", reason="Ray is not installed: pip install 'north-finder[fleet]'")
parquet = pytest.importorskip("pyarrow.parquet")

EXAMPLE = Path(__file__).parents[2] / "examples" / "fleet_ray.py"


@pytest.fixture(scope="module")
def campaigns(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fleet")
    for number in range(4):
        north_finder.simulate(folder / f"unit-{number}", scenario="air-conditioning", runs=8, seed=number)
    return folder


@pytest.fixture(scope="module")
def on_one_machine(campaigns: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("one-machine")
    table = folder / "table.parquet"
    north_finder.fleet_diagnose(campaigns, folder / "results", table=table)
    return folder / "results", table


@pytest.fixture
def cluster():
    """Two workers of one processor each, which are nodes of their own."""
    cluster_utils = pytest.importorskip("ray.cluster_utils")
    cluster = cluster_utils.Cluster(initialize_head=True, head_node_args={"num_cpus": 0})
    nodes = [cluster.add_node(num_cpus=1) for _ in range(2)]
    yield cluster, nodes
    ray.shutdown()
    cluster.shutdown()


def begun(campaigns: Path, results: Path, table: Path, address: str) -> subprocess.Popen:
    arguments = [str(campaigns), str(results), "--table", str(table), "--address", address]
    return subprocess.Popen([sys.executable, str(EXAMPLE), *arguments], stdout=subprocess.PIPE, text=True)


def ended(campaigns: Path, results: Path, *options: str) -> subprocess.CompletedProcess:
    arguments = [str(campaigns), str(results), *options]
    return subprocess.run([sys.executable, str(EXAMPLE), *arguments], capture_output=True, text=True, timeout=600)


def same(ours: Path, theirs: Path) -> None:
    for result in sorted(theirs.glob("unit-*")):
        assert (ours / result.name).read_bytes() == result.read_bytes(), result.name


def test_a_cluster_gives_the_results_of_one_machine_and_loses_nothing(campaigns, on_one_machine, cluster, tmp_path) -> None:
    theirs, their_table = on_one_machine
    (cluster, nodes), results, table = cluster, tmp_path / "results", tmp_path / "table.parquet"
    run = begun(campaigns, results, table, cluster.address)
    # Once the first campaign is done a worker goes, with what it is at.
    while not list(results.glob("unit-*.json")):
        assert run.poll() is None
        time.sleep(0.1)
    cluster.remove_node(nodes[0], allow_graceful=False)
    assert run.wait(timeout=600) == 0
    same(results, theirs)
    assert parquet.read_table(table).equals(parquet.read_table(their_table))


def test_a_run_that_was_ended_goes_on(campaigns, on_one_machine, cluster, tmp_path) -> None:
    theirs, _ = on_one_machine
    (cluster, _), results, table = cluster, tmp_path / "results", tmp_path / "table.parquet"
    run = begun(campaigns, results, table, cluster.address)
    while not list(results.glob("unit-*.json")):
        assert run.poll() is None
        time.sleep(0.1)
    os.kill(run.pid, signal.SIGKILL)
    run.wait()
    done = {path: path.stat().st_mtime_ns for path in results.glob("unit-*.json")}
    again = begun(campaigns, results, table, cluster.address)
    said, _ = again.communicate(timeout=600)
    assert again.returncode == 0 and not said.startswith("4 campaigns, 0 of them done before")
    assert all(path.stat().st_mtime_ns == when for path, when in done.items())
    same(results, theirs)


def test_a_refusal_names_the_campaign_where_it_is_and_is_tried_again(cluster, tmp_path) -> None:
    (cluster, _), units, results, table = cluster, tmp_path / "units", tmp_path / "results", tmp_path / "table.parquet"
    north_finder.simulate(units / "unit-1", runs=2)
    (units / "unit-2").mkdir()
    (units / "unit-2" / "campaign.toml").write_text("format = \n")
    for before in (0, 1):
        run = ended(units, results, "--table", str(table), "--address", cluster.address)
        assert run.returncode == 0 and f"2 campaigns, {before} of them done before" in run.stdout, run.stderr
    refused = json.loads((results / "unit-2.json").read_text())["refused"]
    assert refused.startswith(f"{units / 'unit-2' / 'campaign.toml'}, line 1"), refused
    north_finder.fleet_diagnose(units, tmp_path / "theirs", table=tmp_path / "theirs.parquet")
    same(results, tmp_path / "theirs")
    assert parquet.read_table(table).equals(parquet.read_table(tmp_path / "theirs.parquet"))
    assert json.loads((results / "made-with.json").read_text()) == json.loads((tmp_path / "theirs" / "made-with.json").read_text())


def test_a_task_that_fails_does_not_keep_the_others(cluster, tmp_path) -> None:
    (cluster, _), units, table = cluster, tmp_path / "units", tmp_path / "table.parquet"
    # No campaign may have this name.
    for name in ("made-with", "unit-1"):
        north_finder.simulate(units / name, runs=2)
    run = ended(units, tmp_path / "results", "--table", str(table), "--address", cluster.address)
    assert run.returncode == 1 and "a campaign of this name has no results" in run.stderr, run.stderr
    assert parquet.read_table(table)["campaign"].to_pylist() == ["unit-1"]


def test_nothing_is_begun_without_campaigns_or_with_another_fleet(campaigns, on_one_machine, tmp_path) -> None:
    results, _ = on_one_machine
    run = ended(tmp_path, tmp_path / "results")
    assert run.returncode == 1 and f"no campaign below {tmp_path}" in run.stderr
    (tmp_path / "fleet.toml").write_text("another")
    run = ended(campaigns, results, "--fleet", str(tmp_path / "fleet.toml"))
    assert run.returncode == 1 and "another version or another fleet" in run.stderr


def test_the_queries_of_the_documents_run(on_one_machine, tmp_path, monkeypatch) -> None:
    duckdb = pytest.importorskip("duckdb")
    _, table = on_one_machine
    text = (EXAMPLE.parents[1] / "docs" / "fleet.md").read_text()
    queries = text.split("```sql\n")[1].split("```")[0].replace("results.parquet", str(table))
    effects, outsiders = (duckdb.sql(query).fetchall() for query in queries.strip().rstrip(";").split(";\n"))
    assert any(effect for effect, *_ in effects)
    assert len(outsiders) <= 4
