"""The quiz over HTTP: an honest participant's way, and everything else refused."""

import re
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from quizzes import images_of, position_of, served

from iqtt.quiz import guards, serve
from iqtt.quiz.answers import read_answers


def finish(site, cookie, choices=(1,) * 6):
    assert site.answer(cookie, choices[0]) == 303
    assert site.go_on(cookie) == 303
    assert [site.answer(cookie, choice) for choice in choices[1:]] == [303] * 5


def test_the_honest_way(site, study):
    cookie = site.begin()
    right = [q.right for q in study.draw(0)]
    wrong = [(place + 1) % 3 for place in right]
    choices = [place + 1 for place in right[:4] + wrong[4:]]
    pages = [site.page(cookie)]
    assert site.answer(cookie, choices[0]) == 303
    assert "Right: it is answer" in site.page(cookie)
    assert site.go_on(cookie) == 303
    for choice in choices[1:]:
        pages.append(site.page(cookie))
        assert site.answer(cookie, choice, ms="250.5") == 303
    end = site.page(cookie)
    assert "You answered 3 of 5" in end
    assert "1 of 1" in pages[0]
    assert "Question 5 of 5" in pages[5]
    found = read_answers(site.db)
    assert [one.answer + 1 for one in found.answers] == choices
    assert [one.correct for one in found.answers] == [True] * 4 + [False] * 2
    assert all(one.response_seconds == 0.2505 for one in found.answers[1:])
    # The same browser is still at its end; handing over forgets it.
    assert site.ask("GET", "/", cookie=cookie)[1]["location"] == "/quiz"
    status, headers, _ = site.ask("POST", "/leave", {"leave": "yes"}, cookie)
    assert (status, headers["set-cookie"].partition(";")[0].partition("=")[2]) == (303, "null")


def test_pages_and_images_tell_no_answer(site, study):
    one, other = site.begin(), site.begin()
    seen = set()
    for cookie in (one, other):
        site.answer(cookie)
        site.go_on(cookie)
        page = site.page(cookie)
        names = images_of(page)
        assert names == [f"/image/1/{k}" for k in range(4)]
        for word in ("right", "mirror", "matched", "near", "other", "kind", "row", "correct"):
            assert word not in page.replace("aria-", ""), word
        for name in names:
            status, headers, body = site.ask("GET", name, cookie=cookie)
            assert (status, headers["content-type"]) == (200, "image/png")
            assert headers["cache-control"] == "no-store", "others have other images there"
            assert b"tEXt" not in body
            seen.add(body)
    assert len(seen) in (4, 8), "of one question or of two"
    # Images show to the session that is asked, and while it is.
    assert site.ask("GET", "/image/1/0")[0] == 404
    for name in ("/image/0/0", "/image/2/0", "/image/1/4", "/image/1/-1"):
        assert site.ask("GET", name, cookie=one)[0] == 404
    site.answer(one)
    assert site.ask("GET", "/image/1/0", cookie=one)[0] == 404
    assert site.ask("GET", "/image/1/0", cookie=other)[0] == 200


def test_answers_out_of_turn(site):
    cookie = site.begin()
    site.page(cookie)
    assert site.answer(cookie, position=1) == 409, "before the first"
    assert site.answer(cookie, position=0) == 303
    assert site.answer(cookie, position=0) == 409, "twice"
    assert site.ask("POST", "/next", {"position": "1"}, cookie)[0] == 409
    assert site.go_on(cookie) == 303
    assert site.ask("POST", "/next", {"position": "0"}, cookie)[0] == 409
    assert position_of(site.page(cookie)) == "1"
    assert site.answer(cookie, position=0) == 409, "an earlier question"
    other = "A" if cookie[-9] != "A" else "B"  # some bits of the last character mean nothing
    for forged in ("quiz_0=x", cookie[:-9] + other + cookie[-8:]):
        assert site.answer(forged, position=1) == 403
    for place in ("", "-1", "x", "1" * 9, "١"):
        assert site.answer(cookie, position=place) == 422
    for choice in ("0", "4", "1.0", "", "-1", "٣"):
        assert site.answer(cookie, choice, position=1) == 422
    for ms in ("-1", "nan", "1e9", "1" * 20):
        assert site.answer(cookie, 1, ms, position=1) == 422
    assert len(read_answers(site.db).answers) == 1
    assert site.ask("POST", "/leave", {"leave": "yes"}, cookie)[0] == 409


