"""Both clients over TLS, with the certificates of the service's own tests."""

import ssl
import unittest

from roomsight import AsyncClient, Client, ConnectionLost, Result
from running import REPOSITORY, RunningService

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

    def test_a_certificate_of_nobody_is_not_believed(self) -> None:
        with Client(self.url) as client, self.assertRaises(ConnectionLost):
            client.is_ready()
