"""A real `transformers serve`, a process of its own, answers our pipeline over HTTP."""

import subprocess
import sys
import time
from pathlib import Path

import pytest

from ico3d.chat.services.language.servers import language_models
from ico3d.chat.settings.conversation import ChatSettings, Choice
from ico3d.chat.wire.protocol import Answer, End, Text
from ico3d.measure.talking.page import open_page
from support.chat.serving import free_port, serving
from support.needs import needs

pytestmark = [pytest.mark.slow, pytest.mark.real_time, needs("transformers")]
STARTING = 300  # s that it may take on a busy machine: it imports torch


@pytest.fixture(scope="module")
def address(folder, tmp_path_factory):
    """Its URL and the model's name."""
    from transformers.utils.import_utils import is_serve_available

    if not is_serve_available():
        pytest.skip("needs pip install 'transformers[serving]'")
    port = free_port()
    program = str(Path(sys.executable).with_name("transformers"))
    command = [program, "serve", str(folder), "--host", "127.0.0.1", "--port", str(port)]
    log = tmp_path_factory.mktemp("served") / "transformers.log"
    with log.open("wb") as file:
        process = subprocess.Popen([*command, "--device", "cpu"], stdout=file, stderr=file)
    url = f"http://127.0.0.1:{port}/v1"
    try:
        until = time.monotonic() + STARTING
        while not _answers(url):
            assert process.poll() is None and time.monotonic() < until, log.read_text()
            time.sleep(0.2)
        yield url, str(folder)
    finally:
        process.terminate()
        process.wait(20)


def _answers(url):
    import httpx

    try:
        return httpx.get(url.removesuffix("/v1") + "/health").status_code == 200
    except httpx.HTTPError:
        return False


async def test_our_pipeline_talks_with_it(bundle, address):
    url, model = address
    settings = ChatSettings(language=Choice("openai", {"url": url, "model": model}))
    async with serving(bundle, settings) as (page_url, _):
        page, _ = await open_page(page_url, microphone=False)
        for utterance in (1, 2):
            await page.send(Text("who are you?"))
            await page.wait(End, where=lambda m, n=utterance: m.utterance == n)
        said = [m.text for m in page.messages(Answer) if m.utterance == 2]
        await page.close()
    print(f"transformers serve said: {said}; it offers {language_models(url, 'none', 5.0)}")
    assert said == ["My name is Ada.", "Nice to meet you, dear visitor!"]
