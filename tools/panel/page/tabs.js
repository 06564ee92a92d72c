// The names of the views: those that the source offers, and which of them is shown.
import { bind } from "./keys.js";
import { by, reachable } from "./renew.js";
import { isOffered } from "./state.js";

export function makeTabs({ state, update, subscribe }) {
  const bar = document.querySelector("nav"), tabs = [...bar.querySelectorAll("[role=tab]")];

  function draw(now) {
    for (const tab of tabs) {
      const is_shown = tab.dataset.view === now.view;
      if (now.hello) tab.hidden = !isOffered(now, tab.dataset.view);
      tab.setAttribute("aria-selected", String(is_shown));
      tab.tabIndex = is_shown ? 0 : -1;
      by(`view-${tab.dataset.view}`).hidden = !is_shown;
    }
  }

  // `find`: of the place of the focus and the number of tabs, the place of the next
  function goTab(find) {
    const offered = tabs.filter((tab) => !tab.hidden), next = offered.at(find(offered.indexOf(document.activeElement), offered.length));
    next.focus();
    update.show(next.dataset.view);
  }

  subscribe(["hello", "view"], draw);
  draw(state());
  // A view has another size when it is shown, filled or squeezed: what is wider than its place is known then.
  const sizes = new ResizeObserver(() => reachable(by(`view-${state().view}`)));
  for (const tab of tabs) sizes.observe(by(`view-${tab.dataset.view}`));
  for (const tab of tabs) tab.onclick = () => update.show(tab.dataset.view);
  bind("tabs", bar, {
    ArrowRight: () => goTab((here, count) => (here + 1) % count), ArrowLeft: () => goTab((here) => here - 1), Home: () => goTab(() => 0), End: () => goTab(() => -1),
  });
  by("skip").onclick = () => by(`view-${state().view}`).focus();
}
