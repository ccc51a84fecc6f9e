"""Who reaches the page and what it survives: over HTTP and the websocket, as a browser and as a page from elsewhere."""

import contextlib
import http.client
import itertools
import os
import signal
import socket
import subprocess
import sys
import time
from urllib.parse import urlsplit

import numpy as np
import pytest

import sigmaik as sk
from sigmaik.teleop import Episode, Session, journal
from sigmaik_lab.__main__ import main

viser = pytest.importorskip("viser")
msgspec = pytest.importorskip("msgspec")

from sigmaik.teleop.controls import fits_rule  # noqa: E402
from sigmaik.teleop.gate import Gate  # noqa: E402
from sigmaik.teleop.meshes import MeshFiles  # noqa: E402
from sigmaik.teleop.page import Page  # noqa: E402
from sigmaik.teleop.settings import Settings  # noqa: E402


def until(condition, seconds=30.0):
    """Waits for the condition; machines may be busy."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.01)


class Browser:
    """A client that speaks viser's protocol."""

    def __init__(self, page, origin=None, url=None, host=None):
        from viser import _messages
        from websockets.sync.client import connect

        self.messages = _messages
        url = urlsplit(url or page.url)
        headers = {} if host is None else {"Host": host}
        self.socket = connect(
            f"ws://{url.netloc}{url.path}",
            origin=origin,
            additional_headers=headers,
            subprotocols=[f"viser-v{viser.__version__}"],
            max_size=None,
            max_queue=None,
            proxy=None,
        )
        before = set(page._server.get_clients())
        self.send(
            _messages.ViewerCameraMessage(
                (1.0, 0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 1.0, 0.1, 10.0, 400, 600, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
            )
        )
        until(lambda: set(page._server.get_clients()) - before)
        (self.id,) = set(page._server.get_clients()) - before

    def send(self, message):
        self.socket.send(msgspec.msgpack.encode(message.as_serializable_dict([])))

    def drag(self, position, wxyz=(0.0, 1.0, 0.0, 0.0)):
        self.send(self.messages.TransformControlsUpdateMessage("/target", wxyz, tuple(map(float, position))))

    def set(self, handle, value=True):
        """Changes a control, or presses a button."""
        self.send(self.messages.GuiUpdateMessage(handle._impl.uuid, {"value": value}))

    def close(self):
        self.socket.close()


@contextlib.contextmanager
def opened_page(directory):
    with Session("ur10", rate=250.0, pose_timeout=60.0) as session:
        page = Page(session, port=0, directory=directory)
        until(lambda: session.latest is not None)
        yield page
        page.close()


@pytest.fixture
def page(tmp_path):
    with opened_page(tmp_path) as page:
        yield page


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    """A page for requests that are refused."""
    with opened_page(tmp_path_factory.mktemp("episodes")) as page:
        yield page


@pytest.fixture
def browsers(page):
    opened = []

    def open_browser(**options):
        opened.append(Browser(page, **options))
        return opened[-1]

    yield open_browser
    for browser in opened:
        browser.close()


def away(page):
    """A position that the tool is not at, within reach."""
    return page.session.chain.pose(page.session.home)[:3, 3] + (0.0, 0.0, 0.15)


def moves(page):
    return page.session.latest["qdot"].any()


# --- the gate


def get(page, path=None, **headers):
    """Status and text of an HTTP request; a header of None is left out."""
    url = urlsplit(page.url)
    connection = http.client.HTTPConnection(url.hostname, url.port, timeout=20.0)
    connection.putrequest("GET", url.path if path is None else path, skip_host=True)
    for name, value in {"Host": url.netloc, **headers}.items():
        for one in [value] if isinstance(value, str) else value or ():
            connection.putheader(name, one)
    connection.endheaders()
    response = connection.getresponse()
    text = response.read().decode()
    connection.close()
    return response, text


def test_the_page_needs_its_whole_address(shared):
    token = urlsplit(shared.url).path.strip("/")
    assert len(token) >= 30
    response, text = get(shared)
    assert response.status == 200
    assert "<title>sigmaik · ur10</title>" in text
    assert response.getheader("Referrer-Policy") == "no-referrer"
    assert response.getheader("X-Frame-Options") == "DENY"
    for path in (
        "/",
        "/index.html",
        "//",
        f"/{token[:-1]}/",
        f"/{token}x/",
        f"/x/{token}/",
        f"/?{token}",
        f"/{token}/../",
    ):
        response, text = get(shared, path)
        assert response.status in (403, 404), path
        assert "<html" not in text
    other = Gate("127.0.0.1")
    assert other.token != token


@pytest.mark.parametrize(
    ("headers", "words"),
    [
        ({"Host": "evil.example"}, "Host is evil.example"),
        ({"Host": "evil.example:8080"}, "Host is evil.example:8080"),
        ({"Host": "localhost.evil.example"}, "Host"),
        ({"Host": "127.0.0.1@evil.example"}, "Host"),
        ({"Host": "192.168.1.4"}, "Host"),
        ({"Host": None}, "Host is missing"),
        ({"Host": ("127.0.0.1", "evil.example")}, "Host"),
        ({"Origin": "http://evil.example"}, "a page of http://evil.example"),
        ({"Origin": "null"}, "a page of null"),
        ({"Origin": "http://localhost:1"}, "a page of http://localhost:1"),
        ({"Origin": "file://"}, "a page of file://"),
        ({"Origin": "http://127.0.0.1"}, "a page of"),
    ],
)
def test_requests_from_elsewhere_are_refused(shared, headers, words):
    response, text = get(shared, **headers)
    assert response.status == 403
    assert words in text


def test_an_own_name_and_tunnel_are_let_through(shared):
    for host in ("localhost:9000", "127.0.0.1:9000", "[::1]:9000", "LOCALHOST"):
        assert get(shared, Host=host, Origin=f"http://{host}")[0].status == 200


def test_a_gate_that_is_open_to_the_network_takes_numbers_and_its_own_names():
    gate = Gate("0.0.0.0", ["lab.example"])
    path = f"/{gate.token}/"
    for host in ("10.0.0.7:8080", "[fe80::1]:8080", socket.gethostname(), "lab.example", "localhost"):
        assert gate.refusal(path, [host], [f"http://{host.lower()}"]) == ""
    for host in ("evil.example", "lab.example.evil.example", "", "10.0.0.7.evil.example", "10.0.0.7:x", "a b"):
        assert "Host" in gate.refusal(path, [host], [])


@pytest.mark.parametrize(
    "options",
    [
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": "https://evil.example:8080"},
        {"host": "evil.example"},
        {"host": "evil.example", "origin": "http://evil.example"},
        {"url": "no token"},
    ],
)
def test_a_websocket_from_elsewhere_is_refused(shared, options):
    from websockets.exceptions import InvalidStatus

    if "url" in options:
        options = {"url": f"http://{urlsplit(shared.url).netloc}/"}
    with pytest.raises(InvalidStatus, match="403"):
        Browser(shared, **options)
    assert shared._server.get_clients() == {}


def test_a_websocket_of_the_page_itself_is_let_through(page, browsers):
    browsers(origin=f"http://{urlsplit(page.url).netloc}").drag(away(page))
    until(lambda: moves(page))


def test_a_taken_port_is_an_error(page, tmp_path, capsys):
    port = urlsplit(page.url).port
    with Session("ur10") as session, pytest.raises(sk.Error, match=f"cannot listen on port {port}"):
        Page(session, port=port, directory=tmp_path)
    assert main(["teleop", "--port", str(port), "--robot", "ur10", "--out", str(tmp_path)]) == 2
    assert f"port {port}" in capsys.readouterr().err
    for host in ("no.such.host.invalid", "203.0.113.1", "\ud800"):
        with Session("ur10") as session, pytest.raises(sk.Error, match="cannot listen on"):
            Page(session, host=host, port=0, directory=tmp_path)


# --- one driver, a latched stop


def test_a_stop_holds_against_the_drag_of_another_browser(page, browsers):
    first, second = browsers(), browsers()
    second.drag(away(page))
    until(lambda: moves(page))
    first.set(_stop_button(page))
    until(lambda: page.session.stopped)
    time.sleep(0.1)
    second.drag(away(page) + (0.0, 0.1, 0.0))
    second.send(second.messages.CommandTriggerMessage(_command(page, "Nudge +z")))
    time.sleep(0.3)
    page.session.read()
    until(lambda: not moves(page))
    assert page.session.goal is None
    assert page.session.why_it_holds == f"Stop was pressed in browser {first.id}"
    until(lambda: "Stop was pressed" in page._controls.status.content)
    until(lambda: page._controls.release.visible)
    first.set(page._controls.release)  # only the driver releases
    time.sleep(0.2)
    assert page.session.stopped
    second.set(page._controls.release)
    until(lambda: not page.session.stopped)
    assert not moves(page)
    second.drag(away(page))
    until(lambda: moves(page))


def _stop_button(page):
    return next(
        handle
        for handle in page._server.gui._gui_input_handle_from_uuid.values()
        if getattr(handle, "label", "") == "Stop"
    )


def _command(page, label):
    return next(uuid for uuid, handle in page._server.gui._command_handle_from_uuid.items() if handle.label == label)


def test_one_browser_drives_and_the_others_see_who(page, browsers):
    first, second = browsers(), browsers()
    until(lambda: "driver   <span id='sk-driver'>nobody of 2" in page._controls.status.content)
    first.drag(away(page))
    until(lambda: moves(page))
    goal = page.session.goal.copy()
    until(lambda: f"browser {first.id} of 2" in page._controls.status.content)
    limits = next(handle for handle, setting, _ in page._controls._settings if setting == "limits")
    second.set(limits, False)
    second.drag(away(page) + (0.0, 0.2, 0.0))
    second.set(page._controls.record)
    time.sleep(0.3)
    np.testing.assert_array_equal(page.session.goal, goal)
    assert page.session.settings.limits
    assert not page.session.recording
    until(lambda: limits.value is True)  # shown again as it is
    second.set(page._controls.take)
    until(lambda: page._seat.driver == second.id)
    assert page.session.goal is None  # it holds for the new driver
    second.set(limits, False)
    until(lambda: not page.session.settings.limits)
    first.drag(away(page))
    time.sleep(0.2)
    assert page.session.goal is None
    second.close()
    until(lambda: page._seat.driver is None)
    first.drag(away(page))
    until(lambda: page.session.goal is not None)
    first.close()
    until(lambda: page.session.goal is None)
    assert page.session.why_it_holds in ("the browser that drove is gone", "the browser that drove did not answer")


class Stick:
    name, held, pushed = "a stick", False, 1.0

    def read(self):
        from sigmaik.teleop.devices import Reading

        return Reading(np.array([0.0, 0.0, self.pushed, 0.0, 0.0, 0.0]), self.held)

    def close(self):
        pass


def test_a_device_is_no_second_driver(page, browsers, monkeypatch):
    stick = Stick()
    monkeypatch.setattr("sigmaik.teleop.page.open_device", lambda name: stick)
    first, second = browsers(), browsers()
    page.open_device("gamepad")  # of the command line: a driver of its own
    stick.held = True
    until(lambda: moves(page))
    first.drag(away(page))
    time.sleep(0.1)
    assert page.session.goal is None
    first.set(page._controls.take)
    until(lambda: not moves(page))  # although its button is held
    first.set(page._controls.device, "gamepad")  # works for this browser
    until(lambda: moves(page))
    assert page._seat.driver == first.id
    first.set(_stop_button(page))
    until(lambda: not moves(page))
    first.set(page._controls.release)
    until(lambda: moves(page))
    second.set(page._controls.take)
    until(lambda: not moves(page))
    stick.held = False
    second.drag(away(page))
    until(lambda: moves(page))
    time.sleep(0.1)
    assert page.session.goal is not None  # a button let go is none of the driver's


# --- what the program survives


def test_an_exception_in_drawing_ends_nothing(page, browsers, monkeypatch, caplog):
    browser = browsers()
    browser.set(page._controls.record)
    until(lambda: page.session.recording)
    browser.drag(away(page))
    until(lambda: moves(page))

    def fail(*_):
        raise RuntimeError("no pencil")

    monkeypatch.setattr(page._scene, "draw", fail)
    until(lambda: page.session.goal is None)
    assert page.session.why_it_holds == "drawing failed: RuntimeError: no pencil"
    recorded = page.session.recorded
    until(lambda: page.session.recorded > recorded + 50)  # the recording goes on
    assert not page._closed.is_set()
    assert sum("no pencil" in record.message for record in caplog.records) == 1  # told once
    monkeypatch.undo()
    browser.drag(away(page) + (0.0, 0.0, 0.1))
    until(lambda: page.session.goal is not None)
    browser.set(page._controls.record)
    until(lambda: page.recorder.files)
    assert len(Episode.load(page.directory / "episode-0000.npz")) > recorded


def test_the_end_of_the_server_saves_the_recording(page, browsers, caplog):
    browsers().set(page._controls.record)
    until(lambda: page.session.recorded > 50)
    assert list(page.directory.glob("*.part"))
    page.close()
    assert [file.name for file in page.directory.iterdir()] == ["episode-0000.npz"]
    assert len(Episode.load(page.directory / "episode-0000.npz")) > 50
    assert "episode-0000.npz" in caplog.text


PROGRAM = """
import signal, sys, threading, time
from sigmaik.teleop import page
from sigmaik_lab.__main__ import main

# The tests may run where these signals are ignored, as under nohup.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGTERM, signal.SIG_DFL)
signal.signal(signal.SIGHUP, signal.SIG_DFL)

class Recorded(page.Page):
    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        threading.Thread(target=self.go, daemon=True).start()

    def go(self):
        self.recorder.start()
        while self.session.recorded < 100:
            time.sleep(0.02)
        print("recording", flush=True)

page.Page = Recorded
sys.exit(main(["teleop", "--robot", "ur10", "--rate", "250", "--port", "0", "--out", sys.argv[1]]))
"""


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
def test_a_recording_of_the_command_survives_its_end(tmp_path, end):
    program = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, tmp_path], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    for line in program.stdout:
        if line == "recording\n":
            break
    program.send_signal(end)
    _, errors = program.communicate(timeout=60.0)
    if end == signal.SIGKILL:
        (part,) = journal.cut_off(tmp_path)
        recorded = len(Episode.load(part))
        with Session("ur10") as session:  # the next run of the page
            page = Page(session, port=0, directory=tmp_path)
            until(lambda: page._controls.episodes.options == ("episode-0000.npz",))
            page.close()
        assert not part.exists()
    else:
        assert program.returncode == 130
        assert "episode-0000.npz" in errors
        recorded = 0
    episode = Episode.load(tmp_path / "episode-0000.npz")
    assert len(episode) > max(recorded - 1, 50)
    np.testing.assert_array_equal(episode.play(), episode["q"])


