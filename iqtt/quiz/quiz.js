// The quiz: consent, practice with the right answers told, the questions that count, the end.
// All that a participant did is in the browser's storage, so a reload goes on where it was.
"use strict";

const FORMAT = "pix2shape-bench/quiz-answers";
const WORDS = {
  cubes: {
    title: "Which shape is the same, rotated? A quiz",
    thing: "a shape made of cubes",
    task: "One option is the same shape, seen from another side. The other options are different" +
      " shapes, and some may be mirror images. Which option is the same shape?",
    rule: "All cubes of a shape are visible in every image.",
    ask: "Which option is the same shape as the reference, rotated?",
  },
  rooms: {
    title: "Which room is the same? A quiz",
    thing: "a furnished room",
    task: "One option is the same room, seen from another place. In the other options, furniture" +
      " stands elsewhere or faces another way. Which option is the same room?",
    rule: "All options are seen from one place.",
    ask: "Which option is the same room as the reference?",
  },
};
const LETTERS = "ABC";
const quiz = JSON.parse(document.getElementById("quiz").textContent);
const words = WORDS[quiz.about];
const main = document.getElementById("main");
const place = `${FORMAT}/${quiz.quiz}`;
let storage = true; // whether the browser keeps anything
let state = kept();
let buttons = []; // of the answers, once they show
let shown = null; // when all pictures of a question could be seen, milliseconds

// practice, answers: what was answered, in the order in which it was asked; seen: how many right
// answers of the practice were read; shows: how often the page of the next question was shown;
// saved: whether the answers have left the page.
function fresh() {
  return { participant: null, practice: [], answers: [], seen: 0, shows: 0, saved: false };
}

function kept() {
  try {
    return JSON.parse(localStorage.getItem(place)) ?? fresh();
  } catch {
    return fresh();
  }
}

function keep() {
  try {
    localStorage.setItem(place, JSON.stringify(state));
  } catch {
    storage = false;
  }
}

function randomName() {
  const bytes = crypto.getRandomValues(new Uint8Array(8));
  return [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

// Return the questions in the order of a participant: Fisher and Yates, by mulberry32.
function orderOf(participant) {
  let seed = parseInt(participant.slice(0, 8), 16) ^ parseInt(participant.slice(8), 16);
  const random = () => {
    seed = (seed + 0x6d2b79f5) | 0;
    let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
  const order = quiz.questions.map((_, i) => i);
  for (let i = order.length - 1; i > 0; i--) {
    const j = Math.floor(random() * (i + 1));
    [order[i], order[j]] = [order[j], order[i]];
  }
  return order;
}

// Return an element with attributes, and with texts or elements in it.
function make(tag, attributes = {}, ...inside) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "onclick") element.addEventListener("click", value);
    else element.setAttribute(name, value);
  }
  element.append(...inside);
  return element;
}

function show(title, ...elements) {
  document.title = title;
  main.replaceChildren(...elements);
  const target = main.querySelector("[autofocus]") ?? main.querySelector("h1");
  if (target.tagName === "H1") target.tabIndex = -1;
  window.scrollTo(0, 0);
  target.focus({ preventScroll: true });
}

function go(text, onclick, more = {}) {
  return make("button", { type: "button", class: "go", onclick, ...more }, text);
}

function count(number, text) {
  return `${number} ${text}${number === 1 ? "" : "s"}`;
}

