"""Where the maps of a sweep are made: on the processes of a dask.distributed scheduler, here or on a cluster."""

import logging
import os
import signal
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from stereogrid.config import config_from_table
from stereogrid.errors import InvalidInputError, MissingExtraError, StereogridError

from .kept_drives import remove_halves
from .sweep_config import UnitConfig
from .sweep_unit import Plain, attempt, files_of, makings

try:
    import dask
    from distributed import Client, LocalCluster, as_completed
    from distributed.scheduler import KilledWorker
except ImportError as error:
    raise MissingExtraError(f'a sweep needs more: pip install -e ".[sweep]" ({error.name} is missing)') from None

if TYPE_CHECKING:
    from distributed import Future

GIVE_UP_S = 10.0
"""After so long a scheduler that does not answer, or has no worker, is none."""
DASHBOARD = "127.0.0.1:8787"
SETTINGS = {
    # A map that kills its worker is tried twice more and then listed. One at a time is given to a worker, so that it is
    # plain which one did it.
    "distributed.scheduler.allowed-failures": 2,
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.worker.multiprocessing-method": "spawn",
    "distributed.comm.timeouts.connect": f"{GIVE_UP_S:.0f}s",
}


@dataclass(frozen=True)
class Place:
    """Where a sweep runs.

    scheduler: of a cluster, as tcp://host:8786, "" for this machine alone. workers: processes here, 0 = cores.
    memory_gb: of each [GB], beyond which it is ended, 0 = its share of the machine's. dashboard: dask's page, here.
    """

    scheduler: str = ""
    workers: int = 0
    memory_gb: float = 0.0
    dashboard: bool = False

    def __post_init__(self) -> None:
        if self.workers < 0 or not self.memory_gb >= 0:
            raise InvalidInputError(f"workers and memory must be 0 or more, not {self.workers} and {self.memory_gb}")
        if self.scheduler and (self.workers or self.memory_gb or self.dashboard):
            raise InvalidInputError("a cluster has its own workers, memory and dashboard: leave these options out")


@contextmanager
def opened(place: Place, drives: Path) -> Iterator["Client"]:
    """A client of the scheduler, whose workers all have this checkout; on an error or interrupt workers end at once.

    Raises InvalidInputError where there is no scheduler, no worker, or another checkout.
    """
    _silence()
    with dask.config.set(SETTINGS):
        if place.scheduler:
            with _remote(place.scheduler) as client:
                check_workers(client)
                yield client
            return
        with _local(place, drives) as client:
            yield client


def _silence() -> None:
    """What matters is said in our own words."""
    for name in logging.root.manager.loggerDict:
        if name.startswith("distributed"):
            logging.getLogger(name).setLevel(logging.CRITICAL)


@contextmanager
def _local(place: Place, drives: Path) -> Iterator["Client"]:
    if place.dashboard:
        _check_dashboard()
    options = {"memory_limit": int(place.memory_gb * 1e9)} if place.memory_gb else {}
    cluster = LocalCluster(
        n_workers=place.workers or os.cpu_count(),
        threads_per_worker=1,
        host="127.0.0.1",
        dashboard_address=DASHBOARD if place.dashboard else "127.0.0.1:0",
        scheduler_kwargs={"dashboard": place.dashboard},
        silence_logs=logging.CRITICAL,
        **options,
    )
    try:
        with Client(cluster, set_as_default=False) as client:
            yield client
    except BaseException:
        _kill_workers(cluster)
        raise
    finally:
        cluster.close()
        remove_halves(drives)


def _kill_workers(cluster: "LocalCluster") -> None:
    """A map takes minutes, and a thread that makes one cannot be stopped."""
    for nanny in cluster.workers.values():
        nanny.auto_restart = False
        if nanny.pid:
            with suppress(ProcessLookupError):
                os.kill(nanny.pid, signal.SIGKILL)


def _check_dashboard() -> None:
    try:
        import bokeh  # noqa: F401
    except ImportError:
        raise MissingExtraError("dask's dashboard needs bokeh: pip install bokeh, or leave --dashboard out") from None


@contextmanager
def _remote(address: str) -> Iterator["Client"]:
    try:
        client = Client(address, timeout=GIVE_UP_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        text = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InvalidInputError(f"no dask scheduler answers at {address} ({text}); start one: dask scheduler") from None
    with client:
        yield client


def check_workers(client: "Client") -> None:
    """Raise InvalidInputError unless there is a worker, and every one has this code and these versions."""
    address = client.scheduler.address
    try:
        client.wait_for_workers(1, timeout=GIVE_UP_S)
    except TimeoutError:
        raise InvalidInputError(f"{address} has no worker; start one in a checkout: dask worker {address}") from None
    ours = makings()
    for worker, theirs in client.run(makings, on_error="return").items():
        if isinstance(theirs, BaseException):
            raise InvalidInputError(f"worker {worker} has no such checkout to import ({theirs})")
        check_makings(ours, theirs, f"worker {worker}")


def check_makings(ours: Mapping[str, str], theirs: Mapping[str, str], who: str) -> None:
    """Raise InvalidInputError where scores would be made by other code, or on other libraries."""
    if ours["code"] != theirs["code"]:
        raise InvalidInputError(f"{who} has another checkout: its code differs from ours; update one of the two")
    if ours["versions"] != theirs["versions"]:
        raise InvalidInputError(f"{who} has {theirs['versions']}; we have {ours['versions']}: make them alike")


def made(client: "Client", units: Mapping[str, UnitConfig], drives: str) -> Iterator[tuple[str, Plain]]:
    """The key of each unit and what `attempt` gives for it, as they come; an error too where its worker died."""
    files = {matcher: files_of(matcher) for matcher in {config.mapping.matcher for config in units.values()}}
    futures = {
        client.submit(
            guarded, asdict(config), drives, makings(), files[config.mapping.matcher], key=f"sweep-{key}", pure=False
        ): key
        for key, config in units.items()
    }
    for future in as_completed(futures, loop=client.loop, raise_errors=False):
        yield futures[future], _outcome(future)
        future.release()


def guarded(unit: Plain, drives: str, wanted: Mapping[str, str], files: Mapping[str, str]) -> Plain:
    """`attempt`, unless this worker came late and with another checkout, or has other files of the network."""
    try:
        check_makings(wanted, makings(), "a worker that came later")
        if files_of(config_from_table(UnitConfig, unit).mapping.matcher) != files:
            raise InvalidInputError("a worker has other files of the network than ours; make them alike")
    except (StereogridError, OSError) as error:
        return {"error": f"{type(error).__name__}: {error}"}
    return attempt(unit, drives)


def _outcome(future: "Future") -> Plain:
    if future.status == "finished":
        result: Plain = future.result()
        return result
    if future.status == "error":
        error = future.exception()
        if isinstance(error, KilledWorker):
            times = error.allowed_failures + 1
            return {"error": f"its worker died, {times} times: out of memory, or killed from outside"}
        return {"error": f"{type(error).__name__}: {error}"}
    raise InvalidInputError("the scheduler was lost; what is finished is kept, and the same command goes on from there")
