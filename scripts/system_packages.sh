#!/usr/bin/env bash
# What the tests of `ssiam live` need of a Debian system: a browser, and an RTSP server. Where it
# cannot be installed those tests are skipped, and say so.
set -euo pipefail
needed=(chromium gir1.2-gst-rtsp-server-1.0 python3-gi gstreamer1.0-plugins-good gstreamer1.0-plugins-bad)
if dpkg --status "${needed[@]}" >/dev/null 2>&1; then exit 0; fi
if ! command -v apt-get >/dev/null || [ "$(id -u)" != 0 ]; then
    echo "not root on Debian: without ${needed[*]} some tests are skipped"
    exit 0
fi
apt-get update --quiet
DEBIAN_FRONTEND=noninteractive apt-get install --quiet --yes --no-install-recommends "${needed[@]}"
