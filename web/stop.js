// Stop and Hold. Imports nothing, so that it works when the scene, the feed or the tables do not.
//
// Both act at once and never ask. The token stands in the address's fragment, which no log and no server sees.

const [word, token] = location.hash.slice(1).split("=");
const mayOrder = word === "operate" && Boolean(token);
const result = document.getElementById("stop-result");
const bar = document.getElementById("bar");
const CANNOT = "Cannot stop from here: use the radio, or tomoswarm order CONFIG emergency.";

/** Posts an order, or a mark, and says how that went; the answer's number, or null. */
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
  try {
    const answer = await fetch(to, {
      method: "POST",
      headers: { Authorization: `Bearer ${token}`, "Content-Type": "application/json" },
      body: JSON.stringify({ page, ...order }),
      keepalive: true,
    });
    const text = await answer.text();
    if (!answer.ok) {
      say(`${order.order ?? to} was refused: ${text}`, "refused");
      return null;
    }
    bar.classList.remove("dead");
    return JSON.parse(text).number;
  } catch {
    bar.classList.add("dead");
    say(CANNOT, "refused");
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
