"""A ground station that follows a script."""

import socket
import time

from pymavlink.dialects.v20 import common as mavlink

SECONDS = 10  # after which a test gives up
HERE = "127.0.0.1"
# Results of commands, MAV_RESULT.
ACCEPTED, LATER, DENIED, UNSUPPORTED, FAILED = range(5)
# Commands and messages of a camera that tracks.
RECTANGLE, POINT = mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE, mavlink.MAV_CMD_CAMERA_TRACK_POINT
STOP, INTERVAL = mavlink.MAV_CMD_CAMERA_STOP_TRACKING, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
REQUEST = mavlink.MAV_CMD_REQUEST_MESSAGE
STATUS = mavlink.MAVLINK_MSG_ID_CAMERA_TRACKING_IMAGE_STATUS
INFORMATION = mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION
# What it says of its target, CAMERA_TRACKING_STATUS_FLAGS.
IDLE, ACTIVE, ERROR = 0, 1, 2


class GroundStation:
    """System 255, component 190, on a UDP port of its own.

    `peer` is the camera's address; None: the one that the first message comes from.
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

    def until(self, name, seconds=SECONDS, wanted=lambda message: True):
        """The next message of that name, or None."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            message = self.receive(left)
            if message and message.get_type() == name and wanted(message):
                return message
        return None

    def status(self, wanted=lambda status: True):
        return self.until("CAMERA_TRACKING_IMAGE_STATUS", wanted=wanted)

    def send(self, message):
        self.send_bytes(bytes(message.pack(self.mavlink)))

    def send_bytes(self, data):
        if self.peer is None:
            assert self.receive() is not None
        self.socket.sendto(data, self.peer)

    def ask(self, command, *params, to=(1, 100), confirmation=0, seconds=SECONDS):
        """Send a command; the result in its acknowledgement, None where there is none."""
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