@pytest.mark.parametrize("when", ["before", "meanwhile", "at save"])
def test_a_full_disk_is_told_and_the_recording_kept_and_saved_elsewhere(page, browsers, tmp_path, full_disk, when):
    browser = browsers()
    if when == "before":
        full_disk(4000)
    browser.drag(away(page))
    browser.set(page._controls.record)
    until(lambda: page.session.recorded > 20)
    if when == "meanwhile":
        full_disk(60_000)
        until(lambda: "in memory only" in page._controls.recorded.content)
    until(lambda: page.session.recorded > 1000 if when == "at save" else page.session.recorded > 200)
    full_disk(4000 if when == "before" else 30_000)
    browser.set(page._controls.record)
    until(lambda: page.recorder.unsaved)
    until(lambda: "is not saved: File too large" in page._controls.recorded.content)
    until(lambda: page._controls.save.visible)
    (unsaved,) = page.recorder.unsaved
    with pytest.raises(sk.Error, match="File too large"):
        page.recorder.save_unsaved(tmp_path)
    with pytest.raises(sk.Error, match="no folder"):
        page.recorder.save_unsaved(tmp_path / "nowhere")
    full_disk(100_000_000)
    (tmp_path / "elsewhere").mkdir()
    browser.set(page._controls.folder, str(tmp_path / "elsewhere"))
    browser.set(page._controls.save)
    until(lambda: not page.recorder.unsaved)
    saved = Episode.load(tmp_path / "elsewhere" / unsaved.name)
    assert saved.samples.tobytes() == unsaved.episode.samples.tobytes()
    until(lambda: not page._controls.save.visible)
    assert list(tmp_path.glob("*.part")) == []


