"""The quiz as a web application: each page and form is one of a participant's steps.

GET  /            what the study is, and consent
POST /start       begins a session, which a cookie names
GET  /quiz        the question that is asked now, its right answer in the calibration, the end
POST /answer      answers it
POST /next        goes on after the right answer was told
POST /leave       forgets the session, for the next person at this machine
GET  /image/NAME  an image of the question that is asked now
"""

import asyncio
import re
import sqlite3
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from iqtt.quiz import sessions
from iqtt.quiz.commits import Commits
from iqtt.quiz.guards import Guard, read_form
from iqtt.quiz.pages import Bar, page, result_page, static_files
from iqtt.quiz.sessions import RefusedError, State
from iqtt.quiz.study import Question, Study
from scenegen.common.errors import SceneGenError
from scenegen.common.web_hosts import Hosts

COOKIE_SECONDS = 30 * 24 * 3600
MOST_ASKED = 4096  # sessions whose state is remembered
MILLISECONDS = re.compile(r"[0-9]{1,9}(\.[0-9]{1,6})?")
Compare = Callable[[Sequence[tuple[Question, bool]]], Sequence[Bar]]


@dataclass(frozen=True)
class Quiz:
    """What the pages need.

    Attributes:
        commits: runs operations on the file of answers.
        key: what secret names are made with.
        compare: returns the lines of the comparison at the end, from the questions that count and
            whether each was answered rightly; the first line is the participant's.
        contact: who answers for the study; may be empty.
        most: how many participants there may be.
        tell: prints a line for whoever runs the server.
        asked: what sessions were asked last, so that their images need no look at the disk.
    """

    study: Study
    commits: Commits
    key: bytes
    compare: Compare
    tell: Callable[[str], None]
    contact: str = ""
    most: int = sessions.MOST_PARTICIPANTS
    asked: dict[str, State] = field(default_factory=dict)

    @property
    def cookie(self) -> str:
        """The name of the cookie; two studies on one machine have different ones."""
        return f"quiz_{self.study.settings.fingerprint[:8]}"


def make_app(quiz: Quiz, hosts: Hosts) -> ASGIApp:
    """Return the application, which takes requests to these hosts only."""
    routes = (
        ("/", _home, "GET"), ("/start", _start, "POST"), ("/quiz", _quiz, "GET"),
        ("/answer", _answer, "POST"), ("/next", _next, "POST"), ("/leave", _leave, "POST"),
        ("/image/{name}", _image, "GET"), ("/static/{name}", _static, "GET"),
    )  # fmt: skip
    app = Starlette(
        routes=[Route(path, partial(do, quiz), methods=[method]) for path, do, method in routes],
        exception_handlers={
            RefusedError: _refused,
            HTTPException: _refused,
            sqlite3.Error: partial(_unsaved, quiz),
            SceneGenError: partial(_broken, quiz),
        },
    )
    app.router.redirect_slashes = False

    async def refuse(scope: Any, receive: Any, send: Any) -> None:
        await (await _refused(Request(scope), scope["refused"]))(scope, receive, send)

    return Guard(app, hosts, refuse)


async def _home(quiz: Quiz, request: Request) -> Response:
    if await _state(quiz, request) is not None:
        return _see("/quiz")
    return _consent(quiz)


async def _start(quiz: Quiz, request: Request) -> Response:
    if await _state(quiz, request) is not None:
        return _see("/quiz")
    try:
        form = await read_form(request, ("consent",))
    except RefusedError as refused:
        if refused.status != 400:
            raise
        form = {}
    if form.get("consent") != "yes":
        return _consent(quiz, 422)
    begin = partial(sessions.begin, draw=quiz.study.draw, most=quiz.most)
    token = await asyncio.wrap_future(quiz.commits.run(begin))
    response = _see("/quiz")
    _set_cookie(quiz, response, request, token, COOKIE_SECONDS)
    return response


async def _quiz(quiz: Quiz, request: Request) -> Response:
    found = await _state(quiz, request, show=request.method == "GET")
    if found is None:
        return _see("/")
    if found.question is None:
        right = sum(good for _, good in found.results)
        return HTMLResponse(result_page(right, len(found.results), quiz.compare(found.results)))
    names = _image_names(quiz, found)
    _remember(quiz, _token(quiz, request), found)
    values = {
        "reference": names[0],
        "answers": names[1:],
        "form": sessions.form_name(quiz.key, found.number, found.position),
        "calibration": found.question.calibration,
        "done": found.position,
        "total": found.count,
        "questions": found.count - found.calibrations,
        "asked": found.position + 1,
        "calibrations": found.calibrations,
    }
    if found.told is None:
        return HTMLResponse(page("question", **values))
    told = {"right": found.question.right, "given": found.told}
    return HTMLResponse(page("feedback", **values, **told))


