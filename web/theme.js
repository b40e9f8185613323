// Light, dark, or sunlight (no greys, larger letters), and whether letters and numbers are keys; kept in the browser. Imports
// nothing, so that it works when the rest does not.

const root = document.documentElement;
const theme = document.getElementById("theme");
const keys = document.getElementById("single-keys");
const isDark = matchMedia("(prefers-color-scheme: dark)");

function kept(name) {
  try {
    return localStorage.getItem(name);
  } catch {
    return null;
  }
}

function keep(name, value) {
  try {
    localStorage.setItem(name, value);
  } catch {
    // A browser that keeps nothing still shows it until the page is left.
  }
}

function show() {
  const chosen = theme.value === "auto" ? (isDark.matches ? "dark" : "light") : theme.value;
  root.dataset.theme = chosen;
  root.dataset.keys = keys.checked ? "on" : "off";
  dispatchEvent(new CustomEvent("theme"));
}

const known = kept("theme");
if ([...theme.options].some((option) => option.value === known)) theme.value = known;
keys.checked = kept("keys") !== "off";
theme.addEventListener("change", () => { keep("theme", theme.value); show(); });
keys.addEventListener("change", () => { keep("keys", keys.checked ? "on" : "off"); show(); });
isDark.addEventListener("change", show);
show();
