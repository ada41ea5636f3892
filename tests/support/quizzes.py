"""Quizzes for tests: a server in a thread, participants without a browser, files of answers."""

import http.client
import re
import threading
import time
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from urllib.parse import urlencode

import numpy as np

from iqtt.quiz import sessions
from iqtt.quiz.app import Quiz, make_app
from iqtt.quiz.commits import Commits
from iqtt.quiz.schema import open_answers, secret_of
from iqtt.quiz.serve import server_of
from iqtt.quiz.study import Question, Settings
from scenegen.common.web_hosts import Hosts, hosts_of, listen

FORM = {"Content-Type": "application/x-www-form-urlencoded"}
MADE = Settings("a" * 64, "b" * 64, 3, questions=6, calibrations=1)
KINDS = ("mirror", "near")


@dataclass
class Site:
    """A running server."""

    port: int
    db: object
    quiz: Quiz
    told: list = field(default_factory=list)

    def ask(self, method, path, fields=None, cookie="", body=None, **headers):
        """Return status, headers and body of one request on a connection of its own."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        headers = {name.replace("_", "-"): value for name, value in headers.items()}
        headers = {"Host": f"localhost:{self.port}", **(FORM if fields else {}), **headers}
        if cookie:
            headers["Cookie"] = cookie
        with closing(connection):
            sent = body if fields is None else urlencode(fields)
            with suppress(BrokenPipeError):  # the server may close before all has been sent
                connection.request(method, path, sent, headers)
            answer = connection.getresponse()
            return answer.status, dict(answer.getheaders()), answer.read()

    def begin(self):
        """Consent; return the cookie."""
        status, headers, _ = self.ask("POST", "/start", {"consent": "yes"})
        assert (status, headers["location"]) == (303, "/quiz")
        return headers["set-cookie"].partition(";")[0]

    def page(self, cookie):
        """Return the page that a participant sees now."""
        status, _, text = self.ask("GET", "/quiz", cookie=cookie)
        assert status == 200
        return text.decode()

    def answer(self, cookie, choice=1, ms="1.5", position=None):
        """Send an answer to what is asked now, or at another position; return the status."""
        position = position_of(self.page(cookie)) if position is None else position
        fields = {"position": position, "answer": str(choice), "ms": ms}
        return self.ask("POST", "/answer", fields, cookie)[0]

    def go_on(self, cookie):
        """Read the right answer; return the status."""
        fields = {"position": position_of(self.page(cookie))}
        return self.ask("POST", "/next", fields, cookie)[0]


def position_of(page):
    """Return the position of the question that a page's form belongs to."""
    return re.search('name="position" value="([^"]+)"', page)[1]


def images_of(page):
    """Return the addresses of a page's images."""
    return re.findall('src="(/image/[^"]+)"', page)


@contextmanager
def served(study, path, most=100, public=False, names=()):
    """Serve a study from a thread."""
    db = open_answers(path, study.settings)
    told = []
    hosts = hosts_of(None, public, names)
    with listen(Hosts(), 0) as listening, Commits(db) as commits:
        quiz = Quiz(study, commits, secret_of(db), told.append, "A <b>lab</b>", most)
        server = server_of(make_app(quiz, hosts))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
        thread.start()
        while not server.started:
            time.sleep(0.005)
        try:
            yield Site(listening.getsockname()[1], path, quiz, told)
        finally:
            server.should_exit = True
            thread.join()


def made_draw(participant, settings=MADE):
    """Return questions of no split: the right answer moves on, the angle grows, kinds alternate."""
    return [
        Question(i < settings.calibrations, 10 * participant + i, KINDS[i % 2],
                 20.0 + 10 * i + participant, (i + participant) % settings.answers, f"{i:012x}")
        for i in range(settings.calibrations + settings.questions)
    ]  # fmt: skip


def made_answers(path, participants=5, unfinished=1, skill=0.7, seed=1, settings=MADE):
    """Write a file of answers of made-up people whose times grow by 0.02 s per degree."""
    rng = np.random.default_rng(seed)
    db = open_answers(path, settings)
    with closing(db):
        db.execute("BEGIN")
        for number in range(participants + unfinished):
            name = sessions.begin(db, partial(made_draw, settings=settings), 10**6)
            asked = made_draw(number, settings)
            for i, q in enumerate(asked[: None if number < participants else 3]):
                choice = q.right if rng.random() < skill else (q.right + 1) % settings.answers
                sessions.show(db, name)
                seconds = 1.0 + 0.02 * q.angle_degrees + 0.3 * number + rng.normal(0, 0.1)
                sessions.answer(db, name, i, choice, None)
                db.execute(
                    "UPDATE answer SET response_ms = ? WHERE participant = ? AND position = ?",
                    (1000 * seconds, number, i),
                )
                if q.calibration:
                    sessions.go_on(db, name, i)
        db.execute("COMMIT")
    return path
