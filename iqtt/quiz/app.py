"""The quiz as a web application: each page and form is one of a participant's steps.

GET  /            what the study is, and consent
POST /start       begins a session: a signed cookie with the participant's random name
GET  /quiz        the question that is asked now, its right answer in the calibration, the end
POST /answer      answers it
POST /next        goes on after the right answer was told
POST /leave       forgets the session, for the next person at this machine
GET  /image/P/K   image K of the question at position P, if it is asked now; 0 is the reference
"""

import asyncio
import re
import sqlite3
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.sessions import SessionMiddleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, Router
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp

from iqtt.questions.specs import LETTERS
from iqtt.quiz import sessions
from iqtt.quiz.commits import Commits
from iqtt.quiz.guards import FixedHeaders, OwnPagesOnly, read_form
from iqtt.quiz.sessions import RefusedError, State
from iqtt.quiz.study import Study
from scenegen.common.errors import SceneGenError
from scenegen.common.web_hosts import Hosts

FOLDER = Path(__file__).parent
COOKIE_SECONDS = 30 * 24 * 3600
POSITION = re.compile(r"[0-9]{1,4}")
MILLISECONDS = re.compile(r"[0-9]{1,9}(\.[0-9]{1,6})?")

_PAGES = Environment(
    loader=FileSystemLoader(FOLDER / "templates", encoding="utf-8"),
    autoescape=True,
    undefined=StrictUndefined,
    auto_reload=False,
    trim_blocks=True,
    lstrip_blocks=True,
)
_PAGES.globals["letters"] = LETTERS


def page(template: str, **values: Any) -> str:
    """Return a page: `templates/<template>.html`, filled with these values, which are escaped.

    Pages load nothing but the files of this folder.
    """
    return _PAGES.get_template(f"{template}.html").render(**values)


@dataclass(frozen=True)
class Quiz:
    """What the pages need.

    Attributes:
        commits: runs operations on the file of answers.
        key: what cookies are signed with.
        contact: who answers for the study; may be empty.
        most: how many participants there may be.
        tell: prints a line for whoever runs the server.
    """

    study: Study
    commits: Commits
    key: str
    tell: Callable[[str], None]
    contact: str = ""
    most: int = sessions.MOST_PARTICIPANTS


def make_app(quiz: Quiz, hosts: Hosts) -> ASGIApp:
    """Return the application, which takes requests to these hosts only."""
    steps = (
        ("/", _home, "GET"), ("/start", _start, "POST"), ("/quiz", _quiz, "GET"),
        ("/answer", _answer, "POST"), ("/next", _next, "POST"), ("/leave", _leave, "POST"),
        ("/image/{position:int}/{k:int}", _image, "GET"),
    )  # fmt: skip
    routes = [Route(path, partial(step, quiz), methods=[method]) for path, step, method in steps]
    router = Router(
        [*routes, Mount("/static", StaticFiles(directory=FOLDER / "static"))],
        redirect_slashes=False,
        middleware=[Middleware(OwnPagesOnly, hosts=hosts)],
    )
    cookie = Middleware(
        SessionMiddleware,
        secret_key=quiz.key,
        session_cookie=f"quiz_{quiz.study.settings.fingerprint[:8]}",
        max_age=COOKIE_SECONDS,
    )
    handlers: dict[Any, Any] = {
        RefusedError: _refused,
        HTTPException: _not_there,
        sqlite3.Error: partial(_unsaved, quiz),
        SceneGenError: partial(_broken, quiz),
    }
    app = Starlette(
        routes=[Mount("/", router)], middleware=[cookie], exception_handlers=handlers
    )  # fmt: skip
    return FixedHeaders(app)


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
    name = await _run(quiz, sessions.begin, draw=quiz.study.draw, most=quiz.most)
    request.session["participant"] = name
    return _see("/quiz")


async def _quiz(quiz: Quiz, request: Request) -> Response:
    now = await _state(quiz, request, show=request.method == "GET")
    if now is None:
        return _see("/")
    if now.question is None:
        count = now.count - now.calibrations
        return HTMLResponse(page("result", right=now.right, count=count))
    values = {
        "position": now.position,
        "answers": quiz.study.settings.answers,
        "calibration": now.question.calibration,
        "done": now.position,
        "total": now.count,
        "questions": now.count - now.calibrations,
        "asked": now.position + 1,
        "calibrations": now.calibrations,
    }
    if now.told is None:
        return HTMLResponse(page("question", **values))
    return HTMLResponse(page("feedback", **values, right=now.question.right, given=now.told))


async def _answer(quiz: Quiz, request: Request) -> Response:
    form = await read_form(request, ("position", "answer", "ms"))
    if form["answer"] not in [str(k) for k in range(1, 1 + quiz.study.settings.answers)]:
        raise RefusedError(422, "There is no such answer.")
    if form["ms"] and not MILLISECONDS.fullmatch(form["ms"]):
        raise RefusedError(422, "This is no time.")
    choice, ms = int(form["answer"]) - 1, float(form["ms"]) if form["ms"] else None
    return await _go(quiz, request, form, partial(sessions.answer, choice=choice, client_ms=ms))


async def _next(quiz: Quiz, request: Request) -> Response:
    return await _go(quiz, request, await read_form(request, ("position",)), sessions.go_on)


async def _leave(quiz: Quiz, request: Request) -> Response:
    await read_form(request, ("leave",))
    now = await _state(quiz, request)
    if now is not None and now.question is not None:
        raise RefusedError(409, "Your quiz is not finished yet.")
    request.session.clear()
    return _see("/")


async def _image(quiz: Quiz, request: Request) -> Response:
    position, k = request.path_params["position"], request.path_params["k"]
    now = await _state(quiz, request)
    question = now.question if now is not None and now.position == position else None
    if question is None or k > quiz.study.settings.answers:
        raise RefusedError(404, "There is no such image.")
    pool, row = quiz.study.pool_of(question), question.row
    images = pool.kept_images(row)
    if images is None:
        images = await asyncio.to_thread(pool.images, row)
    return Response(images[k], media_type="image/png")


async def _refused(_request: Request, error: Exception) -> Response:
    assert isinstance(error, RefusedError)
    headers = {"Connection": "close"} if error.status in (408, 413, 415) else {}
    return HTMLResponse(page("problem", text=error.text), error.status, headers)


async def _not_there(_request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    return HTMLResponse(page("problem", text="There is no such page."), error.status_code)


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


def _name(request: Request) -> str:
    """Return the name that the cookie holds; empty without a cookie that we signed."""
    return str(request.session.get("participant", ""))


async def _go(quiz: Quiz, request: Request, form: Any, operation: Callable[..., None]) -> Response:
    """Take a step from the question that a form belongs to."""
    if not POSITION.fullmatch(form["position"]):
        raise RefusedError(422, "There is no such question.")
    await _run(quiz, operation, name=_name(request), position=int(form["position"]))
    return _see("/quiz")


async def _state(quiz: Quiz, request: Request, show: bool = False) -> State | None:
    if not _name(request):
        return None
    operation = sessions.show if show else sessions.state
    now: State | None = await _run(quiz, operation, name=_name(request))
    return now


async def _run(quiz: Quiz, operation: Callable[..., Any], **arguments: Any) -> Any:
    return await asyncio.wrap_future(quiz.commits.run(partial(operation, **arguments)))


def _see(path: str) -> Response:
    return RedirectResponse(path, 303)