def test_a_malformed_recording_is_refused_and_the_server_goes_on(page, browsers, tmp_path):
    browser = browsers()
    browser.set(page._controls.record)
    until(lambda: page.session.recorded > 30)
    browser.set(page._controls.record)
    until(lambda: page.recorder.files)
    with np.load(tmp_path / "episode-0000.npz") as data:
        arrays = {name: data[name] for name in data.files}
    np.savez(tmp_path / "status.npz", **{**arrays, "status": np.full_like(arrays["status"], 99)})
    np.savez(tmp_path / "no_q.npz", **{name: values for name, values in arrays.items() if name != "q"})
    np.savez(tmp_path / "nan.npz", **{**arrays, "pose": np.full_like(arrays["pose"], np.nan)})
    (tmp_path / "text.npz").write_text("no recording")
    until(lambda: page._controls.episodes.options)
    for name in ("status.npz", "no_q.npz", "nan.npz", "text.npz", "../../etc/passwd", "none"):
        page._controls.episodes.options = (name,)
        browser.set(page._controls.play)
        time.sleep(0.1)
        assert page._replay is None
    episode = Episode.load(tmp_path / "episode-0000.npz")
    samples = episode.samples.copy()
    samples["status"] = 99
    with pytest.raises(sk.Error, match="status 99"):
        page.replay(Episode(samples, episode.arm, episode.dt, episode.settings, episode.before), "made here")
    browser.drag(away(page))
    until(lambda: moves(page))


