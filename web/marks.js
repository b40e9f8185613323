// Where somebody truly stands: the marks that are known, how far the nearest find is from each, and a form that marks a place or
// takes a mark back. A place is typed, or pointed at in the scene. It moves nobody; the page shows the command.

/** @import { Model } from "./model.js" */

import { post, say } from "./stop.js";

/** The colour of a mark in the scene, and its size: that of a person, metres. */
export const MARK = "#7a1fa0";
export const MARK_RADIUS_M = 0.25;
const SUBJECTS = ["the structure", "the change"];
const STATES = {
  stored: "",
  asked: ", asked for, not stored yet",
  "taking back": ", asked to be taken back",
};

export class MarkPanel {
  constructor(/** @type {Model} */ model, scene) {
    this.model = model;
    this.scene = scene;
    this.wanted = () => {};
    this.x = document.getElementById("mark-x");
    this.y = document.getElementById("mark-y");
    this.run = document.getElementById("mark-run");
    this.point = document.getElementById("mark-point");
    const form = document.getElementById("mark-form");
    form.addEventListener("input", () => this.show());
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.give(this.place(), this.chosenRun(), false);
    });
    this.point.addEventListener("click", () => this.pointAtScene());
    this.show();
  }

  /** To where a key leads. */
  focus() {
    this.x.focus();
  }

  place() {
    return [Number(this.x.value), Number(this.y.value)];
  }

  chosenRun() {
    return this.run.value === "" ? null : Number(this.run.value);
  }

  pointAtScene() {
    if (this.point.getAttribute("aria-pressed") === "true") return this.scene.setPick(null);
    this.scene.setPick((x, y) => {
      [this.x.value, this.y.value] = [x.toFixed(2), y.toFixed(2)];
      this.show();
    }, () => this.point.setAttribute("aria-pressed", "false"));
    this.point.setAttribute("aria-pressed", "true");
  }

  /** What is filled in: in the scene, and as a command. */
  show() {
    const isFilled = this.x.value !== "" && this.y.value !== "";
    this.scene.candidate = isFilled ? this.place() : null;
    this.scene.wanted();
    const text = isFilled ? markCommand(this.place(), this.chosenRun(), false) : "tomoswarm order CONFIG mark X,Y";
    document.getElementById("mark-command").textContent = text;
  }

  async give(place, run, takeBack) {
    const order = { at: place, take_back: takeBack };
    if (run !== null) order.run = run;
    const number = await post(order, "mark");
    const result = document.getElementById("mark-result");
    if (number === null) {
      result.textContent = document.getElementById("stop-result").textContent;
      return;
    }
    result.textContent = `Mark ${number} is said: ${markCommand(place, run, takeBack)}`;
    if (takeBack) return;
    [this.x.value, this.y.value] = ["", ""];
    this.show();
    say("A mark is said; whether it is stored stands under Marks.", "given");
  }

  draw() {
    const { marks, given } = this.model.marks;
    const finds = [...this.model.finds.values()];
    const key = JSON.stringify([marks, given.map(({ age_s, ...rest }) => rest), finds, this.model.place?.mayOrder]);
    if (key === this.drawnKey) return;
    this.drawnKey = key;
    const mayOrder = this.model.place?.mayOrder === true;
    for (const id of ["mark-give", "mark-point"]) document.getElementById(id).disabled = !mayOrder;
    const head = marks.length ? "" : "No mark is known: no ground station that is heard has said one.";
    document.getElementById("mark-none").textContent = head;
    document.getElementById("mark-list").replaceChildren(...marks.map((mark) => this.row(mark, finds, mayOrder)));
    document.getElementById("mark-given").replaceChildren(...[...given].reverse().map(givenRow));
  }

  row(mark, finds, mayOrder) {
    const made = document.createElement("li");
    const place = placeText(mark.at);
    made.append(`run ${mark.run}: ${place}${STATES[mark.state] ?? ""}${nearest(mark, finds)} `);
    const button = document.createElement("button");
    button.type = "button";
    button.className = "take-back";
    button.textContent = "Take back";
    button.setAttribute("aria-label", `Take back the mark at ${place} of run ${mark.run}`);
    button.title = markCommand(mark.at, mark.run, true);
    button.disabled = !mayOrder;
    button.addEventListener("click", () => this.give(mark.at, mark.run, true));
    made.append(button);
    return made;
  }
}

/** The marks that both views of the scene draw, each with a word: those that are known, on their way, and one that is filled in. */
export function marksOf(/** @type {Model} */ model, candidate) {
  const { marks, given } = model.marks;
  const present = model.ground?.run;
  const known = marks.map(({ run, at, state }) => {
    const of = run === present ? "" : ` (run ${run})`;
    return { at, word: `${state === "stored" ? "marked" : state}${of}`, isStored: state === "stored" };
  });
  // A mark that is to be taken back is among those that are known.
  const isComing = ({ isOver, takeBack }) => !isOver && !takeBack;
  const underWay = given.filter(isComing).map(({ at }) => ({ at, word: "on its way", isStored: false }));
  return [...known, ...underWay, ...(candidate ? [{ at: candidate, word: "mark?", isStored: false }] : [])];
}

/** What says the same in a terminal; after -- nothing is an option, so that a coordinate may be below zero. */
export function markCommand(place, run, takeBack) {
  const [x, y] = place;
  const options = [run === null ? "" : ` --run ${run}`, takeBack ? " --take-back" : ""].join("");
  return `tomoswarm order CONFIG mark${options} ${x < 0 ? "-- " : ""}${x},${y}`;
}

function placeText([x, y]) {
  return `x ${x.toFixed(2)}, y ${y.toFixed(2)} m`;
}

/** How far away the nearest find of each image of the same run is. */
function nearest(mark, all) {
  const away = all.filter(({ run }) => run === mark.run).map(({ subject, finds }) => {
    const distances = finds.map(({ at }) => Math.hypot(at[0] - mark.at[0], at[1] - mark.at[1]));
    const words = distances.length ? `the nearest find ${Math.min(...distances).toFixed(2)} m away` : "no find";
    return `; ${SUBJECTS[subject]}: ${words}`;
  });
  return away.join("");
}

function givenRow(given) {
  const made = document.createElement("li");
  const what = given.takeBack ? "take back" : "mark";
  const head = `${given.number}: ${what} ${placeText(given.at)}, by page ${given.page}`;
  made.className = given.isDone ? "done" : given.isOver ? "failed" : "open";
  made.textContent = `${head}: ${given.isOver ? `${given.isDone ? "" : "NOT DONE: "}${given.words}` : "on its way"}`;
  return made;
}
