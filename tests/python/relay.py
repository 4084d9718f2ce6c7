"""A line between a client and a server that can go dead, or be late."""

import asyncio
import contextlib
import threading
import time


class Relay:
    """Hands on what comes to `near` to `far`, and back. `dead`: nothing passes, and nobody is told; it waits.
    `delay_s`: what the server says comes so late."""

    def __init__(self, near, far):
        self.near, self.far = near, far
        self.dead, self.delay_s = threading.Event(), 0.0
        self.loop = asyncio.new_event_loop()
        self.thread = threading.Thread(target=self.loop.run_forever, daemon=True)

    def __enter__(self):
        self.thread.start()
        serves = asyncio.start_server(self._client, *self.near)
        asyncio.run_coroutine_threadsafe(serves, self.loop).result(5)
        return self

    def __exit__(self, *_):
        asyncio.run_coroutine_threadsafe(self._end(), self.loop).result(5)
        self.loop.call_soon_threadsafe(self.loop.stop)
        self.thread.join(5)

    async def _end(self):
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _client(self, reader, writer):
        try:
            from_server, to_server = await asyncio.open_connection(*self.far)
        except OSError:
            writer.close()
            return
        # The library's own callback would call the end of the check an error.
        with contextlib.suppress(asyncio.CancelledError):
            await asyncio.gather(self._pump(reader, to_server, False), self._pump(from_server, writer, True))

    async def _pump(self, reader, writer, late):
        waiting = asyncio.Queue()
        task = asyncio.ensure_future(self._deliver(waiting, writer, late))
        try:
            while data := await reader.read(4096):
                waiting.put_nowait((time.monotonic(), data))
        except OSError:
            pass
        waiting.put_nowait((time.monotonic(), None))
        await task

    async def _deliver(self, waiting, writer, late):
        try:
            while True:
                came, data = await waiting.get()
                while self.dead.is_set() or (late and time.monotonic() < came + self.delay_s):
                    await asyncio.sleep(0.005)
                if data is None:
                    break
                writer.write(data)
                await writer.drain()
        except OSError:
            pass
        writer.close()
