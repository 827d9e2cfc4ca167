"""A sensor's events to iterate over."""

import asyncio
from typing import Any

from posed.client.event_stream import EventStream


class Manager:
    def unregister_listener(self, listener: Any) -> None:
        pass


def test_what_arrived_before_the_end_is_still_awaited() -> None:
    async def take() -> list[Any]:
        stream = EventStream(Manager())  # type: ignore[arg-type]
        taken: list[Any] = []

        async def iterate() -> None:
            async for event in stream:
                taken.append(event)

        iterating = asyncio.create_task(iterate())
        await asyncio.sleep(0)  # now it waits for the first
        for event in ("first", "last"):
            stream.on_sensor_changed(event)  # type: ignore[arg-type]
        stream.end()
        await iterating
        return taken

    assert asyncio.run(take()) == ["first", "last"]
