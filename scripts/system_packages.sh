#!/usr/bin/env bash
# Install the Debian packages that the tests of `ssiam live` need: a browser and an RTSP server.
# Without them those tests are skipped.
set -euo pipefail
needed=(chromium gir1.2-gst-rtsp-server-1.0 python3-gi gstreamer1.0-plugins-good gstreamer1.0-plugins-bad)
if dpkg --status "${needed[@]}" >/dev/null 2>&1; then exit 0; fi
if ! command -v apt-get >/dev/null || [ "$(id -u)" != 0 ]; then
    echo "not root on Debian: without ${needed[*]} some tests are skipped"
    exit 0
fi
apt-get update --quiet
DEBIAN_FRONTEND=noninteractive apt-get install --quiet --yes --no-install-recommends "${needed[@]}"
