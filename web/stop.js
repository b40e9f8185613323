// Stop and Hold. Imports nothing, so that it works when the scene, the feed or the tables do not.
//
// Both act at once and never ask. The token stands in the address's fragment, which no log and no server sees.

const [word, token] = location.hash.slice(1).split("=");
const mayOrder = word === "operate" && Boolean(token);
const result = document.getElementById("stop-result");
const bar = document.getElementById("bar");
const CANNOT = "Cannot stop from here: use the radio, or tomoswarm order CONFIG emergency.";
/** What has no answer by then is said to be in vain. */
const SLOW_MS = 2000;
/** What is to move somebody must not arrive later than this. */
const ANSWERED_WITHIN_MS = 4000;

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
    if (result.textContent.endsWith(CANNOT)) say("");
  }
}

/** Posts an order, or a mark, and says how that went; the answer's number, or null. What stops goes on when its answer takes long. */
export async function post(order, to = "order") {
  const source = document.documentElement.dataset.source ?? "LIVE";
  if (source !== "LIVE") {
    say(`A ${source.toLowerCase()}: it takes no orders.`, "refused");
    return null;
  }
  if (!mayOrder) {
    say("This link may look only: take the one with #operate.", "refused");
    return null;
  }
  const page = Number(document.documentElement.dataset.page ?? 0);
  const stops = order.order === "stop" || order.order === "hold";
  const slow = stops ? setTimeout(sayDead, SLOW_MS) : undefined;
  try {
    const answer = await fetch(to, {
      method: "POST",
      headers: { Authorization: `Bearer ${token}`, "Content-Type": "application/json" },
      body: JSON.stringify({ page, ...order }),
      keepalive: true,
      signal: stops ? undefined : AbortSignal.timeout(ANSWERED_WITHIN_MS),
    });
    const text = await answer.text();
    clearTimeout(slow);
    if (!answer.ok) {
      say(`${order.order ?? to} was refused: ${text}`, "refused");
      return null;
    }
    bar.classList.remove("dead");
    return JSON.parse(text).number;
  } catch (error) {
    clearTimeout(slow);
    const isLate = error.name === "TimeoutError";
    sayDead(isLate ? `${order.order ?? to} has no answer: whether it is given stands in its list. ` : "");
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

function isTyping(target) {
  return target instanceof HTMLElement && (target.isContentEditable || target.matches("input[type=text], input[type=number], textarea"));
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
}

atOnce("stop", stop);
atOnce("hold", hold);

addEventListener("keydown", (event) => {
  if (isTyping(event.target)) return;
  if (event.code === "Space") {
    event.preventDefault();
    if (!event.repeat) stop();
  } else if (event.key === "Enter" && event.target.matches?.("input[type=checkbox]")) {
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
  if (event.code === "Space" && !isTyping(event.target)) event.preventDefault();
}, { capture: true });

if (!mayOrder) {
  bar.classList.add("look");
  say("This link may look only.");
}
document.documentElement.dataset.mayStop = mayOrder ? "yes" : "no";
