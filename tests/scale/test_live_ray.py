"""A real Ray: results as of `standoff run`, a process killed, a machine of two killed."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from cli.conftest import write_site
from cli.test_cli import make_video
from cli.test_replay import TABLES, assert_same, monitor
from scale.conftest import FILMS
from scale.noted_detectors import looks
from scale.test_part import noted

PROJECT = Path(__file__).resolve().parents[2]
PATHS = os.pathsep.join(str(PROJECT / part) for part in ("src", "simulator/src", "tests"))
ENVIRONMENT = {**os.environ, "PYTHONPATH": PATHS, "RAY_worker_niceness": "0"}
"""As whoever typed it, but that Ray's workers give way to nobody: other tests run beside these."""
PATIENCE_S = 120.0
ALL_COMPLETE = dict.fromkeys(FILMS, ("complete", ""))

pytestmark = pytest.mark.live


def batch(films: Path, site: Path, *words: object) -> tuple[int, dict[str, dict[str, Any]], str]:
    """Watch films by Ray; give the exit code, what became of each by name, and standard error."""
    given = ["batch", films, "--config", site, "--out", films.parent / "out", "--json", "--quiet", *words]
    command = [sys.executable, "-m", "standoff", *map(str, given)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT
    ) as process:
        printed, err = process.communicate()
    assert not list(Path("/tmp").glob(f"ray-{process.pid}-*")), "Ray's own files are left"
    results = json.loads(printed) if printed else []
    return process.returncode, {Path(one["film"]).stem: one for one in results}, err


def outcomes(results: dict[str, dict[str, Any]]) -> dict[str, tuple[str, str]]:
    return {name: (one["status"], one["message"]) for name, one in results.items()}


def until(is_so: Callable[[], bool], what: str) -> None:
    given_up_s = time.monotonic() + PATIENCE_S
    while not is_so():
        assert time.monotonic() < given_up_s, f"waited in vain until {what}"
        time.sleep(0.1)


def test_results_of_a_batch_are_those_of_run_and_what_is_finished_is_skipped(films: Path, tmp_path: Path) -> None:
    unsure = {"factory": "cli.test_replay:Unsure"}
    site = write_site(tmp_path, outputs=[*TABLES, "hazards"], replace={"detect": unsure})
    code, results, err = batch(films, site, "--cores-per-film", 1)
    assert (code, err, outcomes(results)) == (0, "", ALL_COMPLETE)
    for name in FILMS:
        assert_same(tmp_path / "out" / name, monitor(films / f"{name}.mp4", site, tmp_path / name))
    records = [(tmp_path / "out" / name / "run.json").read_bytes() for name in FILMS]
    code, results, err = batch(films, site)
    assert (code, err, outcomes(results)) == (0, "", ALL_COMPLETE)
    assert [(tmp_path / "out" / name / "run.json").read_bytes() for name in FILMS] == records


def test_long_films_are_looked_at_in_parts_and_are_the_runs_in_one_piece(films: Path, tmp_path: Path) -> None:
    words = tmp_path / "words"
    # Frame 13 is in a part of each film; one process dies there, and what it had not written down is looked at again.
    site = write_site(tmp_path, outputs=[*TABLES, "hazards"], replace=noted(words, dies_at=[13]))
    code, results, err = batch(films, site, "--cores-per-film", 1, "--part-minutes", 0.01)
    assert (code, err, outcomes(results)) == (0, "", ALL_COMPLETE)
    seen = Counter(looks(words))
    wanted = Counter(index for frames in FILMS.values() for index in range(frames))
    assert seen.keys() == wanted.keys()
    assert seen[13] == wanted[13] + 1
    assert all(wanted[index] <= count <= wanted[index] + 1 for index, count in seen.items())
    for name in FILMS:
        record = json.loads((tmp_path / "out" / name / "run.json").read_text())
        assert record["model"]["remembered_frames"] == FILMS[name]
        assert_same(tmp_path / "out" / name, monitor(films / f"{name}.mp4", site, tmp_path / name))


def test_the_film_of_a_killed_process_is_run_again(films: Path, tmp_path: Path) -> None:
    options = {"film": "second", "mark": str(tmp_path / "mark")}
    killed = {"factory": "scale.slow_detectors:KilledOnce", "options": options}
    site = write_site(tmp_path, outputs=[*TABLES, "hazards"], replace={"detect": killed})
    code, results, err = batch(films, site)
    assert (tmp_path / "mark").is_file(), "nobody was killed"
    assert (code, err, outcomes(results)) == (0, "", ALL_COMPLETE)
    assert_same(tmp_path / "out" / "second", monitor(films / "second.mp4", site, tmp_path / "alone"))


