"""The diagnosis of many campaigns on a cluster: one task each, by Ray.

    pip install ray pyarrow fsspec ./python
    python examples/fleet_ray.py CAMPAIGNS RESULTS [--fleet F.toml] [--table T.parquet] [--address auto]

CAMPAIGNS and RESULTS are folders, or addresses that fsspec knows (s3://…, gs://…, memory is not shared between processes).
Below CAMPAIGNS every folder with a campaign.toml is one; in RESULTS each has NAME.json and NAME.toml, as from
`north fleet diagnose`, byte for byte, and NAME.parquet, its row of the table. A campaign whose three results are there is
not diagnosed again: a run that was ended goes on, and a task whose worker died is begun anew by Ray, elsewhere.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

import fsspec
import pyarrow
import pyarrow.parquet
import ray

import north_finder

#: Results of one campaign, the last of which says that all are there.
ENDINGS = ("toml", "parquet", "json")


def diagnose(campaign: str, results: str, fleet: bytes | None) -> str:
    """Diagnoses one campaign on one thread and stores its results; gives its name."""
    name = campaign.rstrip("/").rsplit("/", 1)[-1]
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        source, _ = fsspec.url_to_fs(campaign)
        source.get(campaign.rstrip("/") + "/", f"{here / 'campaigns' / name}/", recursive=True)
        prior = here / "fleet.toml" if fleet is not None else None
        if prior is not None:
            prior.write_bytes(fleet)
        table = here / f"{name}.parquet"
        north_finder.fleet_diagnose(here / "campaigns" / name, here / "results", fleet=prior, table=table, threads=1)
        made = {"parquet": table, "json": here / "results" / f"{name}.json", "toml": here / "results" / f"{name}.toml"}
        for ending in ENDINGS:
            # A campaign that cannot be diagnosed has no model.
            if made[ending].exists():
                store(made[ending].read_bytes(), f"{results}/{name}.{ending}")
    return name


def store(content: bytes, address: str) -> None:
    """Stores a file that appears as a whole: object stores do so by themselves, other file systems by renaming."""
    system, path = fsspec.url_to_fs(address)
    system.makedirs(path.rsplit("/", 1)[0], exist_ok=True)
    system.pipe_file(f"{path}.part", content)
    system.mv(f"{path}.part", path)


def campaigns(root: str) -> list[str]:
    """Addresses of the campaigns below a folder, in the order of their names."""
    system, path = fsspec.url_to_fs(root)
    manifests = system.glob(f"{path.rstrip('/')}/*/campaign.toml")
    return [system.unstrip_protocol(manifest.rsplit("/", 1)[0]) for manifest in sorted(manifests)]


def names(addresses: list[str]) -> list[str]:
    return [address.rsplit("/", 1)[-1] for address in addresses]


def missing(all_campaigns: list[str], results: str) -> list[str]:
    """Those that have no result yet."""
    system, path = fsspec.url_to_fs(results)
    done = {found.rsplit("/", 1)[-1] for found in system.glob(f"{path}/*.json")}
    return [address for address, name in zip(all_campaigns, names(all_campaigns)) if f"{name}.json" not in done]


def on_the_cluster(addresses: list[str], results: str, fleet: bytes | None) -> Iterator[str]:
    """Names of the campaigns as they are done. No more tasks wait than twice as many as there are processors."""
    task = ray.remote(num_cpus=1, max_retries=3)(diagnose)
    most = 2 * int(ray.cluster_resources().get("CPU", 1))
    prior = ray.put(fleet)
    waiting: list[ray.ObjectRef] = []
    for address in addresses:
        waiting.append(task.remote(address, results, prior))
        if len(waiting) >= most:
            done, waiting = ray.wait(waiting)
            yield from ray.get(done)
    while waiting:
        done, waiting = ray.wait(waiting)
        yield from ray.get(done)


def write_table(all_names: list[str], results: str, table: str) -> None:
    """The rows of all campaigns as one Parquet file, one group of rows each."""
    system, path = fsspec.url_to_fs(results)
    out, target = fsspec.url_to_fs(table)
    writer = None
    with out.open(target, "wb") as file:
        for name in all_names:
            with system.open(f"{path}/{name}.parquet", "rb") as row:
                rows = pyarrow.parquet.read_table(row)
            writer = writer or pyarrow.parquet.ParquetWriter(file, rows.schema)
            writer.write_table(rows)
        if writer is not None:
            writer.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("campaigns")
    parser.add_argument("results")
    parser.add_argument("--fleet", type=Path, help="what the instruments of their type have in common")
    parser.add_argument("--table", help="one Parquet file of all results")
    parser.add_argument("--address", help="the cluster; without it one on this machine")
    given = parser.parse_args()
    ray.init(address=given.address, log_to_driver=False, configure_logging=False)
    everything = campaigns(given.campaigns)
    results = given.results.rstrip("/")
    left = missing(everything, results)
    print(f"{len(everything)} campaigns, {len(everything) - len(left)} of them done before", flush=True)
    fleet = given.fleet.read_bytes() if given.fleet else None
    for number, name in enumerate(on_the_cluster(left, results, fleet), start=1):
        print(f"{number} of {len(left)}: {name}", flush=True)
    if given.table:
        write_table(names(everything), results, given.table)


if __name__ == "__main__":
    main()