function consent() {
  const box = make("input", { type: "checkbox", id: "consent", "aria-describedby": "missing" });
  const missing = make("p", { id: "missing", class: "missing", role: "alert" });
  const start = () => {
    if (!box.checked) {
      missing.textContent = "Please tick the box if you want to take part.";
      box.focus();
      return;
    }
    state = { ...fresh(), participant: randomName() };
    keep();
    next();
  };
  const sent = quiz.post
    ? "At the end, your responses are sent to the organisers of the study. You can keep a copy."
    : "At the end, you save your responses as a file and send it to the organisers of the study.";
  const rules = [
    words.rule,
    `Click an option, or press a key from 1 to ${quiz.answers}.`,
    "Work as fast as you can without mistakes. Guess if you do not know. You cannot return to an" +
      " earlier question.",
    "If you close or reload the page, the quiz resumes at the same question.",
  ];
  rules.unshift(`Then ${count(quiz.questions.length, "scored question")}.`);
  if (quiz.practice.length) {
    const first = count(quiz.practice.length, "question");
    rules.unshift(`First ${first} for practice. The correct option is shown after each.`);
  }
  show(
    words.title,
    make("h1", {}, words.title.split("?")[0] + "?"),
    make("p", {}, `Every question shows ${words.thing}, the `, make("strong", {}, "reference"),
      `, and ${quiz.answers} options. ${words.task}`),
    make("ul", {}, ...rules.map((rule) => make("li", {}, rule))),
    make("h2", {}, "What is recorded"),
    make("p", {}, "Your responses and the time of each are recorded under a random number. No name, no" +
      " network address and nothing about your browser or device are recorded. Your browser stores" +
      ` the responses, so that you can resume after a reload. ${sent} The organisers may publish the` +
      " responses. You may stop at any time by closing the page."),
    ...(quiz.contact ? [make("p", {}, `This study is run by: ${quiz.contact}`)] : []),
    ...(storage ? [] : [make("p", { class: "missing" },
      "Your browser stores nothing for this page: a reload loses your responses.")]),
    make("p", { class: "agree" }, box,
      make("label", { for: "consent" }, "I have read this, and I want to take part.")),
    missing,
    make("p", {}, go("Start", start)),
  );
}

function progress(title, done) {
  const total = quiz.practice.length + quiz.questions.length;
  return make("div", { class: "progress" }, make("span", { id: "progress" }, title),
    make("progress", { "aria-labelledby": "progress", value: done, max: total }));
}

// Return the pictures of a question, decoded: a picture is on the screen one frame after that.
async function picturesOf(question) {
  const images = question.pictures.map((text, k) => make("img", {
    src: `data:image/webp;base64,${text}`,
    alt: k ? "" : `The reference: ${words.thing}`,
    width: 256, height: 256,
  }));
  await Promise.all(images.map((image) => image.decode().catch(() => {})));
  return images;
}

function reference(image) {
  return make("figure", { class: "reference" }, image, make("figcaption", {}, "Reference"));
}

async function ask(question, title, done, answered) {
  state.shows += 1;
  keep();
  const [first, ...images] = await picturesOf(question);
  shown = null;
  const answer = (k) => {
    if (shown === null) return; // not seen yet, or answered
    const seconds = Math.round(performance.now() - shown) / 1000;
    shown = null;
    buttons = [];
    answered({ answer: k, seconds, times_shown: state.shows });
    state.shows = 0;
    keep();
    next();
  };
  buttons = images.map((image, k) => make("button",
    { type: "button", "aria-keyshortcuts": `${k + 1} ${LETTERS[k]}`, onclick: () => answer(k) },
    image, make("span", {}, `Option ${k + 1}`)));
  show(title, progress(title, done),
    make("h1", { class: "ask", id: "ask" }, words.ask),
    make("div", { class: `shapes shapes-${quiz.answers}`, role: "group", "aria-labelledby": "ask" },
      reference(first), ...buttons),
    make("p", { class: "hint" }, `Click an option, or press a key from 1 to ${quiz.answers}.`));
  requestAnimationFrame(() => {
    shown = performance.now();
  });
}

