"""Values on their way to pages."""

import asyncio
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from served import Served, SilentFeed
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection

from posed.ar.app import ArContent, _Ar
from posed.ar.corrections import CorrectionStore
from posed.web.live import Handover, Outbox


def test_of_values_with_the_same_key_the_newest_is_sent() -> None:
    async def send() -> list[Any]:
        outbox = Outbox()
        outbox.put("p", 1)
        outbox.put("s", "on")
        outbox.put("p", 2)
        return [json.loads(await outbox.next_frame())]

    assert asyncio.run(send()) == [{"i": 1, "p": 2, "s": "on"}]


def test_a_page_that_acknowledges_nothing_holds_up_two_frames_and_then_gets_the_newest() -> None:
    async def send() -> list[Any]:
        outbox = Outbox()
        frames = []
        for value in range(3):
            outbox.put("p", value)
            if value < 2:
                frames.append(json.loads(await outbox.next_frame()))
        waiting = asyncio.create_task(outbox.next_frame())
        for value in range(3, 1000):
            outbox.put("p", value)
            await asyncio.sleep(0)
        assert not waiting.done()
        outbox.acknowledge(1)
        frames.append(json.loads(await waiting))
        return frames

    assert asyncio.run(send()) == [{"i": 1, "p": 0}, {"i": 2, "p": 1}, {"i": 3, "p": 999}]


@pytest.mark.parametrize("frame", [0, -5, 10**12])
def test_an_acknowledgement_of_what_was_never_sent_opens_nothing(frame: int) -> None:
    async def send() -> bool:
        outbox = Outbox()
        for value in range(2):
            outbox.put("p", value)
            await outbox.next_frame()
        outbox.acknowledge(frame)
        outbox.put("p", 2)
        third = asyncio.create_task(outbox.next_frame())
        outbox.put("p", 3)
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        ready = third.done()
        third.cancel()
        return ready

    # A number beyond the last counts as the last: both are with the page then.
    assert asyncio.run(send()) is (frame > 2)


def test_values_from_another_thread_arrive_on_the_loop_the_newest_of_each_key() -> None:
    async def hand_over() -> list[tuple[str, int]]:
        taken: list[tuple[str, int]] = []
        done = asyncio.Event()

        def take(key: str, value: int) -> None:
            taken.append((key, value))
            if value == 99:
                done.set()

        hand = Handover(asyncio.get_running_loop(), take)
        for value in range(100):
            hand("p", value)
        await done.wait()
        return taken

    assert asyncio.run(hand_over()) == [("p", 99)]


@pytest.fixture
def feed() -> SilentFeed:
    return SilentFeed()


@pytest.fixture
def served(feed: SilentFeed, tmp_path: Path) -> Iterator[Served]:
    content = ArContent({"viewpoint": None, "places": []}, {})
    with Served(feed, content, CorrectionStore(tmp_path / "corrections.json")) as served:
        yield served


def test_a_page_that_opens_gets_the_newest_of_what_lasts(served: Served, feed: SilentFeed) -> None:
    headers = served.enter()
    feed.publish("p", 1)
    feed.publish("s", {"state": "CONNECTED"})
    feed.publish("p", 2)
    feed.publish("t", "nobody asked for the truth")
    with served.open(headers) as first:
        frame = receive_until(first, "p")
    assert frame == {"i": 1, "p": 2, "s": {"state": "CONNECTED"}}


def test_a_stopped_page_is_sent_nothing_more_and_wakes_to_the_newest(served: Served, feed: SilentFeed) -> None:
    headers = served.enter()
    with served.open(headers) as slow, served.open(headers) as quick:
        for value in range(500):
            feed.publish("p", value)
            if receive_until(quick, "p")["p"] == value:
                quick.send(json.dumps({"a": value + 1}))
        frames = [json.loads(slow.recv()), json.loads(slow.recv())]
        assert [frame["p"] for frame in frames] == [0, 1]
        with pytest.raises(TimeoutError):
            slow.recv(timeout=0.05)
        slow.send(json.dumps({"a": 2}))
        assert json.loads(slow.recv())["p"] == 499


