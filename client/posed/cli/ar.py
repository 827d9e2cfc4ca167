"""`posed ar`: the page of the AR client."""

import argparse
import contextlib
import datetime
import ipaddress
import math
import mimetypes
import signal
import socket
import sys
from pathlib import Path
from typing import Any

from posed.binder.runtime import runtime_directory
from posed.cli.options import add_rate_mode_option, position
from posed.client.launcher import daemon_listens
from posed.errors import InvalidArgumentError, MissingExtraError

_PORT = 8474
# What the extra `web` brings and this command needs.
_EXTRA = ("starlette", "uvicorn", "websockets", "pygeomag")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the page shows, and where it is served."""
    places = parser.add_argument_group("places")
    places.add_argument("--places", type=Path, metavar="FILE", help="GeoJSON (default: a sample of Thessaloniki)")
    places.add_argument("--crs", metavar="CODE", help="of the file's coordinates if not WGS 84, such as EPSG:2100")
    places.add_argument(
        "--heights",
        type=_heights,
        metavar="ellipsoidal|geoid:N",
        help="what heights are above; N: metres of the geoid above the ellipsoid there (default: ellipsoidal)",
    )
    view = parser.add_argument_group("view")
    behind = view.add_mutually_exclusive_group()
    behind.add_argument("--panorama", type=Path, metavar="FILE", help="picture all around, in place of the drawn world")
    behind.add_argument("--photo", type=Path, metavar="FILE", help="still photograph, in place of the drawn world")
    view.add_argument(
        "--declination",
        type=_declination,
        metavar="DEG",
        help="of magnetic north, east positive (default: the truth's, else WMM 2025)",
    )
    view.add_argument(
        "--position",
        type=position,
        metavar="LAT,LON,HEIGHT",
        help="where the phone is while the daemon does not know: degrees, metres above the ellipsoid"
        " (default: the viewpoint of the file)",
    )
    view.add_argument(
        "--corrections", type=Path, metavar="FILE", help="where pose corrections are kept (default: with your own data)"
    )
    add_rate_mode_option(parser)
    served = parser.add_argument_group("server")
    served.add_argument(
        "--host",
        type=_host,
        default="127.0.0.1",
        metavar="ADDRESS",
        help="address to be reached at (default: 127.0.0.1)",
    )
    served.add_argument(
        "--port", type=_port, default=_PORT, metavar="N", help=f"0 takes any that is free (default: {_PORT})"
    )
    parser.epilog = """\
Prints a link that lets one browser in, and the next link once that one was used. Serves until Ctrl-C or SIGTERM.

The poses are those of the daemon that runs. If none does, one with a simulated phone is started, and started again
should it die; it ends with this command. What the phone does is the daemon's affair: posed start --source sim:compass.

GeoJSON properties that are used: name, note, color, ground (height of the ground under a point). A place without a
height is drawn level with the eye. Heights above sea level, as maps have them, are above the geoid: your geodetic
survey tells its height above the ellipsoid; one value will do, as it changes by a few centimetres a kilometre.

