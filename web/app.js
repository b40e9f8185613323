// Puts the page together: the feed fills the model, and what has changed is drawn when the browser draws.

import { BeginPanel } from "./begin.js";
import { CellView } from "./cell.js";
import { Feed } from "./feed.js";
import { Fleet, GROUND_SILENT_MS } from "./fleet.js";
import { Ghost } from "./ghost.js";
import { ImagePanel } from "./image.js";
import { LogPanel, zone } from "./log.js";
import { MarkPanel } from "./marks.js";
import { Model } from "./model.js";
import { Orders } from "./orders.js";
import { Pace, setText } from "./pace.js";
import { PlanPanel } from "./plan.js";
import { PreflightPanel } from "./preflight.js";
import { RadioPanel } from "./radio.js";
import { Scene } from "./scene2d.js";
import { SettingsPanel } from "./settings.js";
import { say, secret, showLost } from "./stop.js";
import { Tabs } from "./tabs.js";
import { TimeBar, clock } from "./time.js";
import { SceneView } from "./view.js";
import { WhyPanel } from "./why.js";

const AGES_EVERY_MS = 250;
/** Between two drawings of the scene, and of the table of vehicles, that nothing but new data asks for. */
const SCENE_EVERY_MS = 80;
const FLEET_EVERY_MS = 200;
const STALE_MS = 3000;
/** What comes anew is drawn when all of it is there, or after this time. */
const FILLS_WITHIN_MS = 1000;

const token = location.hash.split("=")[1] ?? "";
const model = new Model();
const fleet = new Fleet(model);
const orders = new Orders(model, fleet);
const scene = new Scene(model);
scene.ghost = new Ghost(model, token, () => scene.wanted());
const view = new SceneView(model, fleet, scene, token);
const image = new ImagePanel(model);
new WhyPanel(model, scene, token);
new CellView(model, scene, view, token);
const panels = {
  plan: { panel: new PlanPanel(model), of: ["timetable", "progress", "welcome"] },
  radio: { panel: new RadioPanel(model, token), of: ["radio", "vehicle", "welcome"] },
  log: { panel: new LogPanel(model), of: ["events", "vehicle", "welcome"] },
  check: { panel: new PreflightPanel(model, token), of: ["states", "vehicle", "ground", "moment", "welcome"] },
  marks: { panel: new MarkPanel(model, scene), of: ["marks", "finds", "welcome"] },
  begin: { panel: new BeginPanel(model, fleet, scene, token), of: ["ground", "welcome"] },
  settings: { panel: new SettingsPanel(model, scene, token), of: ["ground", "welcome"] },
};
orders.heldButton("begin-mission", () => panels.begin.panel.give());
let filledBy_ms = 0;
let needsPanel = true;
let isWanted = false;
let needsScene = true;
let needsFleet = true;
let needsImage = true;
/** Whether the first picture was drawn, of all that was there: marked in the browser's own timing, with how many tiles it has. */
let isPictured = false;
/** Since when the page is seen: while it is not, nothing comes. */
let seenSince_ms = 0;

const feed = new Feed(token, secret, (buffer) => {
  const wasFilling = model.isFilling;
  model.take(buffer, performance.now());
  if (model.isFilling && !wasFilling) filledBy_ms = performance.now() + FILLS_WITHIN_MS;
  // Until then what was seen before stays.
  if (isFilling()) feed.drawn();
  else wantFrame();
}, () => {
  model.forgetParts();
  time.forget();
  showHead();
  wantFrame();
});

orders.isConnected = () => feed.isOpen;
const time = new TimeBar(model, feed);

scene.wanted = view.wanted = () => { needsScene = true; wantFrame(); };
image.wanted = () => { needsImage = true; needsScene = true; wantFrame(); };
const wantPanel = () => { needsPanel = true; wantFrame(); };
for (const { panel } of Object.values(panels)) panel.wanted = wantPanel;
const tabs = new Tabs(wantPanel);
const scenePace = new Pace(SCENE_EVERY_MS, () => { needsScene = true; wantFrame(); });
const fleetPace = new Pace(FLEET_EVERY_MS, () => { needsFleet = true; wantFrame(); });
addEventListener("theme", () => { needsScene = true; wantPanel(); });
addEventListener("resize", wantPanel);
document.getElementById("log-zone").textContent = `local time, ${zone()}`;

function isFilling() {
  return model.isFilling && performance.now() < filledBy_ms;
}

function wantFrame() {
  if (isWanted) return;
  isWanted = true;
  requestAnimationFrame(draw);
}

function draw() {
  isWanted = false;
  if (isFilling()) return;
  const now_ms = model.clock_ms(performance.now());
  const { changed } = model;
  if (changed.has("welcome") || changed.has("moment")) showPlace();
  time.show();
  if (changed.has("orders") || changed.has("welcome") || changed.has("vehicle")) orders.show();
  if (changed.has("image") || changed.has("finds") || needsImage) image.draw();
  drawPanel(now_ms);
  if (needsFleet || (changed.size > 0 && fleetPace.isDue())) showFleet(now_ms);
  if (needsScene || (changed.size > 0 && scenePace.isDue())) drawScene(now_ms);
  changed.clear();
  [needsScene, needsImage, needsPanel, needsFleet] = [false, false, false, false];
  rideAlong();
  feed.drawn();
}

/** What comes is drawn a dozen times a second; whoever moves the view sees it at once. */
function drawScene(now_ms) {
  view.draw(now_ms);
  scenePace.drawn();
  if (isPictured || !model.isWhole()) return;
  isPictured = true;
  performance.mark("picture", { detail: { tiles: model.tiles.size } });
}

