// The view of the data link: its state, its lists and the variables on the fast and the medium list.
import { by, put, renew } from "./renew.js";
import * as tables from "./tables.js";

export function makeLink({ subscribe }) {
  subscribe(["hello", "robot", "view"], ({ view, robot: { link } }) => {
    if (view !== "link" || !link) return;
    put(by("link-state"), tables.linkState(link));
    renew(by("link-lists"), tables.linkLists(link.lists));
    renew(by("link-chosen"), tables.linkRows(link.chosen));
  });
}
