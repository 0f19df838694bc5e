"""Who may hear and say what: proven by what is delivered, because brokers grant what they then do not do."""

from __future__ import annotations

import contextlib
import json
import socket
import ssl
import subprocess
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from service.live.certificates import Authority
from service.live.running import Wearable
from service.live.servers import Server, free_port, mosquitto, needs, until
from service.live.test_live_broker import Listener, messenger, raise_alert

from standoff.stages.frames import LiveAddress, LiveStream, StreamUnreachable

pytestmark = pytest.mark.live
EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "live"
PASSWORD = "s3rvice-pass"
QUIET_S = 1.0
"""What has not come by then does not come."""


@contextmanager
def guarded_broker(folder: Path) -> Generator[Server, None, None]:
    """Give a broker with the example's ACL, accounts for the service and two devices, all with one password."""
    needs("mosquitto_passwd")
    passwords, acl = folder / "passwords", folder / "acl"
    passwords.touch(mode=0o600)
    for name in ("service", "wrist-1", "foreman"):
        subprocess.run(["mosquitto_passwd", "-b", str(passwords), name, PASSWORD], check=True, capture_output=True)
    acl.write_text((EXAMPLE / "acl").read_text().replace("standoff/example/", "standoff/yard/"))
    acl.chmod(0o600)
    port = free_port()
    lines = (
        f"listener {port} 127.0.0.1", "allow_anonymous false", f"password_file {passwords}", f"acl_file {acl}",
        "user root",
    )  # fmt: skip
    with mosquitto(folder, *lines, port=port) as server:
        yield server


def test_only_the_service_may_warn_and_devices_hear_only_what_is_theirs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BROKER_PASSWORD", PASSWORD)
    account = {"user": "service", "password": "env:BROKER_PASSWORD"}
    receivers = {"wrist-1": {"wearer": "worker"}}
    with guarded_broker(tmp_path) as broker:
        spy = Listener(broker.port, "standoff/#", user="wrist-1", password=PASSWORD)
        foreman = Listener(broker.port, "standoff/yard/device/foreman/alert", user="foreman", password=PASSWORD)
        nobody = Listener(broker.port, "standoff/#", user="wrist-1", password="wrong")
        until(lambda: spy.connections and foreman.connections)
        with messenger(tmp_path, broker.port, broker=account, receivers=receivers) as (outbox, workplace):
            raise_alert(outbox, workplace, 1)
            until(lambda: foreman.bodies("/alert"), what="the foreman's alert")
            for topic in ("device/foreman/alert", "stream/gate/hazard", "stream/gate/heartbeat", "service"):
                spy.send(f"standoff/yard/{topic}", b"forged")
            spy.send("standoff/yard/device/foreman/ack", b'{"hazard_id": "hazard-0001"}')
            spy.send("standoff/yard/device/wrist-1/ack", b'{"hazard_id": "hazard-0001"}')
            until(lambda: "hazard-0001" in outbox.acknowledged(), what="an acknowledgement of its own")
            time.sleep(QUIET_S)
            rows = outbox._db.execute("SELECT device FROM acknowledgement").fetchall()
        assert [row[0] for row in rows] == ["wrist-1"]
        assert {one.topic for one in spy.heard} == {"standoff/yard/device/wrist-1/supervision"}
        assert all(one.payload != b"forged" for one in foreman.heard)
        assert nobody.connections == 0
        for one in (spy, foreman, nobody):
            one.close()


# paho leaves the socket of a connection that TLS has refused to the garbage collector.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_broker_for_which_nobody_vouches_is_not_told_the_password(tmp_path: Path) -> None:
    good, other = Authority.make(tmp_path / "good"), Authority.make(tmp_path / "other")
    certificate, key = other.certify("broker")
    with tls_broker(tmp_path, other, certificate, key) as broker:
        listener = Listener(
            broker.port, "#", is_secure=True, ca_file=str(good.ca_file), user="service", password=PASSWORD
        )
        log = tmp_path / f"mosquitto-{broker.port}.log"
        until(lambda: "alert unknown ca" in log.read_text(), what="that it is not trusted")
        assert listener.connections == 0
        listener.close()


def test_a_device_is_known_by_its_certificate_and_warned_through_tls(tmp_path: Path) -> None:
    authority = Authority.make(tmp_path / "authority")
    certificate, key = authority.certify("broker")
    with tls_broker(
        tmp_path, authority, certificate, key, "require_certificate true", "use_identity_as_username true"
    ) as broker:
        own, own_key = authority.certify("service")
        settings = {
            "address": f"mqtts://127.0.0.1:{broker.port}", "ca_file": str(authority.ca_file),
            "cert_file": str(own), "key_file": str(own_key),
        }  # fmt: skip
        device, device_key = authority.certify("foreman")
        access = ("--ca-file", authority.ca_file, "--cert-file", device, "--key-file", device_key)
        stranger = Listener(broker.port, "#", is_secure=True, ca_file=str(authority.ca_file))
        with (
            messenger(tmp_path, broker.port, broker=settings) as (outbox, workplace),
            Wearable("foreman", broker.port, "--broker", settings["address"], *map(str, access)) as foreman,
        ):
            raise_alert(outbox, workplace, 1)
            until(lambda: foreman.alerts(), what="an alert")
        assert stranger.connections == 0
        stranger.close()