function showFleet(now_ms) {
  fleet.show(now_ms);
  showHead();
  fleetPace.drawn();
}

/** What the range sensors hear is asked for while somebody looks. */
function rideAlong() {
  feed.ride(view.current === "ride" && !document.hidden ? view.riding : null);
}

/** Of the views that are made of texts only the one that is seen. */
function drawPanel(now_ms) {
  const shown = panels[tabs.current];
  if (shown && (needsPanel || shown.of.some((kind) => model.changed.has(kind)))) shown.panel.draw(now_ms);
}

/** The place whose name is shown. */
let shownPlace = null;

function showPlace() {
  const { place } = model;
  if (!place) return;
  const root = document.documentElement;
  // A moment of a live swarm that is over must never be taken for now.
  const showing = model.isLive() && !model.isPresent() ? "REPLAY" : place.showing;
  root.dataset.page = String(place.page);
  root.dataset.source = place.showing;
  if (root.dataset.showing === showing && shownPlace === place) return;
  root.dataset.showing = showing;
  shownPlace = place;
  document.getElementById("showing").textContent = showing;
  if (showing === "REPLAY") scene.setPick(null);
  document.getElementById("venue").textContent = place.venue;
  document.getElementById("truth-choice").hidden = !place.truth;
  document.getElementById("ghost-choice").hidden = !place.ghost;
  document.getElementById("ghost-choice").title = place.ghost ? `another run: ${place.ghost.name}` : "";
  if (!model.isLive()) {
    say(`A ${place.showing.toLowerCase()}: it takes no orders.`);
    document.getElementById("log-zone").textContent = "time of the run";
  }
  document.title = `${showing} · ${place.venue} · tomoswarm`;
}

function ageText(isStale, age_ms) {
  if (!feed.isOpen) return `NOT CONNECTED ${feed.why}`;
  if (isStale) return `NO DATA for ${(age_ms / 1000).toFixed(0)} s`;
  if (!model.isLive()) return `${clock(model.shown_ms / 1000)} of the run`;
  if (model.isPresent()) return "connected";
  const ago = `${clock(model.moment.to_s - model.shown_ms / 1000)} ago`;
  // Whether anybody is reached now is not known to a page that looks back.
  if (document.documentElement.dataset.mayStop !== "yes") return ago;
  return `${ago}; STOP and Hold are sent at once, Now (N) shows whom they reach`;
}

/** Whether nothing comes from the page's program; a page that has just been opened waits for it first. */
function isLost(now_ms) {
  const quiet_ms = now_ms - Math.max(model.heard_ms, seenSince_ms);
  return model.isLive() && now_ms > STALE_MS && (!feed.isOpen || quiet_ms > STALE_MS);
}

function showHead() {
  const now_ms = performance.now();
  const age_ms = now_ms - model.heard_ms;
  const isStale = !feed.isOpen || age_ms > STALE_MS;
  showLost(isLost(now_ms));
  document.documentElement.classList.toggle("stale", isStale);
  const age = document.getElementById("age");
  const text = ageText(isStale, age_ms);
  setText(age, text);
  // Said aloud when it is another, and not as each second passes.
  setText(document.getElementById("age-said"), text.replace(/[0-9]+([:.][0-9]+)* ?(s\b)?/g, ""));
  const ground = model.ground;
  const quiet_ms = ground?.isHeard ? model.clock_ms(now_ms) - ground.at_ms : 0;
  const isSilent = quiet_ms > GROUND_SILENT_MS;
  const run = ground?.isHeard ? `run ${ground.run}, ${ground.phase}, lap ${ground.lapsDone} of ${ground.laps}` : "no ground station";
  setText(document.getElementById("run"), isSilent ? `${run}; the ground station is SILENT for ${(quiet_ms / 1000).toFixed(0)} s` : run);
  let count = ground?.isHeard && !isSilent ? ground.troubles.length : 0;
  for (const vehicle of model.vehicles.values()) count += vehicle.health?.troubles.length ?? 0;
  setText(document.getElementById("troubles"), count === 0 ? "no troubles" : `${count} troubles`);
}

setInterval(() => {
  if (document.hidden) return;
  if (isFilling()) return;
  const now_ms = model.clock_ms(performance.now());
  showFleet(now_ms);
  const isAnySilent = [...model.states.keys()].some((id) => model.isSilent(id, now_ms));
  if (isAnySilent) scene.wanted();
  if (tabs.current === "radio" && model.pairs.size > 0) wantPanel();
}, AGES_EVERY_MS);

document.addEventListener("visibilitychange", () => {
  seenSince_ms = performance.now();
  rideAlong();
});

const keys = document.getElementById("keys");
// Stop must work beside it, by pointer too: nothing else is kept from the operator meanwhile.
document.getElementById("help").addEventListener("click", () => keys.show());
addEventListener("keydown", (event) => {
  if (event.key !== "Escape" || !keys.open) return;
  // Not the selection as well.
  event.stopPropagation();
  keys.close();
}, { capture: true });
addEventListener("keydown", (event) => {
  const isElsewhere = document.documentElement.dataset.keys === "off" || event.ctrlKey || event.altKey || event.metaKey
    || event.target.matches?.("input, select, textarea");
  if (event.key === "?" && !isElsewhere && !keys.open) keys.show();
  if (event.key.toLowerCase() !== "m" || isElsewhere) return;
  event.preventDefault();
  tabs.open("marks");
  panels.marks.panel.focus();
});

// For tests, and for whoever looks into the page.
globalThis.tomoswarm = { model, scene, view, feed, time };
