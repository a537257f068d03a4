"""`create_app`: the ASGI application: page, WebSocket and files."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.resources import files
from typing import Final

from ssiam.errors import MissingExtraError

try:
    import starlette  # noqa: F401
except ModuleNotFoundError as error:
    if error.name != "starlette":
        raise
    raise MissingExtraError(
        "the package starlette is not installed, which the live page needs: "
        "pip install 'ssiam[web]'"
    ) from error

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route, WebSocketRoute

from ssiam.web.server.clients import Clients
from ssiam.web.server.guard import Access, Guard
from ssiam.web.server.limits import ServerLimits
from ssiam.web.server.service import Service

_PAGE_TYPES: Final = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
}


def create_app(service: Service, access: Access, limits: ServerLimits | None = None) -> Starlette:
    """The application; its `Clients` are ``app.state.clients``.

    Parameters
    ----------
    service : Service
        Its session is started and closed by the caller.
    access : Access
        Who may connect.
    limits : ServerLimits, optional
    """
    clients = Clients(service, limits or ServerLimits())
    page = _read_page()

    async def send_page(request: Request) -> Response:
        name = request.path_params.get("name", service.index)
        if name not in page:
            raise HTTPException(404)
        content, media_type = page[name]
        return Response(content, media_type=media_type)

    async def send_file(request: Request) -> Response:
        try:
            path, filename = service.file(request.path_params["path"])
        except KeyError:
            raise HTTPException(404) from None
        return FileResponse(path, filename=filename)

    async def send_health(request: Request) -> Response:
        newest = service.newest
        number = None if newest is None else newest.number
        status = "ok" if service.state == "running" else service.state
        return JSONResponse({"status": status, "clients": len(clients), "step": number})

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        clients.open()
        yield
        clients.close()

    readable = frozenset({"/", *(f"/page/{name}" for name in page)})
    app = Starlette(
        routes=[
            Route("/", send_page),
            Route("/page/{name}", send_page),
            Route(f"/{service.folder}/{{path:path}}", send_file),
            Route("/health", send_health),
            WebSocketRoute("/session", clients.serve),
        ],
        middleware=[Middleware(Guard, access=access, is_public=readable.__contains__)],
        lifespan=lifespan,
    )
    app.router.redirect_slashes = False
    app.state.clients = clients
    return app


def _read_page() -> dict[str, tuple[bytes, str]]:
    """Content and media type of the page's files, by name. No other file is ever served."""
    page = {}
    for file in files("ssiam.web").joinpath("page").iterdir():
        _, dot, kind = file.name.rpartition(".")
        media_type = _PAGE_TYPES.get(dot + kind)
        if media_type is not None:
            page[file.name] = file.read_bytes(), media_type
    return page
