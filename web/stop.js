// Stop and Hold. Imports nothing, so that it works when the scene, the feed or the tables do not.
//
// Both act at once and never ask. The token stands in the address's fragment, which no log and no server sees.

const [word, token] = location.hash.slice(1).split("=");
const mayOrder = word === "operate" && Boolean(token);
/** Told to the server alone, so that nobody else gives orders in this page's name. */
export const secret = [...crypto.getRandomValues(new Uint8Array(16))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
const result = document.getElementById("stop-result");
const bar = document.getElementById("bar");
const CANNOT = "Cannot stop from here: use the radio, or tomoswarm order CONFIG emergency.";
/** An attempt to stop that has no answer by then is given up for the next one: it would keep one of the few connections. */
const ATTEMPT_MS = 1500;
/** A stop that did not get through is sent again so soon. */
const AGAIN_MS = 500;
/** What is to move somebody must not arrive later than this. */
const ANSWERED_WITHIN_MS = 4000;
/** The server's word that there is no room for the moment. */
const TOO_MANY = 429;
/** Longest body, in letters, that is sent by a page that is closed meanwhile. */
const KEPT_ALIVE_MAX = 4000;
/** Stops that have no answer yet, by what they say. */
const undelivered = new Map();

// A link that is pasted into an open page has another token.
addEventListener("hashchange", () => location.reload());

/** Says that nothing of this page arrives. */
function sayDead(words = "") {
  bar.classList.add("dead");
  say(`${words}${CANNOT}`, "refused");
}

/** Shows whether the page's program is lost: then nobody may be stopped from here, though orders are tried all the same. */
export function showLost(isLost) {
  if (!mayOrder || bar.classList.contains("lost") === isLost) return;
  bar.classList.toggle("lost", isLost);
  if (isLost) say(CANNOT, "refused");
  else {
    bar.classList.remove("dead");
    if (result.textContent.endsWith(CANNOT) && undelivered.size === 0) say("");
  }
}

/** Posts an order, or a mark, and says how that went; the answer's number, or null. What stops is sent until it has an answer. */
export function post(order, to = "order") {
  const stops = order.order === "stop" || order.order === "hold";
  if (!stops) return postOnce(order, to);
  const key = JSON.stringify(order);
  if (!undelivered.has(key)) undelivered.set(key, postUntilAnswered(order).finally(() => undelivered.delete(key)));
  return undelivered.get(key);
}

/** Said again it is the same stop to the server, so that nothing is lost but time. */
async function postUntilAnswered(order) {
  for (;;) {
    const refusal = refusalHere();
    if (refusal) return refuse(refusal);
    try {
      const answer = await send(order, "order", ATTEMPT_MS);
      if (answer.status !== TOO_MANY) return await numberOf(answer, order.order);
    } catch {
      sayDead(`The ${order.order} is NOT DELIVERED, and is sent again until it is. `);
    }
    await new Promise((resolve) => { setTimeout(resolve, AGAIN_MS); });
  }
}

/** Why this page may not order, or an empty text. */
function refusalHere() {
  const source = document.documentElement.dataset.source ?? "LIVE";
  if (source !== "LIVE") return `A ${source.toLowerCase()}: it takes no orders.`;
  return mayOrder ? "" : "This link may look only: take the one with #operate.";
}

function refuse(words) {
  say(words, "refused");
  return null;
}

function send(order, to, within_ms) {
  const page = Number(document.documentElement.dataset.page ?? 0);
  const body = JSON.stringify(to === "order" ? { page, secret, ...order } : { page, ...order });
  return fetch(to, {
    method: "POST",
    headers: { Authorization: `Bearer ${token}`, "Content-Type": "application/json" },
    body,
    // A page that is closed sends it all the same; browsers do that with short ones only.
    keepalive: body.length <= KEPT_ALIVE_MAX,
    signal: AbortSignal.timeout(within_ms),
  });
}

async function numberOf(answer, what) {
  const text = await answer.text();
  if (!answer.ok) return refuse(`${what} was refused: ${text}`);
  bar.classList.remove("dead");
  return JSON.parse(text).number;
}

async function postOnce(order, to) {
  const what = order.order ?? to;
  const refusal = refusalHere();
  if (refusal) return refuse(refusal);
  try {
    return await numberOf(await send(order, to, ANSWERED_WITHIN_MS), what);
  } catch (error) {
    if (error.name === "TimeoutError") sayDead(`${what} has no answer: whether it is given stands in its list. `);
    else sayDead(`${what} is not delivered. `);
    return null;
  }
}

/** Shows one line beside the bar. */
export function say(text, kind = "") {
  result.textContent = text;
  result.className = kind;
}

async function stop() {
  say("Stop: sending …");
  const number = await post({ order: "stop" });
  if (number !== null) {
    document.documentElement.dataset.stopNumber = String(number);
    say("Stop is given. Who shows it stands under Orders.", "given");
  }
}

async function hold() {
  const vehicles = (document.documentElement.dataset.selected ?? "").split(",").filter(Boolean).map(Number);
  say("Hold: sending …");
  const number = await post({ order: "hold", vehicles });
  if (number !== null) say(`Hold is given to ${vehicles.length ? vehicles.join(", ") : "all"}.`, "given");
}

/** Whether a key writes into what has the focus, or chooses in it. Fields for numbers and lists take no spaces. */
function isTyping(target, isSpace) {
  if (!(target instanceof HTMLElement)) return false;
  const fields = isSpace ? "input[type=text], textarea" : "input[type=text], input[type=number], select, textarea";
  return target.isContentEditable || target.matches(fields);
}

function atOnce(id, act) {
  const button = document.getElementById(id);
  button.addEventListener("pointerdown", (event) => {
    if (event.button === 0) act();
  });
  // From the keyboard, or by a screen reader.
  button.addEventListener("click", (event) => {
    if (event.detail === 0) act();
  });
  // Browsers click a button again and again while Enter is held.
  button.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && event.repeat) event.preventDefault();
  });
}

atOnce("stop", stop);
atOnce("hold", hold);

addEventListener("keydown", (event) => {
  const isSpace = event.code === "Space";
  if (isTyping(event.target, isSpace)) {
    if (isSpace && !event.repeat && result.textContent === "") say("Space writes here. To stop: the button, or Escape and then Space.");
    if (event.key === "Escape" && event.target instanceof HTMLElement) event.target.blur();
    return;
  }
  if (isSpace) {
    event.preventDefault();
    if (!event.repeat) stop();
  } else if (event.key === "Enter" && event.target instanceof HTMLInputElement && event.target.type === "checkbox") {
    // Space, which ticks a box elsewhere, is Stop.
    event.preventDefault();
    if (!event.repeat) event.target.click();
  } else if (event.key.toLowerCase() === "h" && document.documentElement.dataset.keys !== "off" && !event.ctrlKey && !event.altKey && !event.metaKey) {
    event.preventDefault();
    if (!event.repeat) hold();
  }
}, { capture: true });

// A button with the focus would be clicked by the space key as well.
addEventListener("keyup", (event) => {
  if (event.code === "Space" && !isTyping(event.target, true)) event.preventDefault();
}, { capture: true });

if (!mayOrder) {
  bar.classList.add("look");
  say("This link may look only.");
}
document.documentElement.dataset.mayStop = mayOrder ? "yes" : "no";
// Stop and Hold work from now on, in the browser's own timing.
performance.mark("controls");
