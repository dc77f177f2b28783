"""Work over several processes or machines, through joblib: its own processes, or a cluster that is there already."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, TypeVar

from tracker.errors import ConfigError, MissingExtraError

Item = TypeVar("Item")
Result = TypeVar("Result")
CONNECT_S = 10  # until a scheduler that does not answer is not there


@dataclass(frozen=True, slots=True)
class Spreading:
    """Where work is done. jobs: processes side by side, -1 as many as there are cores; on a cluster, 1 and -1 are all
    of its workers. cluster: "dask://HOST:PORT" or "ray://HOST:PORT" (ray://auto: the one that runs here).

    Raises ConfigError where it is neither."""

    jobs: int = 1
    cluster: str | None = None

    def __post_init__(self) -> None:
        if self.jobs < 1 and self.jobs != -1:
            raise ConfigError(f"--jobs: a number of processes, or -1 for one a core, got {self.jobs}")
        kind, separator, address = (self.cluster or "dask://there").partition("://")
        if kind not in CLUSTERS or not separator or not address:
            known = " or ".join(f"{name}://HOST:PORT" for name in CLUSTERS)
            raise ConfigError(f"--cluster {self.cluster!r} is none; expected {known}")

    @property
    def here(self) -> bool:
        """Whether everything happens in this process, one after the other."""
        return self.jobs == 1 and self.cluster is None


def spread(
    work: Callable[[Item], Result], items: Sequence[Item], spreading: Spreading, threads: int = 1
) -> Iterator[tuple[int, Result]]:
    """(position of the item, what the work made of it), as they are finished (with ray, as rounds of them are).

    work, items, results: can be sent to another process. threads: that libraries may use in each of joblib's own
    processes. Raises whatever the work raises, MissingExtraError where a cluster's package is not installed,
    ConfigError where the cluster does not answer.
    """
    if spreading.here:
        yield from ((place, work(item)) for place, item in enumerate(items))
        return
    from joblib import Parallel, delayed, parallel_config

    with ExitStack() as stack:
        if spreading.cluster is None:
            stack.enter_context(parallel_config("loky", inner_max_num_threads=threads))
            jobs, rounds = spreading.jobs, False
        else:
            kind, _, address = spreading.cluster.partition("://")
            workers = CLUSTERS[kind](address, stack)
            jobs = spreading.jobs if spreading.jobs > 1 else workers or -1
            rounds = workers is not None
        calls = [delayed(_placed)(work, place, item) for place, item in enumerate(items)]
        if rounds:
            for start in range(0, len(calls), jobs):
                done: Any = Parallel(n_jobs=jobs)(calls[start : start + jobs])
                yield from done
            return
        # One at a time: what is finished comes back at once, not with the rest of a batch.
        alone: dict[str, Any] = {"batch_size": 1}  # joblib declares a text
        pool = Parallel(n_jobs=jobs, return_as="generator_unordered", **alone)
        found: Any = pool(calls)
        yield from found


def _placed(work: Callable[[Item], Result], place: int, item: Item) -> tuple[int, Result]:
    return place, work(item)


def _dask(address: str, stack: ExitStack) -> None:
    from joblib import parallel_config

    try:
        from dask.distributed import Client  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise MissingExtraError("a dask cluster needs its package: pip install 'conceptrack[cluster]'") from error
    try:
        client = stack.enter_context(Client(f"tcp://{address}", timeout=CONNECT_S, set_as_default=False))
    except (OSError, ValueError) as error:
        raise ConfigError(f"--cluster dask://{address}: no scheduler answers there ({error})") from error
    stack.enter_context(parallel_config("dask", client=client))


def _ray(address: str, stack: ExitStack) -> int:
    """Its number of workers: joblib gets nothing back from ray before all is finished, so work is given in rounds."""
    from joblib import parallel_config

    try:
        import ray  # pyright: ignore[reportMissingImports]
        from ray.util.joblib import register_ray  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise MissingExtraError("a ray cluster needs its package: pip install 'conceptrack[ray]'") from error
    try:
        stack.enter_context(ray.init("auto" if address == "auto" else f"ray://{address}"))
    except (OSError, ConnectionError, ValueError) as error:
        raise ConfigError(f"--cluster ray://{address}: no cluster answers there ({error})") from error
    register_ray()
    stack.enter_context(parallel_config("ray"))
    return max(1, int(ray.cluster_resources().get("CPU", 1)))


# Each enters joblib's backend for the cluster at the address, and says how many get work at a time: None, as it comes.
CLUSTERS: dict[str, Callable[[str, ExitStack], int | None]] = {"dask": _dask, "ray": _ray}