async function feedback(question, title, done) {
  const { answer } = state.practice.at(-1);
  const right = question.right;
  const [first, ...images] = await picturesOf(question);
  const figures = images.map((image, k) => {
    const [kind, text] = k === right ? ["right", ": correct"]
      : k === answer ? ["wrong", ": your choice, wrong"] : ["", ""];
    image.alt = words.thing;
    return make("figure", { class: kind }, image,
      make("figcaption", {}, `Option ${k + 1}${text}`));
  });
  const told = answer === right ? `Correct: option ${right + 1}.`
    : `Wrong: the correct option is ${right + 1}, not ${answer + 1}.`;
  const last = state.practice.length === quiz.practice.length;
  const onward = last ? `Start the ${count(quiz.questions.length, "scored question")}`
    : "Next practice question";
  const seen = () => {
    state.seen += 1;
    keep();
    next();
  };
  show(`${told} ${title}`, progress(title, done), make("h1", { class: "ask" }, told),
    make("div", { class: `shapes shapes-${quiz.answers}` }, reference(first), ...figures),
    make("p", { class: "on" }, go(onward, seen, { autofocus: "" })));
}

function answersFile() {
  return JSON.stringify({
    format: FORMAT, format_version: "1.0", quiz: quiz.quiz, digest: quiz.digest,
    participant: state.participant, answers: state.answers, practice: state.practice,
  }, null, 1) + "\n";
}

function download() {
  const address = URL.createObjectURL(new Blob([answersFile()], { type: "application/json" }));
  make("a", { href: address, download: `answers-${state.participant}.json` }).click();
  setTimeout(() => URL.revokeObjectURL(address), 60_000);
  state.saved = true;
  keep();
  end();
}

async function send(status) {
  status.textContent = "Sending your responses ...";
  try {
    const answer = await fetch(quiz.post, {
      method: "POST", body: answersFile(), headers: { "Content-Type": "application/json" },
    });
    if (!answer.ok) throw new Error(`status ${answer.status}`);
    state.saved = true;
    keep();
    end();
  } catch (error) {
    status.textContent = `Your responses could not be sent (${error.message}). Please try again, or` +
      " save the responses as a file and send it to the organisers of the study.";
    status.classList.add("missing");
    status.after(make("p", {}, go("Try again", () => end())));
  }
}

function end() {
  const status = make("p", { role: "status" });
  const leave = () => {
    try {
      localStorage.removeItem(place);
    } catch {
      // it kept nothing
    }
    state = fresh();
    next();
  };
  const sent = quiz.post && !state.saved;
  const text = state.saved ? "Your responses are saved. You can close this page."
    : quiz.post ? "" : "Please save your responses, and send the file to the organisers of the study.";
  show("Thank you", make("h1", {}, "Thank you. All questions are answered."),
    ...(text ? [make("p", {}, text)] : []), status,
    make("p", {}, make("button", { type: "button", class: quiz.post ? "go quiet" : "go",
      onclick: download }, "Save my responses as a file")),
    ...(state.saved ? [make("p", {}, make("button", { type: "button", class: "go quiet",
      onclick: leave }, "Start again for another participant"))] : []));
  if (sent) send(status);
}

function next() {
  const told = state.practice.length;
  const questions = quiz.questions.length;
  const done = state.answers.length;
  if (state.participant === null) {
    consent();
  } else if (state.seen < told) {
    feedback(quiz.practice[told - 1], `Practice question ${told} of ${quiz.practice.length}`, told);
  } else if (told < quiz.practice.length) {
    ask(quiz.practice[told], `Practice question ${told + 1} of ${quiz.practice.length}`, told,
      (given) => state.practice.push(given));
  } else if (done < questions) {
    const question = quiz.questions[orderOf(state.participant)[done]];
    ask(question, `Question ${done + 1} of ${questions}`, told + done,
      (given) => state.answers.push({ question: question.row, ...given }));
  } else {
    end();
  }
}

document.addEventListener("keydown", (event) => {
  if (event.repeat || event.ctrlKey || event.altKey || event.metaKey) return;
  const key = event.key.toLowerCase();
  const chosen = buttons["123".indexOf(key)] ?? buttons["abc".indexOf(key)];
  if (chosen) {
    event.preventDefault();
    chosen.click();
  }
});

keep();
next();
