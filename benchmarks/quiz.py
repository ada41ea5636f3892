"""How `iqtt quiz` bears many participants at once: times of its answers, and none of them lost.

`python -m benchmarks.quiz [--sessions 200] [--think 2]`, from the repository's root.

Server and participants share this machine. Each participant sends what a browser sends, on one
connection: the first page, then for each question its page, its four images and the answer. They
begin within one time to think, and think for 0.5 to 1.5 times `--think` seconds before an answer.
The server is killed by SIGKILL as soon as the last answer is acknowledged, and the file of answers
is compared with what was acknowledged.
"""

import argparse
import asyncio
import os
import random
import re
import resource
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from pathlib import Path
from urllib.parse import urlencode

Times = dict[str, list[float]]
FORM = {"Content-Type": "application/x-www-form-urlencoded"}


class Browser:
    """A participant's connection: sends requests one after the other, and keeps their times."""

    def __init__(self, port: int, times: Times) -> None:
        self.port, self.times, self.cookie = port, times, ""
        self.reader: asyncio.StreamReader | None = None

    async def ask(self, method: str, path: str, **fields: str) -> tuple[int, str]:
        """Return the status and what the page says."""
        if self.reader is None:
            self.reader, self.writer = await asyncio.open_connection("127.0.0.1", self.port)
        body = urlencode(fields).encode()
        headers = {"Host": f"localhost:{self.port}", "Content-Length": str(len(body)), **FORM}
        if self.cookie:
            headers["Cookie"] = self.cookie
        lines = [f"{method} {path} HTTP/1.1", *(f"{n}: {v}" for n, v in headers.items()), "", ""]
        began = time.perf_counter()
        try:
            self.writer.write("\r\n".join(lines).encode() + body)
            head = (await self.reader.readuntil(b"\r\n\r\n")).decode().split("\r\n")
        except (ConnectionError, asyncio.IncompleteReadError):
            self.reader = None  # idle for too long, so the server has closed it; once more
            return await self.ask(method, path, **fields)
        found = {n.lower(): v for n, _, v in (line.partition(": ") for line in head[1:])}
        content = await self.reader.readexactly(int(found.get("content-length", 0)))
        self.times[path.split("/")[1] or "first page"].append(time.perf_counter() - began)
        self.cookie = found.get("set-cookie", self.cookie).partition(";")[0]
        return int(head[0].split()[1]), content.decode(errors="replace")


async def participate(port: int, think: float, times: Times) -> dict[str, int]:
    """Go through the quiz; return how many answers were acknowledged and how many refused."""
    browser, tally = Browser(port, times), Counter[str]()
    await asyncio.sleep(random.uniform(0, think))
    await browser.ask("GET", "/")
    await browser.ask("POST", "/start", consent="yes")
    while True:
        status, text = await browser.ask("GET", "/quiz")
        if status != 200 or "Your score" in text:
            tally["broken"] += status != 200
            return tally
        for name in re.findall('src="(/image/[^"]+)"', text):
            await browser.ask("GET", name)
        form = re.search('name="form" value="([^"]+)"', text)[1]
        if "/next" in text:
            await browser.ask("POST", "/next", form=form)
            continue
        wait = random.uniform(0.5, 1.5) * think
        await asyncio.sleep(wait)
        choice = str(random.randint(1, 3))
        status, _ = await browser.ask(
            "POST", "/answer", form=form, answer=choice, ms=f"{1000 * wait:.1f}"
        )
        tally["acknowledged" if status == 303 else "refused"] += 1


async def crowd(port: int, sessions: int, think: float) -> tuple[Times, Counter[str]]:
    """Return the times of all requests by what was asked for, and what became of the answers."""
    times: Times = defaultdict(list)
    tallies = await asyncio.gather(*(participate(port, think, times) for _ in range(sessions)))
    return times, sum(map(Counter, tallies), Counter())


def print_times(times: Times, seconds: float) -> None:
    """Print a table of the times in milliseconds."""
    every = [one for each in times.values() for one in each]
    print(f"{len(every):,} requests in {seconds:.0f} s, {len(every) / seconds:.0f}/s\n")
    print("| request | number | median, ms | p99, ms | longest, ms |")
    print("| --- | ---: | ---: | ---: | ---: |")
    for name, each in [*sorted(times.items()), ("all", every)]:
        marks = statistics.quantiles(each, n=100)
        ms = (f"{1000 * t:.1f}" for t in (marks[49], marks[98], max(each)))
        print(f"| {name} | {len(each):,} | {' | '.join(ms)} |")


def main() -> None:
    """Make questions, start the server, send the crowd, kill the server, compare."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--sessions", type=int, default=200)
    parser.add_argument("--think", type=float, default=2.0, help="seconds before each answer")
    options = parser.parse_args()
    run = [sys.executable, "-c", "import cli; cli.iqtt()"]
    with tempfile.TemporaryDirectory() as folder:
        split, db = Path(folder) / "split", Path(folder) / "answers.db"
        numbers = ["--train", "0", "--labeled", "0", "--val", "20", "--test", "200"]
        subprocess.run([*run, "make-split", "--out", split, *numbers], check=True)
        command = [*run, "quiz", split / "iqtt-test.h5", "--db", db, "--port", "0"]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            assert server.stdout is not None
            port = int(re.search(r":(\d+)/", server.stdout.readline())[1])
            began = time.perf_counter()
            times, tally = asyncio.run(crowd(port, options.sessions, options.think))
            seconds = time.perf_counter() - began
        finally:
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            os.kill(server.pid, signal.SIGKILL)
            server.wait()
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
        from iqtt.quiz.answers import read_answers

        kept = len(read_answers(db).answers)
    print(f"{options.sessions} participants, {options.think:g} s to think, {os.cpu_count()} cores")
    print_times(times, seconds)
    busy = sum(after[:2]) - sum(before[:2])
    print(f"\nthe server computed for {busy:.0f} s, {100 * busy / seconds:.0f}% of one core")
    print(f"\nanswers acknowledged {tally['acknowledged']:,}, on the disk {kept:,},", end=" ")
    print(f"lost {tally['acknowledged'] - kept}; refused {tally['refused']}")


if __name__ == "__main__":
    main()