def test_a_question_must_have_been_shown(site):
    assert site.answer(site.begin(), position=0) == 409


def test_times_that_cannot_be_are_not_kept(site):
    cookie = site.begin()
    assert site.answer(cookie, ms="999999") == 303
    assert site.go_on(cookie) == 303
    assert site.answer(cookie, ms="") == 303
    assert [one.response_seconds for one in read_answers(site.db).answers] == [None, None]


def test_one_of_many_equal_posts_counts(site):
    cookie = site.begin()
    site.page(cookie)
    with ThreadPoolExecutor(16) as pool:
        found = list(pool.map(lambda k: site.answer(cookie, k % 3 + 1, position=0), range(16)))
    assert sorted(found) == [303] + [409] * 15
    assert len(read_answers(site.db).answers) == 1


def test_many_at_once_lose_nothing(site):
    def participate(_):
        cookie = site.begin()
        finish(site, cookie)
        return cookie

    with ThreadPoolExecutor(12) as pool:
        assert len(set(pool.map(participate, range(24)))) == 24
    found = read_answers(site.db)
    assert (found.participants, len(found.answers)) == (24, 24 * 6)
    assert sorted(one.order for one in found.answers) == list(range(1, 24 * 6 + 1))


@pytest.mark.parametrize("path", ["/", "/quiz", "/static/quiz.css", "/nowhere", "/image/x"])
def test_headers(lasting, path):
    _, headers, _ = lasting.ask("GET", path)
    policy = dict(part.split(" ", 1) for part in headers["content-security-policy"].split("; "))
    assert policy["default-src"] == policy["frame-ancestors"] == policy["base-uri"] == "'none'"
    assert {policy[f"{what}-src"] for what in ("script", "style", "img")} == {"'self'"}
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "same-origin"
    assert "server" not in headers
    assert headers["cache-control"] == ("max-age=600" if "static" in path else "no-store")


def test_the_cookie(lasting):
    header = lasting.ask("POST", "/start", {"consent": "yes"})[1]["set-cookie"]
    assert re.match("quiz_[0-9a-f]{8}=[^;]{40,}; ", header)
    assert {"httponly", "samesite=lax", "path=/"} <= set(header.split("; "))
    again = lasting.ask("GET", "/quiz", cookie=header.partition(";")[0])[1]
    assert "set-cookie" not in again


def test_consent_is_needed_and_names_are_escaped(site):
    status, _, page = site.ask("POST", "/start", {"other": "yes"})
    assert status == 422
    assert b'role="alert"' in page
    assert site.ask("POST", "/start", {"consent": "no"})[0] == 422
    assert b"A &lt;b&gt;lab" in page
    assert read_answers(site.db).participants == 0


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Host": "evil.example"}, 421),
        ({"Host": "localhost.evil.example"}, 421),
        ({"Host": "10.0.0.1"}, 421),
        ({"Host": "localhost@evil.example"}, 421),
        ({"Host": "LOCALHOST:99"}, 303),
        ({"Host": "[::1]:99"}, 303),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Origin": "http://localhost:1"}, 403),
        ({"Referer": "http://evil.example/localhost"}, 403),
        ({"Sec_Fetch_Site": "cross-site"}, 403),
        ({"Sec_Fetch_Site": "same-origin"}, 303),
        ({"Content_Type": "text/plain"}, 415),
        ({"Content_Type": "application/json"}, 415),
    ],
)
def test_requests_of_other_sites(lasting, headers, status):
    before = read_answers(lasting.db).participants
    assert lasting.ask("POST", "/start", {"consent": "yes"}, **headers)[0] == status
    assert read_answers(lasting.db).participants == before + (status == 303)


