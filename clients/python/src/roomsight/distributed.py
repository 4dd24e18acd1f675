"""The heavy parts of training and measuring as tasks of a Dask cluster that exists.

    from dask.distributed import Client
    from roomsight import distributed

    with Client("tcp://scheduler:8786") as cluster:
        report = distributed.train(cluster, "/data/my-rooms", "/data/models/home/1", parts="/data/described", n_parts=64)

Results are those of one machine: models byte for byte, rates to the last digit. Workers need the program ``roomsight`` (the wheel that
``make wheel`` builds), and the folders under the same names, as on a shared disk. A task starts no thread pool but the program's own, so
workers have one thread each. A task whose worker is lost runs again elsewhere; what other tasks have written stays. Options
are those of ``roomsight.program``.
"""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Callable, Optional, Union

from . import program

if TYPE_CHECKING:
    from distributed import Client

Folder = Union[str, "os.PathLike[str]"]
#: Called with how many tasks are done, and how many there are.
TaskProgress = Callable[[int, int], None]


def describe(
    cluster: Client,
    data: Folder,
    output: Folder,
    *,
    n_parts: Optional[int] = None,
    progress: Optional[TaskProgress] = None,
    **options: Any,
) -> list[dict[str, Any]]:
    """Describes frames into the parts of a folder, one task a part, as ``roomsight describe --part``; what each wrote.

    Parts that are there already are kept. By default there are four for each thread of the cluster, so that none waits long for the last.
    """
    parts = _parts(cluster, n_parts)
    calls = [functools.partial(program.run, "describe", data, output=output, part=part, **options) for part in parts]
    return _run(cluster, calls, progress)


def train(
    cluster: Client,
    data: Folder,
    output: Folder,
    *,
    parts: Folder,
    n_parts: Optional[int] = None,
    progress: Optional[TaskProgress] = None,
    options: Optional[dict[str, Any]] = None,
    **described: Any,
) -> dict[str, Any]:
    """Describes frames into ``parts``, and trains on them in one task; what ``roomsight train --json`` tells.

    ``options`` are those of training alone, such as ``{"min_rate": 0.9}``; all others go to both.
    """
    describe(cluster, data, parts, n_parts=n_parts, progress=progress, **described)
    call = functools.partial(program.run, "train", parts, output=output, **described, **(options or {}))
    report: dict[str, Any] = _run(cluster, [call], None)[0]
    return report


def validate(
    cluster: Client,
    data: Folder,
    *,
    seeds: int = 1,
    progress: Optional[TaskProgress] = None,
    **options: Any,
) -> list[dict[str, Any]]:
    """The rates of a configuration, one task a seed; what ``roomsight validate --json`` tells of all. ``data`` may be described parts."""
    calls = [functools.partial(program.run, "validate", data, seeds=1, first_seed=seed, **options) for seed in range(seeds)]
    by_seed: list[list[dict[str, Any]]] = _run(cluster, calls, progress)
    return [_summed_up(reports) for reports in zip(*by_seed)]


def experiment(
    cluster: Client,
    name: str,
    data: Folder,
    report: Folder,
    *,
    n_parts: Optional[int] = None,
    progress: Optional[TaskProgress] = None,
    **options: Any,
) -> dict[str, Any]:
    """An experiment of the papers, or ``all``, into the folder ``report``: its cells as tasks, then the report in one more; what
    ``roomsight experiment --json`` tells."""
    options = {"data": data, "report": report, **options}
    parts = _parts(cluster, n_parts)
    _run(cluster, [functools.partial(program.command, "experiment", name, part=part, **options) for part in parts], progress)
    made: dict[str, Any] = _run(cluster, [functools.partial(program.run, "experiment", name, **options)], None)[0]
    return made


def _parts(cluster: Client, n_parts: Optional[int]) -> list[str]:
    """The parts of a work, as the command line has them: four for each thread of the cluster, unless it is said how many."""
    count = n_parts or 4 * max(1, sum(cluster.nthreads().values()))
    return [f"{number}/{count}" for number in range(1, count + 1)]


def _run(cluster: Client, calls: Sequence[Callable[[], Any]], progress: Optional[TaskProgress]) -> list[Any]:
    """The values of calls, in their order. The first that fails ends the others, and is raised."""
    from distributed import as_completed

    futures = [cluster.submit(call, pure=False) for call in calls]
    try:
        for n_done, future in enumerate(as_completed(futures), 1):
            future.result()
            if progress is not None:
                progress(n_done, len(futures))
        return [future.result() for future in futures]
    finally:
        cluster.cancel([future for future in futures if not future.done()])


def _summed_up(reports: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """What one run over all seeds tells, of one test of each seed."""
    evaluations = [evaluation for report in reports for evaluation in report["evaluations"]]
    preferred: dict[str, int] = {}
    for report in reports:
        for name, count in report.get("preferred", {}).items():
            preferred[name] = preferred.get(name, 0) + count
    n_early, n_frames = (sum(report["early"][count] for report in reports) for count in ("n_correct", "n_frames"))
    summed = dict(reports[-1])
    summed["rate"] = _summary(evaluation["overall"]["rate"] for evaluation in evaluations)
    summed["mean_by_place"] = _summary(evaluation["mean_by_place"] for evaluation in evaluations)
    summed["without_border"] = _summary(evaluation["without_border"]["rate"] for evaluation in evaluations)
    summed["early"] = {"n_correct": n_early, "n_frames": n_frames, "rate": n_early / n_frames if n_frames else None}
    if preferred:
        summed["preferred"] = dict(sorted(preferred.items()))
    summed["evaluations"] = evaluations
    summed["knowledge"] = [knowledge for report in reports for knowledge in report["knowledge"]]
    return summed


def _summary(values: Iterable[Optional[float]]) -> Optional[dict[str, Any]]:
    """Mean, sample deviation and best, added up in order as the program does: ``sum`` of Python rounds otherwise."""
    rates = [value for value in values if value is not None]
    if not rates:
        return None
    mean = functools.reduce(lambda total, rate: total + rate, rates, 0.0) / len(rates)
    squares = functools.reduce(lambda total, rate: total + (rate - mean) * (rate - mean), rates, 0.0)
    std = math.sqrt(squares / (len(rates) - 1)) if len(rates) > 1 else None
    return {"n_runs": len(rates), "mean": mean, "std": std, "best": max(rates)}
