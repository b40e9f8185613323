// Why a pixel is dark: its value as the sum of what each link adds, asked from the server, told in words and drawn through the scene.
// The picture is pointed at, or the scene where it lies, or a place is given. The page shows the command, of files that it saves.

/** @import { Model } from "./model.js" */
/** @import { Why, WhyLink } from "./told" */

import { ANSWERED_WITHIN_MS } from "./pace.js";

const CRIMSON = [185, 10, 50];
const TEAL = [0, 120, 112];
/** Links in words, and drawn. */
const WORDS = 6;
const DRAWN = 60;
/** Links that add less than this share of the strongest are not drawn. */
const LEAST = 0.05;

export class WhyPanel {
  constructor(/** @type {Model} */ model, scene, token) {
    this.model = model;
    this.scene = scene;
    this.token = token;
    this.fields = ["why-x", "why-y"].map((id) => document.getElementById(id));
    this.result = document.getElementById("why-result");
    document.getElementById("why-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.ask(this.fields.map((field) => Number(field.value)));
    });
    document.getElementById("why-clear").addEventListener("click", () => this.clear());
    document.getElementById("heat").addEventListener("click", (event) => this.point(event));
    showCommand(null);
    scene.pointedAt = (x, y) => this.pointInScene([x, y]);
  }

  subject() {
    return Number(document.getElementById("image-subject").value);
  }

  /** The place of the picture that was pointed at. */
  point(event) {
    const image = this.model.images.get(this.subject());
    if (!image) return;
    const box = event.target.getBoundingClientRect();
    const [across, down] = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
    const x = image.least_x_mm + across * (image.greatest_x_mm - image.least_x_mm);
    const y = image.greatest_y_mm - down * (image.greatest_y_mm - image.least_y_mm);
    this.askAt([x, y].map((mm) => mm / 1000));
  }

  /** The scene was pointed at: at the image, if that is what is looked at and lies there. */
  pointInScene([x, y]) {
    const image = this.model.images.get(this.subject());
    const isLookedAt = image && this.scene.layers.image.checked && !document.getElementById("image").hidden;
    if (isLookedAt && !Number.isNaN(valueAt(image, [x, y]))) this.askAt([x, y]);
  }

  askAt(at) {
    const place = at.map((metres) => Math.round(metres * 100) / 100);
    this.fields.forEach((field, axis) => { field.value = String(place[axis]); });
    this.ask(place);
  }

  async ask(at) {
    this.result.textContent = "The links are being asked …";
    document.getElementById("why-links").replaceChildren();
    try {
      const answer = await fetch("why", {
        method: "POST",
        headers: { Authorization: `Bearer ${this.token}`, "Content-Type": "application/json" },
        signal: AbortSignal.timeout(ANSWERED_WITHIN_MS),
        body: JSON.stringify({ subject: this.subject(), at, page: this.model.place?.page }),
      });
      const text = await answer.text();
      if (answer.ok) this.show(JSON.parse(text));
      else this.refuse(text);
    } catch {
      this.refuse("the server does not answer");
    }
  }

  refuse(why) {
    this.clear();
    this.result.textContent = `No answer: ${why}.`;
  }

  clear() {
    this.scene.why = null;
    this.scene.wanted();
    this.result.textContent = "Point at the image, or give a place.";
    document.getElementById("why-links").replaceChildren();
    document.getElementById("why-clear").hidden = true;
    showCommand(null);
  }

  show(/** @type {Why} */ answer) {
    const image = this.model.images.get(this.subject());
    const shown = image ? valueAt(image, answer.at) : NaN;
    const [x, y] = answer.at.map((metres) => metres.toFixed(2));
    const least = answer.leastCovered_deg === null ? "no link goes through it" : `fewest links come from ${answer.leastCovered_deg.toFixed(0)}° to the x axis`;
    // Links are pooled in squares of its own by a ground station; a tenth more or less is no lack.
    const lacks = answer.links < 0.9 * answer.madeOf ? ` (the image was made of ${answer.madeOf}: this page's program has not heard all)` : "";
    const empty = answer.emptyRun === null ? "" : ` against run ${answer.emptyRun}`;
    showCommand(answer);
    this.result.textContent =
      `x ${x}, y ${y} m: ${answer.value_dbpm.toFixed(3)} dB/m is the sum of ${answer.links} links of run ${answer.run}${empty}${lacks} (solver map); ` +
      `the image shows ${Number.isNaN(shown) ? "nothing" : shown.toFixed(3)}. ${least}; ${answer.residualRms_db.toFixed(1)} dB stay unexplained.`;
    const strongest = Math.abs(answer.told[0]?.share_dbpm ?? 1) || 1;
    const drawn = answer.told.slice(0, DRAWN).filter((link) => Math.abs(link.share_dbpm) >= LEAST * strongest);
    const lines = drawn.map((link) => ({ ...link, colour: link.share_dbpm >= 0 ? CRIMSON : TEAL, share: Math.abs(link.share_dbpm) / strongest }));
    this.scene.why = { at: answer.at, lines };
    this.scene.wanted();
    document.getElementById("why-links").replaceChildren(...answer.told.slice(0, WORDS).map(inWords), ...rest(answer));
    document.getElementById("why-clear").hidden = false;
  }
}

