"""Who reaches the page: a token in its address, and `Host` and `Origin` checked for HTTP and for the websocket.

A web page from elsewhere, open in a browser on the same machine, can send requests to any address, this one too. Such a
page knows no token, its websocket has its own `Origin`, and a name of its own that it lets point to this machine (DNS
rebinding) is no `Host` that the gate lets through.
"""

from __future__ import annotations

import contextlib
import hmac
import html
import http
import io
import ipaddress
import re
import secrets
import socket
import threading
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from sigmaik import Error

from .gauges import printable

if TYPE_CHECKING:
    import viser

__all__ = ["Gate", "open_server"]

#: Nothing else may show the page in a frame, learn its address, or keep it.
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
#: On a phone viser's panel covers the right of the picture; here it takes the lower half, and the picture the upper.
_PHONE = b"""<style>@media (max-width: 36em) {
  .mantine-Paper-root[style*="position: fixed"][style*="width: 20em"] {
    width: 100% !important;
    max-height: 50% !important;
  }
  .mantine-Paper-root div[style*="width: 20em"] { width: 100% !important; }
  div[style*="overflow: hidden"][style*="flex-grow: 1"][style*="height: 100%"] { height: 50% !important; }
}</style></head>"""
_PATCHING = threading.Lock()


class Gate:
    """What a request must have to get through."""

    def __init__(self, host: str, names: Iterable[str] = (), title: str = "sigmaik") -> None:
        """
        host: the address that the server listens on
        names: further names of the page's host, for example behind a proxy
        title: of the browser's tab
        """
        self.token = secrets.token_urlsafe(24)
        self.opened = False  # whether a server has taken the gate
        self._title = printable(title)
        self._local = _is_loopback(host)
        own = () if self._local else (socket.gethostname(), f"{socket.gethostname()}.local")
        self._names = {name.lower() for name in ("localhost", host, *own, *names)}

    def refusal(self, path: str, hosts: list[str], origins: list[str]) -> str:
        """Why a request is refused; empty where it is let through. All values of the headers `Host` and `Origin`."""
        if len(hosts) != 1 or not self._is_ours(_hostname(hosts[0])):
            return f"the header Host is {', '.join(hosts) or 'missing'}, which is no name of this machine's page"
        # A browser sends the Origin with each websocket. Programs that are no browser need the token alone.
        if len(origins) > 1 or (origins and not _same(origins[0], hosts[0])):
            return f"a page of {', '.join(origins)} must not reach this page"
        if not hmac.compare_digest(path.split("/")[1].encode() if path[:1] == "/" else b"", self.token.encode()):
            return "the address has no token, or the token of another run; take the whole address that was printed"
        return ""

    def _is_ours(self, name: str) -> bool:
        """Names only: the port may be another where the page is reached through a tunnel."""
        try:
            address = ipaddress.ip_address(name)
        except ValueError:
            return name in self._names
        # A number is no name that somebody else could let point to this machine.
        return address.is_loopback if self._local and name not in self._names else True

    def before(self, inner: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        """A `process_request` of websockets that asks the gate before it asks `inner`."""
        self.opened = True

        def process(connection: Any, request: Any) -> Any:
            headers = request.headers
            path = request.path.partition("?")[0]
            reason = self.refusal(path, headers.get_all("Host"), headers.get_all("Origin"))
            if reason:
                return _response(http.HTTPStatus.FORBIDDEN, reason)
            request.path = request.path[1 + len(self.token) :] or "/"
            headers.pop("Accept-Encoding", None)
            response = inner(connection, request)
            if response is not None:
                if response.headers.get("Content-Type", "").startswith("text/html"):
                    self._change_page(response)
                for name, value in _HEADERS.items():
                    response.headers[name] = value
            return response

        return process

    def _change_page(self, response: Any) -> None:
        title = f"<title>{html.escape(self._title)}</title>".encode()
        body = re.sub(rb"<title>[^<]*</title>", lambda _: title, bytes(response.body), count=1)
        response.body = body.replace(b"</head>", _PHONE, 1)
        del response.headers["Content-Length"]
        response.headers["Content-Length"] = str(len(response.body))


def open_server(host: str, port: int, label: str, gate: Gate) -> tuple[viser.ViserServer, str]:
    """A server of viser behind the gate, and the page's whole address. Error where the port is taken."""
    import viser
    import websockets.asyncio.server as websockets_server
    from viser import _messages

    _require_free(host, port)
    serve = websockets_server.serve

    def guarded(handler: Any, *args: Any, **options: Any) -> Any:
        if getattr(handler, "__module__", "") == "viser.infra._infra":
            options["process_request"] = gate.before(options["process_request"])
        return serve(handler, *args, **options)

    # viser has no way to see a request, so its call of `serve` is led through the gate while the server starts.
    with _PATCHING, quiet():
        websockets_server.serve = guarded  # type: ignore[assignment,misc]
        try:
            server = viser.ViserServer(host=host, port=port, label=printable(label), verbose=False)
        finally:
            websockets_server.serve = serve  # type: ignore[misc]
    taken = server.get_port()
    if not gate.opened or (port and taken != port):
        with quiet():
            server.stop()
        raise Error(
            f"viser took port {taken} instead of {port}"
            if gate.opened
            else f"viser {viser.__version__} starts its server in a way that the page's gate does not know"
        )
    # A tunnel to a public address is none of the page's features.
    server._websock_server.unregister_handler(_messages.ShareUrlRequest)
    shown = f"[{host}]" if ":" in host else host
    return server, f"http://{shown}:{taken}/{gate.token}/"


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Suppresses the banner of viser."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield


def _require_free(host: str, port: int) -> None:
    try:
        addresses = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except (OSError, UnicodeError) as error:
        raise Error(f"cannot listen on '{ascii(host)[1:-1]}': {error}") from None
    for family, kind, protocol, _, address in addresses:
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(address)
            except OSError as error:
                raise Error(
                    f"cannot listen on port {port} of {host}: {error.strerror}; end the program that listens there, or "
                    "choose another port (0: a free one)"
                ) from None


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


def _hostname(netloc: str) -> str:
    """The name or number of host:port in lower case; empty where there is none."""
    try:
        parts = urlsplit(f"//{netloc}")
        clean = parts.netloc == netloc and "@" not in netloc
        return (parts.hostname or "") if clean and (parts.port is None or parts.port >= 0) else ""
    except ValueError:
        return ""


def _same(origin: str, host: str) -> bool:
    try:
        parts = urlsplit(origin)
    except ValueError:
        return False
    return parts.scheme in ("http", "https") and parts.netloc.lower() == host.lower() and not parts.path


def _response(status: http.HTTPStatus, text: str) -> Any:
    from websockets.datastructures import Headers
    from websockets.http11 import Response

    body = f"{text}\n".encode("utf-8", "replace")
    headers = Headers(**{"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body))}, **_HEADERS)
    return Response(int(status), status.phrase, headers, body)