# --- what a user sees


def test_a_typed_target_is_not_overwritten(page, browsers):
    browser = browsers()
    box = page._controls.position
    until(lambda: box.value != (0.0, 0.0, 0.0))
    typed = tuple((away(page) + (0.01234567, 0.0, 0.0)).tolist())
    browser.set(box, typed)
    until(lambda: moves(page))
    assert box.value == typed
    np.testing.assert_allclose(page.session.goal[:3, 3], typed, atol=1e-12)
    browser.set(_stop_button(page))
    until(lambda: page.session.stopped)
    until(lambda: not moves(page))
    time.sleep(0.3)
    assert box.value == typed
    browser.set(page._controls.release)
    until(lambda: not page.session.stopped)
    browser.send(browser.messages.CommandTriggerMessage(_command(page, "Nudge +z")))  # then the box follows the tool
    until(lambda: box.value != typed)


def test_only_the_controls_of_the_chosen_rule_are_shown(page, browsers):
    browser = browsers()
    handles = {setting: handle for handle, setting, _ in page._controls._settings}
    names = ("gamma", "singular_gain", "singular_posture")
    assert all(handles[name].visible for name in names)
    browser.set(handles["method"], "dls")
    until(lambda: not any(handles[name].visible for name in names))
    assert handles["gain_linear"].visible
    browser.set(handles["method"], "safety")
    until(lambda: handles["gamma"].visible)
    assert not handles["singular_gain"].visible
    assert not fits_rule("gamma", Settings(method="jparse:gamma=0.2"))


