"""Ray, connected: to a cluster, or to one of our own on this machine."""

from __future__ import annotations

import os
import shutil
import socket
import tempfile
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

from standoff.core.errors import ConfigError, OutputError

ANSWERS_WITHIN_S: Final = 10.0
"""A cluster's head that has said nothing for so long is taken not to be there."""
_TRIES: Final = 3
"""So often somebody joins who is not let in, and so often Ray is started that does not come up."""
_PORT: Final = 10001
"""Of a cluster's head, for those who are not part of it, unless the address says another."""
_SILENT: Final = {"log_to_driver": False, "logging_level": "ERROR"}
"""Ray's own words are for who develops on it; what goes wrong with a film we say."""
_STORE_BYTES: Final = 100 * 2**20
"""What passes between films and us are words; Ray would set aside a third of the memory."""
_ENVIRONMENT: Final = {
    # Ray tells its makers what it is used for, unless it is told not to.
    "RAY_USAGE_STATS_ENABLED": "0",
    # Without it Ray says that nobody collects its metrics.
    "RAY_BACKEND_LOG_LEVEL": "fatal",
    # Without it Ray hides the graphics cards from whoever does not ask for one.
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",
    # Ray gives itself up when a process of its own needs longer to start, as it may where others are at work.
    "RAY_agent_register_timeout_ms": "120000",
}


@dataclass(frozen=True, slots=True)
class Connection:
    """Ray, connected.

    Attributes:
        ray: The package; Ray connects a whole process.
        restart: Begins anew in place of a Ray of our own that died; None: it is a cluster, which belongs to others.
    """

    ray: Any
    restart: Callable[[], None] | None = None


@contextmanager
def connected(address: str | None, cores: int | None = None) -> Generator[Connection, None, None]:
    """Give Ray, connected to a cluster or to a new one on this machine alone; leave no trace of that one.

    Args:
        address: Of the cluster; None: this machine alone.
        cores: So many does this machine have, for whoever measures; None: as it has.

    Raises:
        ConfigError: Ray is not installed, or nobody answers at the address.
        OutputError: The cluster is gone, or Ray does not start here.
    """
    for name, value in _ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    ray = _imported("ray")
    with _hushed(ray), _on_this_machine(ray, cores) if address is None else _joined(ray, address) as connection:
        yield connection


@contextmanager
def _on_this_machine(ray: Any, cores: int | None) -> Generator[Connection, None, None]:  # noqa: ANN401
    # Ray makes sockets there, whose names must be short.
    folder = Path(tempfile.mkdtemp(prefix=f"ray-{os.getpid()}-", dir="/tmp" if os.name == "posix" else None))

    def restart() -> None:
        ray.shutdown()
        _start(ray, cores, folder)

    try:
        _start(ray, cores, folder)
        yield Connection(ray, restart)
    finally:
        ray.shutdown()
        shutil.rmtree(folder, ignore_errors=True)


def _start(ray: Any, cores: int | None, folder: Path) -> None:  # noqa: ANN401
    """Start Ray on this machine; where others keep the machine busy, its processes may miss one another at first."""
    for left in reversed(range(_TRIES)):
        try:
            with _deaf():
                ray.init(
                    "local",
                    # Nobody else is to reach it, and whatever becomes of the network, it is there.
                    _node_ip_address="127.0.0.1",
                    num_cpus=cores,
                    include_dashboard=False,
                    object_store_memory=_STORE_BYTES,
                    _temp_dir=str(folder),
                    **_SILENT,
                )
        # Ray raises no narrower kind here.
        except Exception as error:
            ray.shutdown()
            if not left:
                raise OutputError(
                    expected="Ray to start on this machine",
                    found=one_line(f"{type(error).__name__}: {error}"),
                    fix="repeat the command when the machine is less busy: films that are finished are skipped",
                ) from error
        else:
            return


@contextmanager
def _joined(ray: Any, address: str) -> Generator[Connection, None, None]:  # noqa: ANN401
    _join(ray, address)
    try:
        yield Connection(ray)
    except (ConnectionError, _imported("grpc").RpcError) as error:
        raise OutputError(
            expected=f"the Ray cluster at {address} to stay",
            found=f"that it is gone ({one_line(str(error))})",
            fix="start it again and repeat the command: films that are finished are skipped",
        ) from error
    finally:
        ray.shutdown()


def _join(ray: Any, address: str) -> None:  # noqa: ANN401
    """Become part of a cluster; one whose head answers but now and then fails to let us in is asked again.

    The head makes a process for each who joins, by a fork beside threads of gRPC: one of twenty dies at once.
    """
    for left in reversed(range(_TRIES)):
        _reach(address)
        try:
            ray.init(address, **_SILENT)
        except (ConnectionError, RuntimeError, ValueError) as error:
            if not left:
                raise _nobody(address, one_line(str(error))) from error
            ray.shutdown()
        else:
            return


@contextmanager
def _deaf() -> Generator[None, None, None]:
    """Let nobody hear what a library of C++ says on standard error: of Ray, that it was told to say nothing."""
    kept = os.dup(2)
    with Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


@contextmanager
def _hushed(ray: Any) -> Generator[None, None, None]:  # noqa: ANN401
    """Keep Ray from printing which process died to standard output, where our JSON goes; no option of Ray's does."""
    worker = ray._private.worker
    prints = worker.print_to_stdstream
    worker.print_to_stdstream = lambda *_words, **_more: None
    try:
        yield
    finally:
        worker.print_to_stdstream = prints


def _imported(name: str) -> Any:  # noqa: ANN401
    try:
        return import_module(name)
    except ImportError as error:
        raise ConfigError(
            expected="Ray, which shares films out", found=f"no {name}", fix="pip install 'standoff[scale]'"
        ) from error


def _reach(address: str) -> None:
    """Refuse an address at which no Ray answers: Ray itself would try for minutes.

    Raises:
        ConfigError: It is no address of Ray's, or nobody answers within ten seconds.
    """
    parts = urlsplit(address)
    try:
        port = parts.port or _PORT
    except ValueError:
        port = 0
    if parts.scheme != "ray" or not parts.hostname or not port:
        raise ConfigError(expected="an address like ray://HOST:10001", found=address, fix="name the cluster's head")
    given_up_s = time.monotonic() + ANSWERS_WITHIN_S
    try:
        # Who is not there at all is told at once.
        socket.create_connection((parts.hostname, port), timeout=ANSWERS_WITHIN_S).close()
    except OSError as error:
        raise _nobody(address, error.strerror or str(error)) from error
    grpc = _imported("grpc")
    with grpc.insecure_channel(f"{parts.hostname}:{port}") as channel:
        try:
            grpc.channel_ready_future(channel).result(timeout=max(0.5, given_up_s - time.monotonic()))
        except grpc.FutureTimeoutError as error:
            raise _nobody(address, f"no answer within {ANSWERS_WITHIN_S:.0f} s, or another program's") from error


def _nobody(address: str, found: str) -> ConfigError:
    return ConfigError(
        expected=f"a Ray cluster at {address}",
        found=f"none ({found})",
        fix="start its head with `ray start --head`, or leave --address out to use this machine",
    )


def one_line(text: str) -> str:
    """Return what somebody else's error says, on one line that is not too long."""
    return " ".join(text.split())[:300]
