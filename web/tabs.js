// The views beside the scene, one at a time, as tabs (WAI-ARIA: arrows go from one to the next).

export class Tabs {
  /** `shown` is told when another one is shown. */
  constructor(shown) {
    this.shown = shown;
    this.tabs = [...document.querySelectorAll("#views [role=tab]")];
    this.tabs.forEach((tab, index) => {
      tab.addEventListener("click", () => this.show(index));
      tab.addEventListener("keydown", (event) => {
        const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        if (!step) return;
        event.preventDefault();
        const next = (index + step + this.tabs.length) % this.tabs.length;
        this.show(next);
        this.tabs[next].focus();
      });
    });
    this.show(0);
  }

  /** Shows the one of a name. */
  open(name) {
    this.show(this.tabs.findIndex((tab) => tab.getAttribute("aria-controls") === name));
  }

  show(index) {
    this.tabs.forEach((tab, at) => {
      const isShown = at === index;
      tab.setAttribute("aria-selected", String(isShown));
      tab.tabIndex = isShown ? 0 : -1;
      document.getElementById(tab.getAttribute("aria-controls")).hidden = !isShown;
    });
    this.current = this.tabs[index].getAttribute("aria-controls");
    this.shown(this.current);
  }
}
