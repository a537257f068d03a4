"""`download`: a published file, resumed after interruptions and checked, over HTTP(S)."""

from __future__ import annotations

import http.client
import os
import re
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from email.message import Message
from pathlib import Path
from typing import IO, Any, Final, TypeAlias
from urllib.parse import urlsplit

from ssiam.addresses import redact_address
from ssiam.errors import WeightsError, one_line
from ssiam.outputs import make_folder, output_error
from ssiam.runtime.files import sha256
from ssiam.runtime.model_zoo import PublishedFile

__all__ = ["ReceivedBytes", "download"]

_TIMEOUT: Final = 30.0  # seconds without a byte, after which a connection counts as cut
_ATTEMPTS: Final = 5  # in a row without a new byte
_WAIT: Final = 0.5  # seconds before the next attempt, doubled after each
_CHUNK: Final = 1 << 16  # bytes
_MAX_BYTES: Final = 2**31  # of a file whose size is not known
_LONGEST_REASON: Final = 80  # characters of a server's own words
_SCHEMES: Final = ("http", "https")
_TAG: Final = re.compile(r"[ -~]{1,200}")  # ASCII, without control characters

ReceivedBytes: TypeAlias = Callable[[int, "int | None"], None]
"""Called with the received and the expected number of bytes, None if that is not known."""


def download(file: PublishedFile, folder: Path, progress: ReceivedBytes | None = None) -> Path:
    """Download a file into a folder; nothing in it is run.

    Bytes grow in ``NAME.part``, from which a later call continues if the server still has the same
    file. Proxies of the environment (``https_proxy``, ``no_proxy``) are used.

    Parameters
    ----------
    file : PublishedFile
    folder : Path
        Created if it does not exist.
    progress : callable, optional

    Returns
    -------
    Path
        ``folder / file.name``.

    Raises
    ------
    WeightsError
        The server does not answer or has no such file, the connection is cut again and again, or
        size or SHA-256 are not those of the publication.
    SinkError
        The file cannot be written.
    """
    target = folder / file.name
    make_folder(folder)
    transfer = _Transfer(file, target.with_name(f"{target.name}.part"), progress)
    failures, most = 0, transfer.received
    try:
        while not transfer.is_complete:
            reason = transfer.attempt()
            if transfer.is_complete:
                break
            # Bytes that are discarded and received again are no progress.
            failures = failures + 1 if transfer.received <= most else 1
            most = max(most, transfer.received)
            if failures == _ATTEMPTS:
                raise WeightsError(
                    f"{file.address}: {reason}, after {transfer.received} bytes; run the command "
                    "again to continue"
                )
            time.sleep(_WAIT * 2 ** (failures - 1))
        transfer.check()
        os.replace(transfer.part, target)
        transfer.tag.unlink(missing_ok=True)
    except OSError as error:
        raise output_error(target, error) from error
    return target


