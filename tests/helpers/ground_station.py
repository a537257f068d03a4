"""A scripted ground station."""

import socket
import time

from pymavlink.dialects.v20 import common as mavlink

SECONDS = 10  # timeout of a test
HERE = "127.0.0.1"
# MAV_RESULT.
ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = range(5)
# Commands and messages of a tracking camera.
RECTANGLE, POINT = mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE, mavlink.MAV_CMD_CAMERA_TRACK_POINT
STOP, INTERVAL = mavlink.MAV_CMD_CAMERA_STOP_TRACKING, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
REQUEST = mavlink.MAV_CMD_REQUEST_MESSAGE
STATUS = mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_IMAGE_STATUS
INFORMATION = mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION
# CAMERA_TRACKING_STATUS_FLAGS.
IDLE, ACTIVE, ERROR = 0, 1, 2


class GroundStation:
    """System 255, component 190, on a free UDP port.

    `peer` is the camera's address, by default the sender of the first message.
    """

    def __init__(self, peer=None):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind((HERE, 0))
        self.address = f"udpout:{HERE}:{self.socket.getsockname()[1]}"
        self.peer = peer
        self.mavlink = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)

    def __enter__(self):
        return self

    def __exit__(self, *exc):
        self.socket.close()

    def receive(self, seconds=SECONDS):
        """The next message, or None."""
        self.socket.settimeout(max(seconds, 1e-3))
        try:
            data, self.peer = self.socket.recvfrom(2048)
        except TimeoutError:
            return None
        return self.mavlink.decode(bytearray(data))

    def until(self, name, seconds=SECONDS, condition=lambda message: True):
        """The next message of this type that meets the condition, or None."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            message = self.receive(left)
            if message and message.get_type() == name and condition(message):
                return message
        return None

    def status(self, condition=lambda status: True):
        return self.until("CAMERA_TRACKING_IMAGE_STATUS", condition=condition)

    def send(self, message):
        self.send_bytes(bytes(message.pack(self.mavlink)))

    def send_bytes(self, data):
        if self.peer is None:
            assert self.receive() is not None
        self.socket.sendto(data, self.peer)

    def ask(self, command, *params, to=(1, 100), confirmation=0, seconds=SECONDS):
        """Send a command; returns the result in its COMMAND_ACK, or None without one."""
        self.send(command_long(command, *params, to=to, confirmation=confirmation))
        return self.result(command, seconds)

    def result(self, command, seconds=SECONDS):
        ack = self.until("COMMAND_ACK", seconds, lambda ack: ack.command == command)
        assert ack is None or (ack.target_system, ack.target_component) == (255, 190)
        return ack and ack.result


def command_long(command, *params, to=(1, 100), confirmation=0):
    params = [*params, 0, 0, 0, 0, 0, 0, 0][:7]
    return mavlink.MAVLink_command_long_message(*to, command, confirmation, *params)


def free_port(kind=socket.SOCK_DGRAM):
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind((HERE, 0))
        return probe.getsockname()[1]
