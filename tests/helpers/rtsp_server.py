"""A program: an RTSP server that plays an H.264 mp4 in a loop. Arguments: PORT CLIP.

It uses GStreamer, whose bindings only the system's Python has. The clip must start with a key frame
and have no B-frames.
"""

import itertools
import sys

import gi

gi.require_version("Gst", "1.0")
gi.require_version("GstRtspServer", "1.0")
from gi.repository import GLib, Gst, GstRtspServer  # noqa: E402

FPS = 25
STEP = Gst.SECOND // FPS


def packets_of(clip):
    """The clip's format and its packets."""
    pipeline = Gst.parse_launch(
        "filesrc name=file ! qtdemux ! video/x-h264 ! appsink name=out sync=false"
    )
    pipeline.get_by_name("file").set_property("location", clip)
    out = pipeline.get_by_name("out")
    pipeline.set_state(Gst.State.PLAYING)
    packets = []
    while (sample := out.emit("pull-sample")) is not None:
        caps = sample.get_caps()
        buffer = sample.get_buffer()
        packets.append(buffer.extract_dup(0, buffer.get_size()))
    pipeline.set_state(Gst.State.NULL)
    return caps, packets


class Loop:
    """Feeds a pipeline in real time, without end."""

    def __init__(self, caps, packets):
        self._caps = caps
        self._packets = packets

    def play(self, factory, media):
        source = media.get_element().get_by_name("source")
        source.set_property("caps", self._caps)
        numbers = itertools.count()
        GLib.timeout_add(1000 // FPS, lambda: self._push(source, next(numbers)))

    def _push(self, source, number):
        buffer = Gst.Buffer.new_wrapped(self._packets[number % len(self._packets)])
        buffer.pts = buffer.dts = number * STEP
        buffer.duration = STEP
        return source.emit("push-buffer", buffer) in (Gst.FlowReturn.OK, Gst.FlowReturn.FLUSHING)


def main(port, clip):
    Gst.init(None)
    server = GstRtspServer.RTSPServer()
    server.set_address("127.0.0.1")
    server.set_service(port)
    factory = GstRtspServer.RTSPMediaFactory()
    factory.set_launch(
        "( appsrc name=source is-live=true format=time ! rtph264pay name=pay0 config-interval=1 )"
    )
    factory.connect("media-configure", Loop(*packets_of(clip)).play)
    server.get_mount_points().add_factory("/clip", factory)
    server.attach(None)
    GLib.MainLoop().run()


if __name__ == "__main__":
    main(*sys.argv[1:])