class _Transfer:
    """A download in progress: the partial file, and the server's tag of its version."""

    def __init__(self, file: PublishedFile, part: Path, progress: ReceivedBytes | None) -> None:
        self.file, self.part, self._progress = file, part, progress
        self.tag = part.with_name(f"{part.name}.tag")
        self.is_complete = False
        self._total = file.size
        self._opener = urllib.request.build_opener(_Redirects)

    @property
    def received(self) -> int:
        """Bytes of the part."""
        return self.part.stat().st_size if self.part.exists() else 0

    def attempt(self) -> str:
        """Receive bytes over one connection; the reason if they are not all.

        Raises
        ------
        WeightsError
            Another attempt would not help.
        OSError
            The part cannot be written.
        """
        if self.file.size is not None and self.received == self.file.size:
            self.is_complete = True
            return ""
        request = urllib.request.Request(self.file.address, headers={"User-Agent": "ssiam"})
        tag = self.tag.read_text("latin-1") if self.tag.exists() else ""
        if self.received and _TAG.fullmatch(tag):
            request.add_header("Range", f"bytes={self.received}-")
            request.add_header("If-Range", tag)
        try:
            answer = self._opener.open(request, timeout=_TIMEOUT)
        except urllib.error.HTTPError as error:
            error.close()
            if error.code >= 500:
                return f"the server answers {error.code}"
            if error.code == 416:  # the part is longer than the file: begin again
                self._discard()
                return "the server has fewer bytes than were received"
            reason = "".join(filter(str.isprintable, str(error.reason)))[:_LONGEST_REASON]
            raise WeightsError(
                f"{self.file.address}: the server answers {error.code} ({reason}); get the file "
                "yourself and import it"
            ) from error
        except (ValueError, http.client.InvalidURL):  # they quote it, with its password
            raise WeightsError(
                f"{self.file.address}: leads to an address that cannot be read: that of the proxy "
                "in https_proxy, or a redirection; correct the variable, or get the file yourself"
            ) from None
        except (OSError, http.client.HTTPException) as error:
            return f"no answer ({one_line(error)})"
        with answer:
            return self._receive(answer)

    def _receive(self, answer: Any) -> str:
        resumed = answer.status == 206
        start = self.received if resumed else 0
        if resumed and not answer.headers.get("Content-Range", "").startswith(f"bytes {start}-"):
            self._discard()
            return "the server sent another part than was asked for"
        self._total = self._expected(answer.headers, start)
        if not resumed:
            self._discard()
            self._write_tag(answer.headers)
        limit = self._total if self._total is not None else _MAX_BYTES
        with self.part.open("ab") as part:
            reason = self._copy(answer, part, start, limit)
        if not reason:
            known = self._total is None or self.received == self._total
            self.is_complete = known
            reason = "" if known else f"the connection ended before {self._total} bytes"
        return reason

    def _copy(self, answer: Any, part: IO[bytes], received: int, limit: int) -> str:
        while True:
            try:
                # Not `read`, which takes a chunk of a negative size for all that follows.
                chunk = answer.read1(_CHUNK)
            except http.client.IncompleteRead as error:
                part.write(error.partial)
                return "the connection was cut"
            except (OSError, http.client.HTTPException) as error:
                return f"the connection was cut ({one_line(error)})"
            if not chunk:
                return ""
            received += len(chunk)
            if received > limit:
                self._discard()
                raise WeightsError(
                    f"{self.file.address}: has more than the expected {limit} bytes; it was "
                    "discarded"
                )
            part.write(chunk)
            if self._progress is not None:
                self._progress(received, self._total)

    def _expected(self, headers: Message, start: int) -> int | None:
        """Size of the whole file; `WeightsError` if the server has a file of another size."""
        length = headers.get("Content-Length", "")
        stated = start + int(length) if re.fullmatch("[0-9]{1,18}", length) else None
        ranged = re.fullmatch(
            r"bytes ([0-9]{1,18})-[0-9]+/([0-9]{1,18})", headers.get("Content-Range", "")
        )
        if ranged is not None:
            stated = int(ranged[2])
        if stated is not None and self.file.size is not None and stated != self.file.size:
            self._discard()
            raise WeightsError(
                f"{self.file.address}: has {stated} bytes, the published file has "
                f"{self.file.size}; it was not downloaded"
            )
        return self.file.size if stated is None else stated

    def check(self) -> None:
        """Raise `WeightsError`, and discard the bytes, unless they are those of the publication."""
        found = sha256(self.part)
        if self.file.sha256 not in (None, found):
            self._discard()
            raise WeightsError(
                f"{self.file.address}: SHA-256 {found}, the published file has "
                f"{self.file.sha256}; it was discarded"
            )

    def _write_tag(self, headers: Message) -> None:
        """Keep what identifies this version of the file, for `If-Range`; weak tags do not."""
        tag = headers.get("ETag", "")
        if not tag or tag.startswith("W/"):
            tag = headers.get("Last-Modified", "")
        self.tag.write_text(tag if _TAG.fullmatch(tag) else "", "ascii")

    def _discard(self) -> None:
        self.part.unlink(missing_ok=True)
        self.tag.unlink(missing_ok=True)


class _Redirects(urllib.request.HTTPRedirectHandler):
    """Redirections to HTTP and HTTPS, and never from HTTPS to anything else."""

    def redirect_request(
        self, req: urllib.request.Request, fp: Any, code: int, msg: str, headers: Any, newurl: str
    ) -> urllib.request.Request | None:
        if urlsplit(newurl).scheme not in (("https",) if req.type == "https" else _SCHEMES):
            # A signed address has its key in the query.
            here, there = redact_address(req.full_url), redact_address(newurl)
            raise WeightsError(f"{here}: redirects to {there}, which is not followed")
        return super().redirect_request(req, fp, code, msg, headers, newurl)

    def http_error_302(
        self, req: urllib.request.Request, fp: Any, code: int, msg: str, headers: Any
    ) -> Any:
        fp.close()  # the base reads whatever the server sends with a redirection
        location = headers.get("location", headers.get("uri", ""))
        if urlsplit(location).scheme not in ("", *_SCHEMES):  # the base would quote it
            return self.redirect_request(req, fp, code, msg, headers, location)
        return super().http_error_302(req, fp, code, msg, headers)

    http_error_301 = http_error_303 = http_error_307 = http_error_308 = http_error_302
