"""Readings that a broker passes on by MQTT, as Home Assistant, Tasmota, ESPHome and controllers of kilns publish them.

A file (`--map`) says which topic holds what. Each message of the temperature's topic is a look; power and setpoint are
what was last heard of them. A message that the broker has kept (*retained*) may be old: it counts as no reading of the
temperature. Nothing is published.
"""

from __future__ import annotations

import math
import os
import time
from collections import deque
from collections.abc import Mapping
from typing import Any, Final

from paho.mqtt import client as mqtt

from heatertune.errors import InputError, LinkDown
from heatertune.live.client.connection import Address, ClosesOnExit
from heatertune.live.controller_block import Places, Topic
from heatertune.live.poller import Snapshot

__all__ = ["PASSWORD", "MqttSource"]

#: variable of the environment that holds the password of the user in an address
PASSWORD: Final = "HEATERTUNE_MQTT_PASSWORD"
_KEEP_ALIVE_S: Final = 10  # a broker that is silent for longer is gone
_WAIT_S: Final = 0.05


class MqttSource(ClosesOnExit):
    """A connection to a broker; it looks as `heatertune.live.poller.Poller` does.

    Attributes:
        interval_s: None: nobody counts scans, this machine's clock is used.
        torn: 0.
        tells_new: True: each message is a new one.
        whole: False: power and setpoint are of other instants than the temperature.
    """

    interval_s: float | None = None
    torn = 0
    tells_new = True
    whole = False

    def __init__(self, address: Address, places: Places | None, timeout_s: float = 2.0) -> None:
        """Connect and subscribe.

        Args:
            address: of the broker.
            places: which topic holds what.
            timeout_s: after which an answer is lost [s].

        Raises:
            InputError: no topics.
            LinkDown: nobody is there, or the broker refuses the user or a topic.
        """
        if places is None or not places.topics:
            raise InputError(f"{address.text}: which topics hold temperature and power? Say --map FILE.toml, with "
                             '[temperature] topic = "kiln/temperature"')
        self._address, self._topics, self._timeout_s = address, places.topics, timeout_s
        self._begun = time.monotonic()
        self._latest = dict.fromkeys(places.topics, math.nan)
        self._looks: deque[Snapshot] = deque()
        self._client = self._connected()

    @property
    def roles(self) -> Mapping[str, Topic]:
        """What is seen, and the topics."""
        return self._topics

    def _connected(self) -> Any:
        client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
        client.connect_timeout = self._timeout_s
        if self._address.user:
            client.username_pw_set(self._address.user, os.environ.get(PASSWORD))
        answers: list[Any] = []
        client.on_connect = lambda _client, _data, _flags, reason, _properties: answers.append([reason])
        client.on_subscribe = lambda _client, _data, _number, reasons, _properties: answers.append(reasons)
        client.on_message = lambda _client, _data, message: self._take_message(message)
        try:
            client.connect(self._address.host, self._address.port, keepalive=_KEEP_ALIVE_S)
            self._await(client, answers, "the connection")
            client.subscribe([(topic, 0) for topic in sorted({each.topic for each in self._topics.values()})])
            self._await(client, answers, "the topics")
        except OSError as problem:
            client.disconnect()
            raise LinkDown(f"{self._address.text}: no connection: {problem}") from None
        except LinkDown:
            client.disconnect()
            raise
        return client

    def _await(self, client: Any, answers: list[Any], what: str) -> None:
        """Wait for the broker's answer, and refuse one that is no yes."""
        last_s = time.monotonic() + self._timeout_s
        while not answers:
            if client.loop(_WAIT_S) != mqtt.MQTT_ERR_SUCCESS or not time.monotonic() < last_s:
                if answers:  # the broker says why, and closes
                    break
                raise LinkDown(f"{self._address.text}: the broker does not answer to {what}")
        if refused := [str(reason) for reason in answers.pop() if reason.is_failure]:
            raise LinkDown(f"{self._address.text}: the broker refuses {what}: {', '.join(refused)}"
                           + ("" if self._address.user else f"; does it want a user? mqtt://USER@HOST, and {PASSWORD}"))

    def _take_message(self, message: Any) -> None:
        """Take a message of one of the topics."""
        for role, topic in self._topics.items():
            if topic.topic == message.topic and not (message.retain and role == "temperature"):
                self._latest[role] = topic.of(message.payload)
        if message.topic == self._topics["temperature"].topic and not message.retain:
            self._looks.append(Snapshot(time.monotonic() - self._begun, dict(self._latest)))

    def look(self) -> Snapshot | None:
        """Return the content of the next message of the temperature; None: none has come.

        Raises:
            LinkDown: the broker has gone; `again` connects anew.
        """
        if not self._looks and self._client.loop(_WAIT_S) != mqtt.MQTT_ERR_SUCCESS:
            raise LinkDown(f"{self._address.text}: the broker has gone")
        return self._looks.popleft() if self._looks else None

    def again(self) -> None:
        """Connect anew; what was heard of power and setpoint before is no longer believed.

        Raises:
            LinkDown: nobody is there.
        """
        self.close()
        self._latest = dict.fromkeys(self._topics, math.nan)
        self._client = self._connected()

    def close(self) -> None:
        """Close the connection."""
        self._client.disconnect()
