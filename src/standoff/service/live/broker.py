"""One connection to an MQTT broker after another, for ever: MQTT 5, or 3.1.1 without expiry.

Each connection is a client of its own. paho keeps what was not confirmed and sends it again with the expiry that it had
at first: what was true then may not be true any more, and only the outbox knows.
"""

from __future__ import annotations

import contextlib
import queue
import ssl
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeVar

import paho.mqtt.client as mqtt
from paho.mqtt.enums import CallbackAPIVersion, MQTTErrorCode
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties

from standoff.service.live.backoff import Backoff
from standoff.service.live.log import log_of

_KEEPALIVE_S: Final = 5
_CONNECT_S: Final = 3.0
_LONGEST_PAUSE_S: Final = 1.0
"""Between two attempts: while the broker is away nobody is warned."""
_MOST_IN_FLIGHT: Final = 100
_MOST_QUEUED: Final = 1000
_QOS: Final = 1


Waiting = TypeVar("Waiting")


@dataclass(frozen=True, slots=True)
class BrokerAccess:
    """Where a broker is, and who asks.

    Attributes:
        host: Name or number of its machine.
        port: On it.
        is_secure: By TLS; the broker's certificate is verified.
        user: Account; empty: none.
        password: Never shown.
        ca_file: Certificates that vouch for it; empty: those of this machine.
        cert_file: Own certificate; empty: none.
        key_file: Its key.
        is_v5: MQTT 5, not 3.1.1.
    """

    host: str
    port: int
    is_secure: bool = False
    user: str = ""
    password: str = ""
    ca_file: str = ""
    cert_file: str = ""
    key_file: str = ""
    is_v5: bool = True

    def __repr__(self) -> str:
        return f"{'mqtts' if self.is_secure else 'mqtt'}://{self.host}:{self.port}"


@dataclass(frozen=True, slots=True)
class Connected:
    """The broker has let us in."""


@dataclass(frozen=True, slots=True)
class Disconnected:
    """The broker is away.

    Attributes:
        reason: Why.
    """

    reason: str


@dataclass(frozen=True, slots=True)
class Confirmed:
    """The broker has taken a message over.

    Attributes:
        token: Of `Broker.send`.
    """

    token: str


@dataclass(frozen=True, slots=True)
class Received:
    """Somebody sent something.

    Attributes:
        topic: On which.
        payload: What; anything.
        at_s: When, monotonic.
    """

    topic: str
    payload: bytes
    at_s: float


BrokerNews = Connected | Disconnected | Confirmed | Received


@dataclass(frozen=True, slots=True)
class LastWill:
    """What the broker says when we are gone without a word.

    Attributes:
        topic: On which; retained.
        online: What we say when we come.
        offline: What it says then.
    """

    topic: str
    online: bytes
    offline: bytes