@contextmanager
def tls_broker(
    folder: Path, authority: Authority, certificate: Path, key: Path, *more: str
) -> Generator[Server, None, None]:
    port = free_port()
    lines = (
        f"listener {port} 127.0.0.1", "allow_anonymous true", f"cafile {authority.ca_file}",
        f"certfile {certificate}", f"keyfile {key}", "user root", *more,
    )  # fmt: skip
    with mosquitto(folder, *lines, port=port) as server:
        yield server


def test_what_goes_over_a_bridge_of_two_brokers_warns_there(tmp_path: Path) -> None:
    with mosquitto(tmp_path) as near:
        port = free_port()
        lines = (
            f"listener {port} 127.0.0.1", "allow_anonymous true", "connection site", f"address 127.0.0.1:{near.port}",
            "topic standoff/yard/device/foreman/alert in 1", "topic standoff/yard/device/foreman/supervision in 1",
            "topic standoff/yard/device/foreman/ack out 1", "topic standoff/yard/device/foreman/echo out 0",
        )  # fmt: skip
        with (
            mosquitto(tmp_path, *lines, port=port) as far,
            messenger(tmp_path, near.port) as (outbox, workplace),
            Wearable("foreman", far.port) as foreman,
        ):
            until(lambda: foreman.receiver_heard(), 20.0, "supervision over the bridge")
            raise_alert(outbox, workplace, 1)
            until(lambda: foreman.alerts(), what="an alert over the bridge")
            foreman.press_enter()
            until(lambda: "hazard-0001" in outbox.acknowledged(), what="an acknowledgement over the bridge")


@pytest.mark.parametrize("scheme", ["rtsps", "rtmps"])
def test_a_sender_for_which_nobody_vouches_hears_nothing(scheme: str, tmp_path: Path) -> None:
    good, other = Authority.make(tmp_path / "good"), Authority.make(tmp_path / "other")
    certificate, key = other.certify("sender")
    heard: list[bytes] = []
    with tls_server(certificate, key, heard) as port:
        address = LiveAddress.read(f"{scheme}://localhost:{port}/live/x", "viewer", PASSWORD, good.ca_file)
        with pytest.raises(StreamUnreachable) as refused:
            LiveStream(address)
        time.sleep(0.3)
        assert not b"".join(heard) and PASSWORD not in str(refused.value)
        with pytest.raises(StreamUnreachable):
            LiveStream(LiveAddress.read(f"{scheme}://localhost:{port}/live/x", ca_file=other.ca_file))
        until(lambda: b"".join(heard), what="words, where somebody vouches")


@contextmanager
def tls_server(certificate: Path, key: Path, heard: list[bytes]) -> Generator[int, None, None]:
    """Listen with TLS; keep what is said."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate, key)
    listening = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = listening.accept()
                with (
                    contextlib.suppress(OSError),
                    connection,
                    context.wrap_socket(connection, server_side=True) as secure,
                ):
                    heard.append(secure.recv(4096))

    threading.Thread(target=serve, daemon=True).start()
    try:
        yield int(listening.getsockname()[1])
    finally:
        listening.shutdown(socket.SHUT_RDWR)
        listening.close()


def test_messages_that_are_none_are_refused_and_counted(tmp_path: Path) -> None:
    with mosquitto(tmp_path) as broker, messenger(tmp_path, broker.port) as (outbox, workplace):
        sender = Listener(broker.port, "nothing")
        until(lambda: sender.connections)
        bad: list[tuple[str, Any]] = [
            ("foreman/position", {"x_m": 1}), ("foreman/position", {"x_m": "1", "y_m": 2, "sigma_m": 1}),
            ("foreman/ack", {}), ("foreman/echo", {"id": 3}), ("stranger/ack", {"hazard_id": "x"}), ("foreman/ack", []),
        ]  # fmt: skip
        for topic, body in bad:
            sender.send(f"standoff/yard/device/{topic}", json.dumps(body).encode())
        sender.send("standoff/yard/device/foreman/ack", b"\xff\x00{")
        until(
            lambda: (workplace.record("messenger").read() or {})["refused"] == len(bad) + 1, what="that all are refused"
        )
        raise_alert(outbox, workplace, 1)
        until(lambda: outbox.counts().get("delivered", 0) >= 2, what="that it still tells")
        sender.close()