def test_the_truth_flows_while_a_page_wants_it(served: Served, feed: SilentFeed) -> None:
    headers = served.enter()
    with served.open(headers) as page, served.open(headers) as other:
        page.send(json.dumps({"t": 1}))
        await_asked(feed, lambda: feed.wishes[-1:] == [True])
        feed.publish("t", {"t": 5})
        feed.publish("p", 1)
        assert receive_until(page, "t")["t"] == {"t": 5}
        assert "t" not in receive_until(other, "p")
    await_asked(feed, lambda: feed.wishes[-1] is False)


def test_a_page_switches_the_rate_mode(served: Served, feed: SilentFeed) -> None:
    with served.open(served.enter()) as page:
        for mode in ("FASTEST", "NORMAL"):
            page.send(json.dumps({"m": mode}))
        await_asked(feed, lambda: feed.modes == ["FASTEST", "NORMAL"])


def test_a_page_learns_the_servers_clock(served: Served) -> None:
    with served.open(served.enter()) as page:
        page.send(json.dumps({"c": 12.5}))
        reply = receive_until(page, "c")["c"]
    assert reply["c"] == 12.5
    assert reply["b"] > 0


@pytest.mark.parametrize(
    "request_text",
    [
        *("no JSON", "[1]", '{"m": "TURBO"}', json.dumps({"m": "x" * 2500}), "[" * 1900, json.dumps({"m": "é" * 90})),
        *('{"c": [1]}', '{"t": {}}', b"{}"),
    ],
    ids=lambda text: str(text[:12]),
)
def test_a_request_that_makes_no_sense_ends_that_page_only(
    served: Served, feed: SilentFeed, request_text: str | bytes
) -> None:
    headers = served.enter()
    with served.open(headers) as other, served.open(headers) as page:
        page.send(request_text)
        with pytest.raises(ConnectionClosed) as closed:
            receive_until(page, "p")
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1007
        feed.publish("p", 1)
        assert receive_until(other, "p")["p"] == 1


def test_the_feed_is_closed_after_all_that_was_asked_of_it() -> None:
    class Slow(SilentFeed):
        """Is asked for more while it does what it was asked for."""

        def __init__(self) -> None:
            super().__init__()
            self.asks_more: Callable[[], Any] = lambda: None
            self.done: list[str] = []

        def set_rate_mode(self, mode: str) -> None:
            self.asks_more()
            self.done.append(mode)

        def want_truth(self, wanted: bool) -> None:
            self.done.append(f"truth {wanted}")

        def close(self) -> None:
            self.done.append("closed")

    async def serve(feed: Slow, store: CorrectionStore) -> None:
        ar = _Ar(feed, ArContent({"viewpoint": None, "places": []}, {}), store)
        loop = asyncio.get_running_loop()
        closing = asyncio.Event()

        async def wish_late() -> None:
            await closing.wait()
            ar._follow_wishes()

        feed.asks_more = lambda: asyncio.run_coroutine_threadsafe(wish_late(), loop).result(20)
        async with ar._lifespan(ar.app):
            ar._in_background(feed.set_rate_mode, "GAME")
            loop.call_soon(closing.set)  # by then the feed is being waited for

    feed = Slow()
    asyncio.run(serve(feed, CorrectionStore(Path("unused.json"))))
    assert feed.done == ["GAME", "truth False", "closed"]


def receive_until(page: ClientConnection, key: str) -> dict[str, Any]:
    """Return the next frame that holds a key."""
    while True:
        frame: dict[str, Any] = json.loads(page.recv(timeout=20))
        if key in frame:
            return frame


def await_asked(feed: SilentFeed, condition: Any) -> None:
    with feed.asked:
        assert feed.asked.wait_for(condition, 20), (feed.wishes, feed.modes)