class Broker:
    """Holds a connection for as long as it lives; all news come through one queue, in the caller's own thread.

    Args:
        access: Where and who.
        client_id: Of this client; two with the same one throw each other out.
        topics: What it wants to hear.
        will: For who watches us; None: nothing.
    """

    def __init__(
        self, access: BrokerAccess, client_id: str, topics: Sequence[str], will: LastWill | None = None
    ) -> None:
        self._access, self._client_id = access, client_id
        self._topics, self._will = list(topics), will
        self.news: queue.SimpleQueue[BrokerNews] = queue.SimpleQueue()
        self._log = log_of("broker", broker=repr(access))
        self._lock = threading.Lock()
        self._client: mqtt.Client | None = None
        self._sent = _Sent()
        self._down = threading.Event()
        self._is_ended = threading.Event()
        self._thread = threading.Thread(target=self._hold, name="broker", daemon=True)
        self._thread.start()

    def send(
        self, topic: str, payload: bytes, *, token: str = "", retained: bool = False, expiry_s: float | None = None,
        content_type: str = "", qos: int = _QOS,
    ) -> bool:  # fmt: skip
        """Publish; return whether a connection took it. `Confirmed` follows where a token is given.

        Args:
            topic: Where to.
            payload: What.
            token: Names it in `Confirmed`.
            retained: The broker keeps it.
            expiry_s: The broker drops it after so long.
            content_type: MQTT 5 tells it along.
            qos: 0: nobody confirms.
        """
        with self._lock:
            client = self._client
            if client is None or len(self._sent.tokens) >= _MOST_IN_FLIGHT:
                return False
            properties = self._properties(expiry_s, content_type)
            told = client.publish(topic, payload, qos, retained, properties)
            if told.rc != MQTTErrorCode.MQTT_ERR_SUCCESS:
                # It would be sent later all the same: this client is given up.
                self._down.set()
                return False
            if token and qos:
                self._sent.tokens[told.mid] = token
                self._match(told.mid)
        return True

    def _match(self, mid: int) -> None:
        """Tell that a message is confirmed, once it is known both as sent and as confirmed, whichever came first.

        Without a lock: paho calls `on_publish` while it holds one of its own, which `publish` waits for.
        """
        sent = self._sent
        if mid in sent.confirmed and (token := sent.tokens.pop(mid, None)) is not None:
            sent.confirmed.discard(mid)
            self.news.put(Confirmed(token))

    def _properties(self, expiry_s: float | None, content_type: str) -> Properties | None:
        if not self._access.is_v5:
            return None
        properties = Properties(PacketTypes.PUBLISH)  # type: ignore[no-untyped-call]
        if expiry_s is not None:
            properties.MessageExpiryInterval = max(1, int(expiry_s))
        if content_type:
            properties.ContentType = content_type
        return properties

    def close(self) -> None:
        """Say good-bye."""
        self._is_ended.set()
        self._down.set()
        self._thread.join(_CONNECT_S)

    def _hold(self) -> None:
        backoff = Backoff()
        while not self._is_ended.is_set():
            self._down.clear()
            client = self._new_client()
            reason = ""
            try:
                client.connect(self._access.host, self._access.port, _KEEPALIVE_S, **self._start())
                client.loop_start()
                self._down.wait()
            except (OSError, ValueError) as error:
                reason = str(error) or type(error).__name__
                self._log.info("broker not reached", reason=reason)
            was_connected = self._forget(client)
            if was_connected:
                backoff.succeeded()
            if not self._is_ended.is_set():
                self.news.put(Disconnected(reason or "the connection broke"))
                self._is_ended.wait(min(backoff.failed(time.monotonic()), _LONGEST_PAUSE_S))

    def _forget(self, client: mqtt.Client) -> bool:
        """Let go of a client and all that it had not sent yet; return whether it ever was connected."""
        with self._lock:
            was_connected, self._client = self._client is client, None
            self._sent = _Sent()
        if self._is_ended.is_set() and self._will is not None and was_connected:
            client.publish(self._will.topic, self._will.offline, _QOS, retain=True).wait_for_publish(1.0)
        client.disconnect()
        client.loop_stop()
        return was_connected

    def _start(self) -> dict[str, Any]:
        return {"clean_start": True} if self._access.is_v5 else {}

    def _new_client(self) -> mqtt.Client:
        version = mqtt.MQTTv5 if self._access.is_v5 else mqtt.MQTTv311
        clean = None if self._access.is_v5 else True
        client = mqtt.Client(
            CallbackAPIVersion.VERSION2, self._client_id, clean, protocol=version, reconnect_on_failure=False
        )
        client.connect_timeout = _CONNECT_S
        client.max_inflight_messages_set(_MOST_IN_FLIGHT)
        client.max_queued_messages_set(_MOST_QUEUED)
        access = self._access
        if access.user:
            client.username_pw_set(access.user, access.password or None)
        if access.is_secure:
            context = ssl.create_default_context(cafile=access.ca_file or None)
            if access.cert_file:
                context.load_cert_chain(access.cert_file, access.key_file)
            client.tls_set_context(context)
        if self._will is not None:
            client.will_set(self._will.topic, self._will.offline, _QOS, retain=True)
        client.on_connect = self._on_connect
        client.on_disconnect = lambda *_: self._down.set()
        client.on_message = self._on_message
        client.on_publish = self._on_publish
        return client

    def _on_connect(self, client: mqtt.Client, _data: object, _flags: object, code: Any, _more: object) -> None:  # noqa: ANN401 - paho's
        if code.is_failure:
            self._log.warning("the broker does not let us in", reason=str(code))
            self._down.set()
            return
        if self._topics:
            client.subscribe([(topic, _QOS) for topic in self._topics])
        if self._will is not None:
            client.publish(self._will.topic, self._will.online, _QOS, retain=True)
        with self._lock:
            self._client = client
        self._log.info("connected")
        self.news.put(Connected())

    def _on_message(self, _client: object, _data: object, message: mqtt.MQTTMessage) -> None:
        self.news.put(Received(message.topic, bytes(message.payload), time.monotonic()))

    def _on_publish(self, client: mqtt.Client, _data: object, mid: int, *_: object) -> None:
        if client is self._client:
            self._sent.confirmed.add(mid)
            self._match(mid)


def waiting_in(waiting: queue.SimpleQueue[Waiting]) -> Iterator[Waiting]:
    """Yield what is there, and wait for nothing."""
    with contextlib.suppress(queue.Empty):
        while True:
            yield waiting.get_nowait()


class _Sent:
    """What was sent over one connection: by message number, tokens, and which are confirmed."""

    def __init__(self) -> None:
        self.tokens: dict[int, str] = {}
        self.confirmed: set[int] = set()
