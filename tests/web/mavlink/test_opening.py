"""Errors when a camera is opened; no side effects on the environment."""

import re
import subprocess
import sys

import pytest

from ssiam.errors import ArgumentError
from ssiam.web.mavlink.camera import MavlinkCamera

WRONG_ADDRESSES = [
    ("nothing", "", "use udpout:HOST:PORT"),
    ("no such kind", "pigeon:1.2.3.4:5", "use udpout:HOST:PORT"),
    ("no port", "udpout:127.0.0.1", "host and a port"),
    ("a word for a port", "udpin:127.0.0.1:mavlink", "host and a port"),
    ("too high a port", "tcp:127.0.0.1:65536", "host and a port"),
    ("no host", "tcp::5760", "host and a port"),
    ("no such host", "udpout:nowhere.invalid:14550", "cannot be used"),
    ("a foreign address", "udpin:192.0.2.1:14550", "cannot be used"),
    ("no such device", "/dev/ttyUSB77,57600", "use udpout:HOST:PORT"),
    ("not a serial port", "/dev/null", "not a serial port"),
    ("a word for a baud rate", "/dev/null,fast", "not a baud rate"),
]


@pytest.mark.parametrize(
    ("address", "words"), [w[1:] for w in WRONG_ADDRESSES], ids=[w[0] for w in WRONG_ADDRESSES]
)
def test_an_invalid_address_is_named_in_one_line(session, address, words):
    with pytest.raises(ArgumentError, match=re.escape(words)) as caught:
        MavlinkCamera(session, address)
    assert address in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_port_in_use_is_named(session, station):
    taken = station.address.replace("udpout", "udpin")
    with pytest.raises(ArgumentError, match="in use"):
        MavlinkCamera(session, taken)


@pytest.mark.parametrize("system", [0, 256, -1])
def test_a_system_out_of_range_is_named(session, station, system):
    with pytest.raises(ArgumentError, match=f"system {system}"):
        MavlinkCamera(session, station.address, system=system)


_WITHOUT = """
import sys
sys.modules["pymavlink"] = None
import ssiam.web.mavlink.camera
"""
_ENVIRONMENT = """
import os
before = {name for name in os.environ if "MAVLINK" in name}
import ssiam.web.mavlink.camera
assert {name for name in os.environ if "MAVLINK" in name} == before
"""


def test_without_pymavlink_the_error_names_the_extra():
    done = subprocess.run([sys.executable, "-c", _WITHOUT], capture_output=True, text=True)
    assert "MissingExtraError" in done.stderr.splitlines()[-1]
    assert "pip install 'ssiam[mavlink]'" in done.stderr


def test_environment_variables_are_not_changed():
    subprocess.run([sys.executable, "-c", _ENVIRONMENT], check=True)
