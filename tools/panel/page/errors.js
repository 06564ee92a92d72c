// The view of errors: unexpected ones, and those of every healthy walk.
import { by, put, renew } from "./renew.js";
import { unexpected } from "./state.js";
import * as tables from "./tables.js";

export function makeErrors({ subscribe }) {
  subscribe(["hello", "robot", "view"], (now) => {
    const rows = unexpected(now);
    put(by("error-count"), rows.length ? String(rows.length) : "");
    if (now.view !== "errors") return;
    renew(by("errors-unexpected"), tables.errors(rows, "unexpected errors"));
    renew(by("errors-normal"), tables.errors((now.robot.errors ?? []).filter((row) => row.normal), "errors as in every healthy walk"));
  });
}