def test_where_ray_itself_dies_it_is_begun_anew_and_all_films_are_watched(films: Path, tmp_path: Path) -> None:
    slow = {"factory": "scale.slow_detectors:Slow", "options": {"words": str(tmp_path / "words"), "frame_s": 0.1}}
    site = write_site(tmp_path, outputs=[*TABLES, "hazards"], replace={"detect": slow})

    def kill_raylet() -> None:
        until(lambda: bool(machines(tmp_path / "words")), "a film is watched")
        raylet = next(iter(machines(tmp_path / "words").values()))
        assert "raylet" in Path(f"/proc/{raylet}/cmdline").read_text()
        os.kill(raylet, signal.SIGKILL)

    with ThreadPoolExecutor(1) as beside:
        done = beside.submit(kill_raylet)
        code, results, err = batch(films, site)
        done.result()
    assert (code, err, outcomes(results)) == (0, "", ALL_COMPLETE)
    assert_same(tmp_path / "out" / "first", monitor(films / "first.mp4", site, tmp_path / "alone"))


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


@pytest.fixture
def cluster() -> Iterator[str]:
    """A Ray of a head that does no work and two machines of one core each, all on this one; its address."""
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="ray-", dir="/tmp", ignore_cleanup_errors=True))
        port, client_port = free_port(), free_port()

        def start(address: str, *words: str) -> None:
            # Each with an address of its own, as machines have: Ray takes a driver for part of what has its address.
            small = ("--object-store-memory", str(100 * 2**20), "--disable-usage-stats", "--block")
            command = [sys.executable, "-m", "ray.scripts.scripts", "start", "--node-ip-address", address]
            node = subprocess.Popen(
                [*command, *words, *small],
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                env=ENVIRONMENT,
            )
            assert node.stdout is not None
            stack.callback(node.stdout.close)
            stack.callback(node.wait)
            stack.callback(node.terminate)
            assert any("Ray runtime started" in line for line in node.stdout), f"no machine by {words}"

        head = ("--head", "--port", str(port), "--ray-client-server-port", str(client_port), "--temp-dir", folder)
        start("127.0.0.1", *head, "--num-cpus", "0", "--include-dashboard", "false")
        until(lambda: listens(client_port), "the head of the cluster listens")
        # All keep the address of their machine in one file, as if they were one; who joins belongs to the head, not to
        # whoever started last and may be killed.
        kept = Path(folder) / "session_latest" / "node_ip_address.json"
        of_head = kept.read_text()
        for address in ("127.0.0.2", "127.0.0.3"):
            start(address, "--address", f"127.0.0.1:{port}", "--num-cpus", "1")
        kept.write_text(of_head)
        yield f"ray://127.0.0.1:{client_port}"


def listens(port: int) -> bool:
    with socket.socket() as one:
        return one.connect_ex(("127.0.0.1", port)) == 0


def machines(words: Path) -> dict[str, int]:
    """Return which machine watches which film: the id of the process that started the film's own."""
    told = {path.name: path.read_text().split() for path in words.glob("*")} if words.is_dir() else {}
    return {film: int(ids[1]) for film, ids in told.items() if len(ids) == 2}


def test_of_two_machines_one_is_killed_and_its_film_is_run_again_by_the_other(cluster: str, tmp_path: Path) -> None:
    films = tmp_path / "films"
    films.mkdir()
    for name in ("a", "b", "c"):
        make_video(films / f"{name}.mp4", 40)
    slow = {"factory": "scale.slow_detectors:Slow", "options": {"words": str(tmp_path / "words"), "frame_s": 0.2}}
    site = write_site(tmp_path, outputs=[*TABLES, "hazards"], replace={"detect": slow})
    killed: dict[str, int] = {}

    def kill_one() -> None:
        until(lambda: bool(machines(tmp_path / "words")), "a film is watched")
        film, machine = next(iter(machines(tmp_path / "words").items()))
        assert machine > 1, "an orphan watches"
        os.kill(machine, signal.SIGKILL)
        killed[film] = machine

    with ThreadPoolExecutor(1) as beside:
        done = beside.submit(kill_one)
        code, results, err = batch(films, site, "--address", cluster)
        assert code == 0, err
        done.result()
    assert (code, err, outcomes(results)) == (0, "", dict.fromkeys("abc", ("complete", "")))
    (film,) = killed
    assert machines(tmp_path / "words")[film] != killed[film]
    assert_same(tmp_path / "out" / film, monitor(films / f"{film}.mp4", site, tmp_path / "alone"))
