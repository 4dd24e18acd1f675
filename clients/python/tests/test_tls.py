"""Both clients over TLS, with the certificates of the service's own tests."""

import ssl
import threading
import time
import unittest

from roomsight import AsyncClient, Client, ConnectionLost, Result
from running import PATIENCE_S, REPOSITORY, RunningService

FOLDER = REPOSITORY / "tests" / "tls"


class Tls(RunningService, unittest.IsolatedAsyncioTestCase):
    """Both clients against one service."""

    settings = [f"tls_certificate={FOLDER / 'service.pem'}", f"tls_key={FOLDER / 'service.key'}"]
    authority = FOLDER / "ca.pem"

    async def test_frames_and_streams(self) -> None:
        believed = ssl.create_default_context(cafile=self.authority)
        with Client(self.url, ssl=believed) as client:
            room = client.recognize(self.frames[0]).room
            with client.stream(mode="lossless", filter=False) as stream:
                stream.send(self.frames[0])
                result = stream.answer()
                assert isinstance(result, Result)
                self.assertEqual(result.room, room)
        async with AsyncClient(self.url, ssl=believed) as client:
            self.assertTrue(await client.is_ready())
            async with await client.stream() as stream:
                await stream.send(self.frames[0])
                self.assertIsInstance(await stream.answer(), Result)

    def test_events_are_ended_by_another_thread(self) -> None:
        with Client(self.url, ssl=ssl.create_default_context(cafile=self.authority)) as client:
            events = client.events()
            told: "list[object]" = []
            thread = threading.Thread(target=lambda: told.append(list(events)), daemon=True)
            thread.start()
            time.sleep(0.2)
            events.close()
            thread.join(PATIENCE_S / 4)
            self.assertEqual(told, [[]])

    def test_a_certificate_of_nobody_is_not_believed(self) -> None:
        with Client(self.url) as client, self.assertRaises(ConnectionLost):
            client.is_ready()