def test_the_own_origin_is_taken(lasting):
    origin = f"http://localhost:{lasting.port}"
    assert lasting.ask("POST", "/start", {"consent": "yes"}, Origin=origin)[0] == 303


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b"x" * 5000, 413),
        (b"consent=yes&consent=yes", 422),
        (b"consent=yes&more=1", 422),
        (b"&".join([b"consent=yes"] * 99), 422),
        (b"consent=%ff", 422),
        (b"consent=\xff", 422),
        (b"", 422),
        (iter([b"x" * 3000] * 2), 413),
    ],
)  # fmt: skip
def test_bodies(lasting, body, status):
    headers = {"Content_Type": guards.FORM_TYPE}
    assert lasting.ask("POST", "/start", body=body, **headers)[0] == status


@pytest.mark.parametrize(
    "path",
    [
        "/static/../app.py", "/static/%2e%2e/app.py", "/static/..%2fapp.py", "//etc/passwd",
        "/static/%00", "/static/", "/image/../quiz", "/quiz/", "/static/../../../../etc/passwd",
    ],
)  # fmt: skip
def test_no_path_leads_out(lasting, path):
    status, _, body = lasting.ask("GET", path)
    assert status == 404
    assert b"There is no such" in body


def test_slow_clients_are_cut_off(site, monkeypatch):
    monkeypatch.setattr(serve, "EXCHANGE_SECONDS", 0.3)
    began = time.monotonic()
    with socket.create_connection(("127.0.0.1", site.port), timeout=10) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\nHo")
        stop = threading.Event()

        def drip():
            while not stop.wait(0.05):
                try:
                    connection.send(b"x")
                except OSError:
                    return

        thread = threading.Thread(target=drip)
        thread.start()
        try:
            assert connection.recv(1) == b""
        except ConnectionResetError:
            pass
        finally:
            stop.set()
            thread.join()
    assert time.monotonic() - began < 5


def test_slow_bodies_are_refused(lasting, monkeypatch):
    monkeypatch.setattr(guards, "BODY_SECONDS", 0.1)
    with socket.create_connection(("127.0.0.1", lasting.port), timeout=10) as connection:
        head = f"POST /start HTTP/1.1\r\nHost: localhost\r\nContent-Type: {guards.FORM_TYPE}\r\n"
        connection.sendall(f"{head}Content-Length: 11\r\n\r\nconsent".encode())
        assert connection.recv(100).startswith(b"HTTP/1.1 408")


def test_a_full_disk_is_told_and_later_all_goes_on(site):
    cookie = site.begin()
    site.page(cookie)

    def limit(pages):
        return site.quiz.commits.run(
            lambda db: db.execute(f"PRAGMA max_page_count = {pages}").fetchone()
        ).result()

    site.quiz.commits.run(lambda db: db.execute("PRAGMA page_count").fetchone())
    (before,) = limit(1)
    statuses = set()
    for _ in range(60):  # until the pages that there are have been filled
        status, _, body = site.ask("POST", "/start", {"consent": "yes"})
        statuses.add(status)
    assert statuses == {303, 503}
    assert b"could not be saved" in body
    assert any("full" in line for line in site.told)
    limit(10**6)
    assert before < 10**6
    assert site.answer(cookie, position=0) == 303


def test_no_more_participants_than_there_may_be(study, tmp_path):
    with served(study, tmp_path / "answers.db", most=1) as site:
        cookie = site.begin()
        assert site.ask("POST", "/start", {"consent": "yes"})[0] == 503
        assert site.ask("POST", "/start", {"consent": "yes"}, cookie)[0] == 303, "takes it up"


def test_a_session_outlives_the_server(study, tmp_path):
    path = tmp_path / "answers.db"
    with served(study, path) as site:
        cookie = site.begin()
        site.answer(cookie)
        site.go_on(cookie)
        before = site.page(cookie)
    with served(study, path) as site:
        assert site.page(cookie) == before
        finish_rest = [site.answer(cookie) for _ in range(5)]
        assert finish_rest == [303] * 5
        assert "You answered" in site.page(cookie)


def test_a_public_quiz_takes_numbers_and_its_names_only(study, tmp_path):
    with served(study, tmp_path / "answers.db", public=True, names=("Quiz.example",)) as site:
        hosts = ("10.1.2.3:8000", "[fe80::1]", "quiz.example", "localhost", "evil.example")
        assert [site.ask("GET", "/", Host=host)[0] for host in hosts] == [200] * 4 + [421]