async def _answer(quiz: Quiz, request: Request) -> Response:
    form = await read_form(request, ("form", "answer", "ms"))
    if form["answer"] not in [str(k) for k in range(1, 1 + quiz.study.settings.answers)]:
        raise RefusedError(422, "There is no such answer.")
    if form["ms"] and not MILLISECONDS.fullmatch(form["ms"]):
        raise RefusedError(422, "This is no time.")
    await _run(
        quiz, sessions.answer,
        token=_token(quiz, request), form=form["form"], choice=int(form["answer"]) - 1,
        client_ms=float(form["ms"]) if form["ms"] else None, key=quiz.key,
    )  # fmt: skip
    quiz.asked.pop(_token(quiz, request), None)
    return _see("/quiz")


async def _next(quiz: Quiz, request: Request) -> Response:
    form = await read_form(request, ("form",))
    await _run(
        quiz, sessions.go_on, token=_token(quiz, request), form=form["form"], key=quiz.key
    )  # fmt: skip
    quiz.asked.pop(_token(quiz, request), None)
    return _see("/quiz")


async def _leave(quiz: Quiz, request: Request) -> Response:
    await read_form(request, ("leave",))
    found = await _state(quiz, request)
    if found is not None and not found.finished:
        raise RefusedError(409, "Your quiz is not finished yet.")
    response = _see("/")
    _set_cookie(quiz, response, request, "", 0)
    return response


async def _image(quiz: Quiz, request: Request) -> Response:
    name: str = request.path_params["name"]
    found = quiz.asked.get(_token(quiz, request))
    if name not in _image_names(quiz, found):
        found = await _state(quiz, request)
    names = _image_names(quiz, found)
    if found is None or found.question is None or name not in names:
        raise RefusedError(404, "There is no such image.")
    row, calibration = found.question.row, found.question.calibration
    images = quiz.study.kept_images(row, calibration)
    if images is None:
        images = await asyncio.to_thread(quiz.study.images, row, calibration)
    return Response(images[names.index(name)], media_type="image/png")


async def _static(_quiz: Quiz, request: Request) -> Response:
    found = static_files().get(request.path_params["name"])
    if found is None:
        raise RefusedError(404, "There is no such page.")
    return Response(found[0], media_type=found[1], headers={"Cache-Control": "max-age=600"})


async def _refused(_request: Request, error: Exception) -> Response:
    status, text = 500, ""
    if isinstance(error, RefusedError):
        status, text = error.status, error.text
    elif isinstance(error, HTTPException):
        status, text = error.status_code, "There is no such page."
    headers = {"Connection": "close"} if status in (408, 413, 415) else {}
    return HTMLResponse(page("problem", text=text), status, headers)


async def _unsaved(quiz: Quiz, _request: Request, error: Exception) -> Response:
    """Say that nothing was saved, to both the participant and whoever runs the server."""
    quiz.tell(f"an answer could not be saved: {error}; nobody was told that it was")
    text = "The last step could not be saved. Please tell those who run the study, then try again."
    return HTMLResponse(page("problem", text=text), 503)


async def _broken(quiz: Quiz, _request: Request, error: Exception) -> Response:
    quiz.tell(str(error))
    text = "The question cannot be shown. Please tell those who run the study."
    return HTMLResponse(page("problem", text=text), 500)


def _consent(quiz: Quiz, status: int = 200) -> Response:
    settings = quiz.study.settings
    text = page(
        "consent", questions=settings.questions, calibrations=settings.calibrations,
        answers=settings.answers, contact=quiz.contact, missing=status != 200,
    )  # fmt: skip
    return HTMLResponse(text, status)


def _image_names(quiz: Quiz, found: State | None) -> list[str]:
    """Return the names of the images of the question that is asked; none at the end."""
    if found is None or found.question is None:
        return []
    count = 1 + quiz.study.settings.answers
    return sessions.image_names(quiz.key, found.number, found.position, count)


def _remember(quiz: Quiz, token: str, found: State) -> None:
    """Keep what a session is asked, and forget the session that was remembered first."""
    quiz.asked[token] = found
    if len(quiz.asked) > MOST_ASKED:
        del quiz.asked[next(iter(quiz.asked))]


def _token(quiz: Quiz, request: Request) -> str:
    return request.cookies.get(quiz.cookie, "")


def _set_cookie(quiz: Quiz, response: Response, request: Request, token: str, seconds: int) -> None:
    response.set_cookie(
        quiz.cookie, token, max_age=seconds, path="/", httponly=True, samesite="lax",
        secure=request.url.scheme == "https",
    )  # fmt: skip


async def _state(quiz: Quiz, request: Request, show: bool = False) -> State | None:
    token = _token(quiz, request)
    if not token:
        return None
    found: State | None = await _run(quiz, sessions.show if show else sessions.state, token=token)
    return found


async def _run(quiz: Quiz, operation: Callable[..., Any], **arguments: Any) -> Any:
    return await asyncio.wrap_future(quiz.commits.run(partial(operation, **arguments)))


def _see(path: str) -> Response:
    return RedirectResponse(path, 303)