Beyond this machine (--host) the page comes over plain HTTP: who can read along can take part, and browsers give such a
page no camera."""


def run(arguments: argparse.Namespace) -> int:
    """Serve until told to stop."""
    try:
        from posed.ar.app import ArContent, make_app
        from posed.ar.corrections import CorrectionStore, default_path
        from posed.ar.places import SAMPLE, load_places
        from posed.ar.stream import ServiceFeed
        from posed.web.server import guarded, listen, make_server
    except ImportError as error:
        needed = (error.name or "").partition(".")[0]
        if needed not in _EXTRA:
            raise
        raise MissingExtraError(f"posed ar needs {needed}; install it with: pip install 'posed[web]'") from error

    signal.signal(signal.SIGTERM, signal.default_int_handler)
    places = load_places(arguments.places or SAMPLE, crs=arguments.crs, geoid_undulation_m=arguments.heights)
    if arguments.places is None and (arguments.crs is not None or arguments.heights is not None):
        raise InvalidArgumentError("--crs and --heights say how to read the file of --places; name that too")
    background = arguments.panorama or arguments.photo
    if background is not None:
        _require_picture(background)
    content = ArContent(places, _settings(arguments, places["viewpoint"]), background)
    if places["places"] and places["viewpoint"] is None and arguments.position is None:
        print(
            "posed: the file names no viewpoint: its places show once the daemon knows the phone's position, or with"
            " --position LAT,LON,HEIGHT",
            file=sys.stderr,
        )
    corrections = CorrectionStore(arguments.corrections or default_path())
    corrections.load()  # better refused now than when the user saves one
    runtime_directory()  # so too what would keep the feed from starting
    feed = ServiceFeed(arguments.mode, auto_create=not daemon_listens())
    # uvicorn shuts down in order at a signal and passes it on.
    with contextlib.suppress(KeyboardInterrupt), listen(arguments.host, arguments.port) as bound:
        app = guarded(make_app(feed, content, corrections), bound, arguments.host, _tell_link)
        make_server(app).run(sockets=[bound])
    return 0


def _settings(arguments: argparse.Namespace, viewpoint: dict[str, float] | None) -> dict[str, Any]:
    """Return what the page is told beside the places; see ar/page/scene.js."""
    from posed.ar.declination import wmm_declination_deg

    stated = None
    if arguments.position is not None:
        stated = dict(zip(("latitude", "longitude", "height"), arguments.position, strict=True))
    here = stated or viewpoint
    return {
        "declination_deg": arguments.declination,
        "wmm_declination_deg": here and wmm_declination_deg(here["latitude"], here["longitude"], datetime.date.today()),
        "position": stated,
        "rate_mode": arguments.mode,
        "background": "panorama" if arguments.panorama else "photo" if arguments.photo else None,
    }


def _tell_link(link: str) -> None:
    # A reader that took the first link and went must not end those who follow it.
    with contextlib.suppress(BrokenPipeError):
        print(f"AR page, for one browser: {link}", flush=True)


def _require_picture(path: Path) -> None:
    kind = mimetypes.guess_type(path.name)[0] or ""
    if not kind.startswith("image/"):
        raise InvalidArgumentError(f"{path} is no picture by its name; give a .jpg, .png or .webp")
    try:
        path.open("rb").close()
    except OSError as error:
        raise InvalidArgumentError(f"cannot read {path}: {error.strerror}") from error


def _heights(text: str) -> float | None:
    if text == "ellipsoidal":
        return None
    kind, _, undulation = text.partition(":")
    try:
        metres = float(undulation) if kind == "geoid" else math.nan
    except ValueError:
        metres = math.nan
    if not abs(metres) <= 120:
        raise argparse.ArgumentTypeError(
            f"{text!r}; give ellipsoidal, or geoid:N with the geoid's height above the ellipsoid, -120 to 120 m"
        )
    return metres


def _declination(text: str) -> float:
    try:
        degrees = float(text)
    except ValueError:
        degrees = math.nan
    if not abs(degrees) <= 180:
        raise argparse.ArgumentTypeError(f"{text!r} is no declination; give degrees from -180 to 180, east positive")
    return degrees


def _host(text: str) -> str:
    """Return an address or name as browsers spell it, which requests are compared with."""
    try:
        address = ipaddress.ip_address(text.strip("[]"))
    except ValueError:
        try:
            address = ipaddress.ip_address(socket.inet_aton(text))  # short forms, such as 127.1
        except OSError:
            return text.lower()
    if address.is_unspecified:
        raise argparse.ArgumentTypeError(
            f"{text} stands for every address; give the one by which the page is to be reached"
        )
    return str(address)


def _port(text: str) -> int:
    if not text.isdecimal() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"{text!r} is no port; give 0 to 65535")
    return int(text)
