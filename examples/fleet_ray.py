"""The diagnosis of many campaigns on a cluster: one task each, by Ray.

    pip install ray pyarrow fsspec ./python
    python examples/fleet_ray.py CAMPAIGNS RESULTS [--fleet F.toml] [--table T.parquet] [--address auto]

CAMPAIGNS and RESULTS are folders, or addresses that fsspec knows (s3://…, gs://…, memory is not shared between processes).
Below CAMPAIGNS every folder with a campaign.toml is one; in RESULTS each has NAME.json and NAME.toml, as from
`north fleet diagnose`, byte for byte, and NAME.parquet, its row of the table; made-with.json says what all were made with, and
others are refused. A campaign whose three results are there is not diagnosed again, unless it was refused: a run that was ended
goes on, and a task that failed or whose worker died is begun anew by Ray, three times. One that fails for good is told, and the
exit code is 1; the others go on.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import fsspec
import pyarrow
import pyarrow.parquet
import ray
import ray.exceptions

import north_finder

#: Results of one campaign, the last of which says that all are there.
ENDINGS = ("toml", "parquet", "json")
#: What all results of a folder were made with.
MADE_WITH = "made-with.json"
#: How the JSON of a campaign begins that cannot be diagnosed.
REFUSED = b'{"refused":'


def diagnose(campaign: str, results: str, fleet: bytes | None) -> None:
    """Diagnoses one campaign on one thread and stores its results."""
    name = name_of(campaign)
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
        if made["json"].read_bytes().startswith(REFUSED):
            place_refusal(made["json"], table, str(here / "campaigns"), parent_of(campaign))
        for ending in ENDINGS:
            # A campaign that cannot be diagnosed has no model.
            if made[ending].exists():
                store(made[ending].read_bytes(), f"{results}/{name}.{ending}")


def place_refusal(result: Path, table: Path, here: str, there: str) -> None:
    """Lets a refusal name the campaign where it is, and not the worker's copy."""
    why = json.loads(result.read_bytes())["refused"].replace(here, there)
    text = json.dumps({"refused": why}, ensure_ascii=False, separators=(",", ":"))
    result.write_bytes(f"{text}\n".encode())
    rows = pyarrow.parquet.read_table(table)
    number = rows.schema.get_field_index("refused")
    field = rows.schema.field(number)
    pyarrow.parquet.write_table(rows.set_column(number, field, pyarrow.array([why], field.type)), table)


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


def name_of(campaign: str) -> str:
    return campaign.rstrip("/").rsplit("/", 1)[-1]


def parent_of(campaign: str) -> str:
    """The folder of a campaign as people name it: a path on this machine, an address elsewhere."""
    return campaign.rstrip("/").rsplit("/", 1)[0].removeprefix("file://")


def check_made_with(results: str, fleet: bytes | None) -> None:
    """Ends where the results that are there were made with another version or another fleet, as the command does."""
    now = {"version": north_finder.__version__, "fleet_crc32": None if fleet is None else zlib.crc32(fleet)}
    address = f"{results}/{MADE_WITH}"
    system, path = fsspec.url_to_fs(address)
    if not system.exists(path):
        store(json.dumps(now, separators=(",", ":")).encode(), address)
        return
    before = json.loads(system.cat_file(path))
    if before != now:
        sys.exit(
            f"{address}: the results in this folder were made with another version or another fleet ({described(before)}; "
            f"now {described(now)}); take a folder of their own for new ones"
        )


def described(made_with: dict[str, Any]) -> str:
    crc32 = made_with["fleet_crc32"]
    return f"version {made_with['version']} with {'no fleet' if crc32 is None else f'a fleet of CRC-32 {crc32:08x}'}"


def missing(all_campaigns: list[str], results: str) -> list[str]:
    """Those whose diagnosis is not there. A refusal is none: what it complains of may have been mended."""
    system, path = fsspec.url_to_fs(results)
    there = {found.rsplit("/", 1)[-1] for found in system.glob(f"{path}/*")}
    names = map(name_of, all_campaigns)
    whole = [name for name in names if all(f"{name}.{ending}" in there for ending in ENDINGS)]
    is_done = dict(zip(whole, are_diagnosed(system, [f"{path}/{name}.json" for name in whole])))
    return [campaign for campaign in all_campaigns if not is_done.get(name_of(campaign), False)]