def test_the_page_has_a_legend(page):
    from sigmaik.teleop import gauges

    for words in ("as asked", "damped", "held back by limits", "asked velocity", "singular", "ellipsoid"):
        assert words in gauges.legend()


def test_texts_with_lone_surrogates_are_shown(page, browsers):
    from sigmaik.teleop import gauges

    assert gauges.printable("episode\udcff") == "episode?"
    browser = browsers()
    (page.directory / os.fsdecode(b"episode\xff.npz")).write_text("nothing")
    page._controls.episodes.options = page._files()
    page._say_to_all("a title", "a text \ud800")
    page.session.hold("because \udfff")
    until(lambda: "because ?" in page._controls.status.content)
    browser.drag(away(page))
    until(lambda: moves(page))


# --- meshes


ARM = """<robot name="r"><link name="a"><visual><geometry><mesh filename="{mesh}"/></geometry></visual></link>
<link name="b"/><joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""
STL = (
    "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid s\n"
)


@pytest.fixture
def folders(tmp_path):
    for folder in ("arm", "arm/meshes", "pkg", "pkg/urdf", "pkg/meshes", "other"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "m.stl").write_text(STL)
    (tmp_path / "outside.stl").write_text(STL)
    (tmp_path / "arm" / "link.stl").symlink_to(tmp_path / "outside.stl")
    (tmp_path / "arm" / "secret.txt").write_text("secret")
    (tmp_path / "pkg" / "package.xml").write_text("<package><name>my_arm</name></package>")
    return tmp_path


@pytest.mark.parametrize(
    ("mesh", "words"),
    [
        ("../outside.stl", "outside"),
        ("meshes/../../outside.stl", "outside"),
        ("{root}/outside.stl", "outside"),
        ("file:///etc/passwd", "/etc/passwd' is outside"),
        ("file://{root}/outside.stl", "outside"),
        ("file://evil.example/m.stl", "another machine"),
        ("/etc/passwd", "outside"),
        ("package://x/../../outside.stl", "outside"),
        ("package://my_arm/%2e%2e/%2e%2e/outside.stl", "outside"),
        ("http://evil.example/m.stl", "is not read"),
        ("link.stl", "outside"),  # where the link leads to
        ("secret.txt", "none of"),
        ("m\0.stl", "no file name"),
    ],
)
def test_a_mesh_from_elsewhere_is_refused(folders, mesh, words):
    files = MeshFiles(folders / "arm" / "arm.urdf")
    with pytest.raises(sk.Error, match=words):
        files(mesh.format(root=folders))


@pytest.mark.parametrize("mesh", ["../outside.stl", "file:///etc/passwd"])
def test_the_page_of_an_arm_with_a_mesh_from_elsewhere_is_refused(folders, mesh, capsys):
    urdf = folders / "arm" / "arm.urdf"
    urdf.write_text(ARM.format(mesh=mesh))
    before = {thread for thread in sys._current_frames()}
    with Session(str(urdf)) as session, pytest.raises(sk.Error, match="outside .*--package NAME=FOLDER"):
        Page(session, port=0, directory=folders)
    until(lambda: len(set(sys._current_frames()) - before) <= 1)
    assert main(["teleop", "--robot", str(urdf), "--port", "0", "--out", str(folders)]) == 2
    errors = capsys.readouterr().err
    assert "outside" in errors.splitlines()[-1]
    assert "Traceback" not in errors


def test_meshes_of_the_own_folder_and_of_packages_are_read(folders):
    arm, pkg = folders / "arm", folders / "pkg"
    files = MeshFiles(arm / "arm.urdf")
    for mesh in ("m.stl", "meshes/m.stl", "./meshes/m.stl", f"file://{arm}/m.stl", "package://any/meshes/m.stl"):
        assert os.path.isfile(files(mesh))
    assert files("meshes/none.stl") == str(arm / "meshes" / "none.stl")  # missing: a simple shape stands in
    files = MeshFiles(pkg / "urdf" / "arm.urdf")
    for mesh in ("package://my_arm/meshes/m.stl", "../meshes/m.stl"):
        assert files(mesh) == str(pkg / "meshes" / "m.stl")
    with pytest.raises(sk.Error, match="outside"):
        files("../../other/m.stl")
    files = MeshFiles(arm / "arm.urdf", {"other": folders / "other"})
    assert files("package://other/m.stl") == str(folders / "other" / "m.stl")
    assert files("../other/m.stl") == str(folders / "other" / "m.stl")
    with pytest.raises(sk.Error, match="package 'none': there is no folder"):
        MeshFiles(arm / "arm.urdf", {"none": folders / "none"})
    (arm / "arm.urdf").write_text(ARM.format(mesh="meshes/m.stl"))
    with Session(str(arm / "arm.urdf")) as session:
        page = Page(session, port=0, directory=folders)
        assert page._scene.robot.missing == []
        page.close()


def test_a_broken_mesh_is_refused_with_its_name(folders):
    urdf = folders / "arm" / "arm.urdf"
    urdf.write_text(ARM.format(mesh="broken.dae"))
    (folders / "arm" / "broken.dae").write_bytes(bytes(itertools.islice(itertools.cycle(b"\x00\xff"), 200)))
    with Session(str(urdf)) as session, pytest.raises(sk.Error, match="cannot be drawn"):
        Page(session, port=0, directory=folders)