/** What says the same in a terminal; null = of any pixel. */
function showCommand(/** @type {Why} */ answer) {
  const [run, emptyRun, at] = answer ? [answer.run, answer.emptyRun, answer.at.map((metres) => metres.toFixed(2)).join()] : ["N", "M", "X,Y"];
  const empty = emptyRun === null ? "" : ` --empty run-${emptyRun}-links.csv`;
  document.getElementById("why-command").textContent = `tomoswarm image run-${run}-links.csv${empty} --why ${at}`;
}

function inWords(/** @type {WhyLink} */ link) {
  // No minus before a zero.
  const tenths = (metres) => (Math.round(metres * 10) / 10 + 0).toFixed(1);
  const place = ([x, y]) => `(${tenths(x)}, ${tenths(y)})`;
  return item(
    `${place(link.from)} to ${place(link.to)}${by(link.vehicles)} ${added(link.share_dbpm)}: ${link.length_m.toFixed(1)} m long, lost ` +
    `${link.loss_db.toFixed(1)} ± ${link.sd_db.toFixed(1)} dB by ${packets(link)}, ${link.residual_db.toFixed(1)} dB of it unexplained`,
  );
}

/** How many packets of a link were heard, and how many missed where any were. */
function packets(/** @type {WhyLink} */ { packets, misses }) {
  const heard = `${packets} ${packets === 1 ? "packet" : "packets"}`;
  return misses > 0 ? `${heard} (${misses} missed)` : heard;
}

/** Who has measured a link, as far as that is known. */
function by(vehicles) {
  return vehicles.length ? `, between ${vehicles.join(", ")},` : "";
}

/** What all links add that are not told one by one, if there are any. */
function rest(/** @type {Why} */ { told, links, untold_dbpm }) {
  const share = told.slice(WORDS).reduce((sum, link) => sum + link.share_dbpm, untold_dbpm);
  const count = links - WORDS;
  return count > 0 ? [item(`all ${count} others together ${added(share, "add", "take")}`)] : [];
}

function added(share_dbpm, adds = "adds", takes = "takes") {
  return `${share_dbpm >= 0 ? adds : takes} ${Math.abs(share_dbpm).toFixed(3)} dB/m`;
}

function item(text) {
  const made = document.createElement("li");
  made.textContent = text;
  return made;
}

function valueAt(image, [x, y]) {
  const share = (at, least, greatest) => (at * 1000 - least) / (greatest - least);
  const column = Math.floor(share(x, image.least_x_mm, image.greatest_x_mm) * image.columns);
  const row = Math.floor(share(y, image.least_y_mm, image.greatest_y_mm) * image.rows);
  const isInside = column >= 0 && column < image.columns && row >= 0 && row < image.rows;
  return isInside ? image.mean[row * image.columns + column] : NaN;
}