def are_diagnosed(system: fsspec.AbstractFileSystem, paths: list[str]) -> list[bool]:
    """Whether the results are diagnoses: their first bytes are read, of many at a time where the file system can."""
    if not paths:
        return []
    return [begin != REFUSED for begin in system.cat_ranges(paths, 0, len(REFUSED), on_error="raise")]


def on_the_cluster(addresses: list[str], results: str, fleet: bytes | None) -> Iterator[tuple[str, Exception | None]]:
    """Names of the campaigns as their tasks end, with the error of a task that failed. No more tasks wait than twice as many
    as there are processors."""
    task = ray.remote(num_cpus=1, max_retries=3, retry_exceptions=True)(diagnose)
    most = 2 * int(ray.cluster_resources().get("CPU", 1))
    prior = ray.put(fleet)
    waiting: dict[ray.ObjectRef, str] = {}
    for address in addresses:
        waiting[task.remote(address, results, prior)] = name_of(address)
        if len(waiting) >= most:
            yield from ended(waiting)
    while waiting:
        yield from ended(waiting)


def ended(waiting: dict[ray.ObjectRef, str]) -> Iterator[tuple[str, Exception | None]]:
    """Waits until a task has ended, and takes it from those that wait."""
    done, _ = ray.wait(list(waiting))
    for task in done:
        yield waiting.pop(task), error_of(task)


def error_of(task: ray.ObjectRef) -> Exception | None:
    """What a task raised in the end, or why it could not be run to its end."""
    try:
        ray.get(task)
    except ray.exceptions.RayTaskError as error:
        return error.cause
    except ray.exceptions.RayError as error:
        return error
    return None


def diagnose_all(addresses: list[str], results: str, fleet: bytes | None) -> set[str]:
    """Diagnoses campaigns and tells of each; gives the names of those whose task failed."""
    failed = set()
    for number, (name, error) in enumerate(on_the_cluster(addresses, results, fleet), start=1):
        print(f"{number} of {len(addresses)}: {name}{'' if error is None else ' failed'}", flush=True)
        if error is not None:
            print(f"{name}: {type(error).__name__}: {error}", file=sys.stderr, flush=True)
            failed.add(name)
    return failed


def write_table(names: list[str], results: str, table: str) -> None:
    """The rows of campaigns as one Parquet file, one group of rows each. It appears as a whole."""
    system, path = fsspec.url_to_fs(results)
    out, target = fsspec.url_to_fs(table)
    writer = None
    with out.open(f"{target}.part", "wb") as file:
        for name in names:
            with system.open(f"{path}/{name}.parquet", "rb") as row:
                rows = pyarrow.parquet.read_table(row)
            writer = writer or pyarrow.parquet.ParquetWriter(file, rows.schema)
            writer.write_table(rows)
        if writer is not None:
            writer.close()
    out.mv(f"{target}.part", target)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("campaigns")
    parser.add_argument("results")
    parser.add_argument("--fleet", type=Path, help="what the instruments of their type have in common")
    parser.add_argument("--table", help="one Parquet file of all results")
    parser.add_argument("--address", help="the cluster; without it one on this machine")
    given = parser.parse_args()
    everything = campaigns(given.campaigns)
    if not everything:
        sys.exit(f"no campaign below {given.campaigns}")
    results = given.results.rstrip("/")
    fleet = given.fleet.read_bytes() if given.fleet else None
    check_made_with(results, fleet)
    left = missing(everything, results)
    ray.init(address=given.address, log_to_driver=False, configure_logging=False)
    print(f"{len(everything)} campaigns, {len(everything) - len(left)} of them done before", flush=True)
    failed = diagnose_all(left, results, fleet)
    rows = [name for name in map(name_of, everything) if name not in failed]
    if given.table and rows:
        write_table(rows, results, given.table)
    if failed:
        sys.exit(f"{len(failed)} of {len(everything)} campaigns failed; the same command tries them again")


if __name__ == "__main__":
    main()
